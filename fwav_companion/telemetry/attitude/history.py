"""Attitudes of the last seconds, and from them the attitude at any instant."""

from __future__ import annotations

from bisect import bisect_left, bisect_right
from math import inf, sqrt

import msgspec

from fwav_companion.geometry.rotations import Quaternion, difference, exp, multiply
from fwav_companion.geometry.stamps import NS_PER_S, BootNs
from fwav_companion.geometry.vectors import Vector3, add, dot, scale, subtract
from fwav_companion.telemetry.attitude.interpolation import (
    Piece,
    piece_through,
    piece_with_rates,
    quaternion_at,
    rates_at,
)
from fwav_companion.telemetry.attitude.quality import MOST_SWING, SEVEN, AttitudeQuality, Method
from fwav_companion.types import AttitudeSample, Reason, Unpaired

KEPT_NS = 3 * NS_PER_S
"""A frame may come 0.5 s late and wait 0.4 s; a clock that is unsure may place it half a second off."""
MOST_KEPT = 2048
"""3 s at 400 Hz are 1200; a sender that floods us is cut here."""
WIDEST_GAP_NS = 500_000_000
"""Autopilots that refuse every rate still send four a second: 250 ms apart, and one may be lost."""
MOST_EXTRAPOLATION_NS = 30_000_000
"""Beyond the newest attitude: a body that flaps at 5 Hz and 5 deg has then left its tangent by 2 degrees."""
EXTRAPOLATED_SHARE = 0.5
"""Of the acceleration times the square of the time: a tangent's departure."""
UNSURE_RATE = 0.05
"""rad/s, one sigma of the rate at the newest attitude, where the stream shows the motion well."""
END_SLOPE = 32.0 / 3.0
"""Of four attitudes' polynomial: error of the slope at its end, times the spacing, over the error amid its middle."""
MOST_SIGMA = 0.1
"""rad: across a hole, an attitude less certain than 6 degrees is none."""
HOLE = 2.5
"""Intervals wider than the stream's own by this are holes in it; a stream that is slow throughout has none."""
REACH = 4
"""Intervals on each side that a new sample may change."""

NONE_YET = Unpaired(Reason.NO_ATTITUDE)


class AttitudeAt(msgspec.Struct, frozen=True, gc=False):
    """The attitude at one instant."""

    ned_from_body: Quaternion
    rates: Vector3
    """Of the interpolated course, rad/s, body axes."""
    sigma: float
    """What interpolation or extrapolation adds, one sigma about each axis, radians."""
    gap_s: float
    """To the nearest sample."""
    spacing_s: float = 0.0
    """Between the samples around it; of the stream where it lies beyond the newest."""


