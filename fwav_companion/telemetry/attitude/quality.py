"""What the attitude stream itself shows: how fast the motion is, which interpolation suits it, what that leaves open.

Every interpolation is tried on samples that are known: one is left out and predicted from its neighbours, at twice the
spacing that matters. A polynomial's error there is a known multiple of its error in the middle of an interval.
"""

from __future__ import annotations

from collections.abc import Sequence
from enum import StrEnum
from itertools import pairwise
from math import dist, exp, inf, pi, sqrt
from typing import Any, NamedTuple

from fwav_companion.geometry.stamps import BootNs
from fwav_companion.geometry.vectors import dot, scale, subtract
from fwav_companion.telemetry.attitude.interpolation import aligned, piece_with_rates, quaternion_at
from fwav_companion.telemetry.attitude.leave_one_out import apart2, left_out2
from fwav_companion.telemetry.attitude.rate_fit import ALTERNATING, RateFit
from fwav_companion.types import AttitudeSample

SEVEN = 7
"""Neighbouring samples that one check looks at."""
CHECK_EVERY_NS = 18_000_000
"""Fifty checks a second are plenty, and bound what they cost."""
MEMORY_S = 2.0
CHECKS_TO_BEGIN = 20
UNEVEN = 2.5
"""Seven samples whose longest interval exceeds the shortest by more say little about any interpolation."""

FOUR_IS_ENOUGH = 1.5e-4
"""rad, RMS: 1.5 mm from 10 m. No way needs less waiting than four attitudes: they are left only for cause."""
CHANGE_FOR = 0.7
"""Another method must promise errors smaller by this factor."""

FOUR_LEFT_OUT, SIX_LEFT_OUT, RATES_LEFT_OUT = 64.0 / 9.0, 36.0 * 64.0 / 225.0, 16.0
"""Error with the middle sample left out, over that amid an interval: ratios of the products of distances."""
SIX_NOISE = 1.0 + 524.0 / 400.0
"""Of independent errors of the samples: the square of what is left out of six, one plus the squared weights."""
NOISE_SHARE = (1.0 + 34.0 / 36.0) / SIX_NOISE
"""Of the same: (left out of four)^2 over (left out of six)^2."""
MOST_NOISE = 0.01
"""rad, RMS about all axes together: an autopilot's attitudes scatter by a tenth of a degree or two. What six neighbours
miss a sample by beyond that is motion that they do not show."""
SLOWEST_TELLING_RATE = 0.1
"""rad/s, RMS: in slower motion, an error of a stamp does not show in the attitudes."""

MOST_SWING = 0.5
"""rad: the most that an interpolation may be off where nothing better is known."""
UNCHECKED_SHARE = 0.1
"""Of the acceleration times the square of the interval, before the stream was checked: a chord misses an eighth."""
HOPELESS = 0.25
"""Of the swing's square: errors so large, with a sample left out, do not shrink by the known ratio."""
TOO_SLOW = 0.1
"""Of the rates' mean square left unexplained by the attitudes' course: then the stream does not show the motion."""


class Method(StrEnum):
    """How attitudes are interpolated."""

    FOUR = "four attitudes"
    SIX = "six attitudes"
    RATES = "two attitudes and their corrected rates"


POWERS = {Method.FOUR: 4, Method.SIX: 6, Method.RATES: 4}
"""Their errors grow so with the width of an interval."""


class _Told(NamedTuple):
    """What the checks so far say of every interpolation, at the stream's own spacing."""

    errors: dict[Method, float]
    """RMS, rad."""
    unexplained: float
    """Of the rates, rad/s, where the stream is too slow for the motion."""
    swing: float
    instant_sigma_s: float