class AttitudeHistory:
    """A bounded, ordered store of attitudes with an interpolation that is worked out once an interval."""

    __slots__ = ("_check", "_kept_ns", "_most_kept", "_pieces", "_samples", "_times")

    def __init__(self, kept_ns: int = KEPT_NS) -> None:
        self._kept_ns, self._most_kept = kept_ns, MOST_KEPT * max(1, kept_ns // KEPT_NS)
        self._times: list[BootNs] = []
        self._samples: list[AttitudeSample] = []
        self._pieces: list[tuple[Piece, float] | None] = []  # with its sigma; by the interval's first sample
        self._check = AttitudeQuality()

    def __len__(self) -> int:
        return len(self._times)

    @property
    def samples(self) -> tuple[AttitudeSample, ...]:
        """All that are kept, in order of time."""
        return tuple(self._samples)

    @property
    def newest(self) -> AttitudeSample | None:
        """The latest sample."""
        return self._samples[-1] if self._samples else None

    @property
    def check(self) -> AttitudeQuality:
        """What the stream shows about itself."""
        return self._check

    def insert(self, sample: AttitudeSample) -> bool:
        """Take a sample, in any order. False: there is one of this instant already, or it is older than all kept."""
        times = self._times
        index = bisect_left(times, sample.boot_ns)
        if index < len(times) and times[index] == sample.boot_ns:
            return False
        if times and sample.boot_ns < times[-1] - self._kept_ns:
            return False
        times.insert(index, sample.boot_ns)
        self._samples.insert(index, sample)
        self._pieces.insert(index, None)
        for near in range(max(0, index - REACH), min(len(times), index + REACH)):
            self._pieces[near] = None
        self._trim()
        if len(times) >= SEVEN:
            self._check.look(self._samples[-SEVEN:])
        return True

    def shift(self, by_ns: int) -> None:
        """Move every kept sample in time, together."""
        self._samples = [AttitudeSample(BootNs(s.boot_ns + by_ns), s.ned_from_body, s.rates) for s in self._samples]
        self._times = [s.boot_ns for s in self._samples]
        self._pieces = [None] * len(self._samples)

    def clear(self) -> None:
        """Forget everything."""
        self._times.clear()
        self._samples.clear()
        self._pieces.clear()
        self._check = AttitudeQuality()

    def _trim(self) -> None:
        excess = max(bisect_left(self._times, self._times[-1] - self._kept_ns), len(self._times) - self._most_kept)
        if excess > 0:
            del self._times[:excess], self._samples[:excess], self._pieces[:excess]

    def ready_for(self, boot_ns: BootNs) -> bool:
        """Enough samples lie beyond this instant that more of them would not change the answer."""
        beyond = 3 if self._check.method is Method.SIX else 2
        return len(self._times) >= beyond and self._times[-beyond] >= boot_ns

    def quaternion_at(self, boot_ns: BootNs) -> Quaternion | Unpaired:
        """``ned_from_body`` alone."""
        index = bisect_right(self._times, boot_ns) - 1
        if 0 <= index < len(self._times) - 1:
            known = self._pieces[index]
            if known is not None:
                return quaternion_at(known[0], boot_ns)
        at = self.at(boot_ns)
        return at if isinstance(at, Unpaired) else at.ned_from_body

    def at(self, boot_ns: BootNs) -> AttitudeAt | Unpaired:
        """The attitude there, with its uncertainty; or why there is none."""
        times = self._times
        if not times:
            return NONE_YET
        index = bisect_right(times, boot_ns) - 1
        if index < 0:
            return Unpaired(Reason.BEFORE_HISTORY, (times[0] - boot_ns) * 1e-9)
        if index == len(times) - 1:
            return self._beyond(boot_ns)
        gap_s = min(boot_ns - times[index], times[index + 1] - boot_ns) * 1e-9
        piece, sigma = self._pieces[index] or self._build(index)
        if sigma > MOST_SIGMA and (times[index + 1] - times[index]) * 1e-9 > HOLE * self._check.spacing_s:
            return Unpaired(Reason.ATTITUDE_GAP, gap_s)
        spacing_s = (times[index + 1] - times[index]) * 1e-9
        return AttitudeAt(quaternion_at(piece, boot_ns), rates_at(piece, boot_ns), sigma, gap_s, spacing_s)

    def _build(self, index: int) -> tuple[Piece, float]:
        """The interval after sample ``index``, by the stream's method as far as the samples around it allow."""
        times, samples, check = self._times, self._samples, self._check
        inside_four, inside_six = 1 <= index <= len(times) - 3, 2 <= index <= len(times) - 4
        interval_s = (times[index + 1] - times[index]) * 1e-9
        if check.method is Method.RATES and inside_four:
            model = check.rates.model
            at_first, at_last = (model.corrected(samples[k - 1 : k + 2]) for k in (index, index + 1))
            piece = piece_with_rates(samples[index], samples[index + 1], at_first, at_last)
            sigma = check.sigma(interval_s, Method.RATES)
        elif check.method is Method.SIX and inside_six:
            piece = piece_through(times[index], samples[index - 2 : index + 4])
            sigma = check.sigma(interval_s, Method.SIX)
        else:
            piece = piece_through(times[index], samples[max(0, index - 1) : index + 3])
            sigma = check.sigma(interval_s, Method.FOUR)
            if not inside_four:
                sigma += 0.125 * check.angular_acceleration * interval_s**2 * 0.2
        if not check.settled:
            sigma = max(sigma, _first_guess(samples[index], samples[index + 1], interval_s))
        built = (piece, sigma if interval_s * 1e9 <= WIDEST_GAP_NS else inf)
        self._pieces[index] = built
        return built

    def _beyond(self, boot_ns: BootNs) -> AttitudeAt | Unpaired:
        """On from the newest attitude, at the rate that the course had there."""
        last = self._samples[-1]
        age_ns = boot_ns - last.boot_ns
        age_s = age_ns * 1e-9
        if age_ns > MOST_EXTRAPOLATION_NS:
            return Unpaired(Reason.STALE_ATTITUDE, age_s)
        rates = last.rates
        if len(self._times) >= 2:
            piece, _ = self._pieces[-2] or self._build(len(self._times) - 2)
            rates = rates_at(piece, last.boot_ns)
        q = multiply(last.ned_from_body, exp(scale(rates, age_s)))
        sigma = EXTRAPOLATED_SHARE * self._check.angular_acceleration * age_s * age_s + age_s * self._unsure_rate
        spacing_s = self._check.spacing_s
        return (
            AttitudeAt(q, rates, sigma, age_s, spacing_s)
            if sigma <= MOST_SIGMA
            else Unpaired(Reason.STALE_ATTITUDE, age_s)
        )

    @property
    def _unsure_rate(self) -> float:
        """One sigma of the course's rate at the newest attitude, rad/s."""
        spacing_s = self._check.spacing_s
        return UNSURE_RATE + (END_SLOPE * self._check.sigma(spacing_s, Method.FOUR) / spacing_s if spacing_s else 0.0)


def _first_guess(first: AttitudeSample, last: AttitudeSample, interval_s: float) -> float:
    """What interpolation may miss while the stream was not checked yet: by how much these two contradict themselves."""
    turn = scale(difference(last.ned_from_body, first.ned_from_body), 1.0 / interval_s)
    sent = scale(add(first.rates, last.rates), 0.5)
    change = subtract(last.rates, first.rates)
    apart = subtract(turn, sent)
    return min(MOST_SWING, interval_s * (0.5 * sqrt(dot(apart, apart)) + 0.125 * sqrt(dot(change, change))))