class AttitudeQuality:
    """Running means over the last seconds, of the checks of seven neighbouring samples."""

    __slots__ = (
        "_acceleration2",
        "_bend2",
        "_count",
        "_four2",
        "_last_ns",
        "_rate2",
        "_rates2",
        "_six2",
        "_spacing",
        "_told",
        "_unbent2",
        "method",
        "rates",
    )

    def __init__(self) -> None:
        self._last_ns: BootNs | None = None
        self._count = 0
        self._spacing = 0.0
        self._rate2 = self._acceleration2 = 0.0
        self._four2 = self._six2 = self._rates2 = 0.0
        self._bend2 = self._unbent2 = 0.0
        self._told: _Told | None = None
        self.rates = RateFit()
        """What the sent rates are worth."""
        self.method = Method.FOUR
        """The one that suits the stream."""

    # What it found.

    @property
    def settled(self) -> bool:
        """Enough was seen to say more than nothing."""
        return self._count >= CHECKS_TO_BEGIN

    @property
    def spacing_s(self) -> float:
        """Of the samples, on average."""
        return self._spacing

    @property
    def angular_acceleration(self) -> float:
        """RMS, rad/s^2."""
        return sqrt(self._acceleration2)

    @property
    def frequency(self) -> float:
        """Of the motion, rad/s, as its acceleration over its rate; at least so much, where samples only alternate."""
        if self.alternates:
            return pi / self._spacing
        return sqrt(self._acceleration2 / self._rate2) if self._rate2 > 1e-12 else 0.0

    @property
    def swing(self) -> float:
        """RMS amplitude of the motion about its mean, rad."""
        if self.alternates:  # what attitudes show of it and what rates do are its sine and its cosine at the samples
            peak2 = 0.25 * self._bend2 + self._rate2 / self.frequency**2
            return min(MOST_SWING, sqrt(0.5 * peak2))
        if self._acceleration2 <= 1e-12:
            return MOST_SWING
        return min(MOST_SWING, self._rate2 / sqrt(self._acceleration2))

    @property
    def stamp_scatter_s(self) -> float:
        """The most by which stamps can err independently of one another, RMS: more would show in moving attitudes.

        Noise and a motion too fast for the stream make it larger than it is. Infinite where nothing tells.
        """
        if not self.settled or self._rate2 < SLOWEST_TELLING_RATE**2:
            return inf
        return sqrt(self._six2 / (SIX_NOISE * self._rate2))

    @property
    def alternates(self) -> bool:
        """Half a beat lies between two attitudes: they show that there is a motion, and not when it is where."""
        return self._unbent2 > ALTERNATING * self._bend2 or self.rates.alternates

    @property
    def instant_sigma_s(self) -> float:
        """What attitudes too slow for the motion leave open of the instant of each: all of the time between two."""
        return self._what_is_told().instant_sigma_s if self.settled else 0.0

    @property
    def too_slow(self) -> bool:
        """The rates tell of motion that the attitudes do not show: it is faster than they come."""
        unexplained = self.rates.disagreement
        return self.alternates or unexplained * unexplained > TOO_SLOW * self.rates.sent_rms**2

    def sigma(self, interval_s: float, method: Method) -> float:
        """One sigma of interpolating over an interval of this width, rad about each axis."""
        if not self.settled:
            return min(MOST_SWING, UNCHECKED_SHARE * self.angular_acceleration * interval_s**2)
        told = self._what_is_told()
        error = told.errors[method] * max(1.0, interval_s / self._spacing) ** POWERS[method]
        if told.unexplained:
            error += 0.5 * told.unexplained * max(interval_s, self._spacing)
        return min(error, told.swing)

    def _what_is_told(self) -> _Told:
        """Asked for with every attitude that is wanted, and changed by checks alone."""
        if self._told is None:
            self._told = self._tell()
        return self._told

    def _tell(self) -> _Told:
        errors2 = {
            Method.FOUR: self._four_truncation2(),
            Method.SIX: self._amid_interval2(self._six2, SIX_LEFT_OUT),
            Method.RATES: self._amid_interval2(self._rates2, RATES_LEFT_OUT),
        }
        errors = {method: sqrt(error2) for method, error2 in errors2.items()}
        if not self.too_slow:
            return _Told(errors, 0.0, self.swing, 0.0)
        return _Told(errors, self.rates.disagreement, self.swing, self._spacing / sqrt(12.0))

    def status(self) -> dict[str, Any]:
        """For the status file and ``check``."""
        gain, lag_s = self.rates.model.response(self.frequency)
        return {
            "interpolation": self.method.value,
            "interpolation_sigma": self.sigma(self._spacing, self.method) if self.settled else None,
            "motion_hz": self.frequency / (2.0 * pi),
            "motion_swing": self.swing,
            "too_slow_for_motion": self.too_slow,
            "rates_agree": self.rates.usable,
            "rates_lag_s": lag_s if self.rates.usable else None,
            "rates_gain": gain if self.rates.usable else None,
        }

    # What it looks at.

    def look(self, seven: Sequence[AttitudeSample]) -> None:
        """Seven neighbouring samples, the newest last."""
        middle_ns = seven[3].boot_ns
        if self._last_ns is not None and 0 <= middle_ns - self._last_ns < CHECK_EVERY_NS:
            return
        steps = [(b.boot_ns - a.boot_ns) * 1e-9 for a, b in pairwise(seven)]
        if max(steps) > UNEVEN * min(steps) and max(steps) - min(steps) > 3e-3:
            return
        elapsed_s = MEMORY_S if self._last_ns is None else abs(middle_ns - self._last_ns) * 1e-9
        self._last_ns = middle_ns
        self._count += 1
        gain = max(1.0 / self._count, 1.0 - exp(-elapsed_s / MEMORY_S))
        self._measure(seven, gain)
        self.rates.insert(seven[1:6], self.frequency, elapsed_s)
        self._try_out(seven, gain)
        self._look_for_alternation(seven[2:6], gain)
        self._choose()
        self._told = None

    def _measure(self, seven: Sequence[AttitudeSample], gain: float) -> None:
        """How the body moves, by its attitudes' differences or by the sent rates, whichever tell of more."""
        before, middle, after = seven[2], seven[3], seven[4]
        h = 0.5e-9 * (after.boot_ns - before.boot_ns)
        first, amid, last = aligned([s.ned_from_body for s in (before, middle, after)])
        halfway = [0.5 * (a + b) for a, b in zip(first, last, strict=True)]
        bend, drift = 2.0 * dist(halfway, amid), dist(first, last)
        sent = scale(subtract(after.rates, before.rates), 0.5 / h)
        self._spacing += gain * (h - self._spacing)
        self._acceleration2 += gain * (max(4.0 * bend**2 / h**4, dot(sent, sent)) - self._acceleration2)
        self._rate2 += gain * (max(drift**2 / h**2, dot(middle.rates, middle.rates)) - self._rate2)

    def _look_for_alternation(self, four: Sequence[AttitudeSample], gain: float) -> None:
        """Whether each bend of the course undoes the one before; bends of noise undo two thirds."""
        a, b, c, d = aligned([sample.ned_from_body for sample in four])
        bends = [(p - 2.0 * q + r, q - 2.0 * r + s) for p, q, r, s in zip(a, b, c, d, strict=True)]
        self._bend2 += gain * (0.5 * sum(one * one + two * two for one, two in bends) - self._bend2)
        self._unbent2 += gain * (-sum(one * two for one, two in bends) - self._unbent2)

    def _try_out(self, seven: Sequence[AttitudeSample], gain: float) -> None:
        others = [seven[k] for k in (0, 1, 2, 4, 5, 6)]
        middle = seven[3]
        self._four2 += gain * (left_out2(others[1:5], middle) - self._four2)
        self._six2 += gain * (left_out2(others, middle) - self._six2)
        if self.rates.usable:
            model = self.rates.model
            piece = piece_with_rates(seven[2], seven[4], model.corrected(seven[1:4]), model.corrected(seven[3:6]))
            self._rates2 += gain * (apart2(quaternion_at(piece, middle.boot_ns), middle.ned_from_body) - self._rates2)

    def _four_truncation2(self) -> float:
        """What four attitudes miss by the motion being faster than they follow, without the noise of the samples."""
        if self._hopeless(self._four2):
            return self._four2
        noise2 = min(self._six2, SIX_NOISE * MOST_NOISE**2)
        return max(0.0, self._four2 - NOISE_SHARE * noise2) / FOUR_LEFT_OUT**2

    def _amid_interval2(self, left_out2: float, ratio: float) -> float:
        return left_out2 if self._hopeless(left_out2) else left_out2 / ratio**2

    def _hopeless(self, left_out2: float) -> bool:
        return left_out2 > HOPELESS * self.swing**2

    def _choose(self) -> None:
        if not self.settled:
            return
        if self._four_truncation2() < FOUR_IS_ENOUGH**2:
            self.method = Method.FOUR
            return
        promised2 = {
            Method.FOUR: self._amid_interval2(self._four2, FOUR_LEFT_OUT),
            Method.SIX: self._amid_interval2(self._six2, SIX_LEFT_OUT),
        }
        if self.rates.usable and not self.too_slow:
            promised2[Method.RATES] = self._amid_interval2(self._rates2, RATES_LEFT_OUT)
        best = min(promised2, key=promised2.__getitem__)
        if promised2[best] < CHANGE_FOR**2 * promised2.get(self.method, 1e300):
            self.method = best
