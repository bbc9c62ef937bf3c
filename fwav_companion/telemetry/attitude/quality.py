"""Quality of the attitude stream: the best interpolation, and its error. PURE.

Every interpolation is tested on known samples: one sample is left out and predicted from its neighbours, at twice the
spacing. The error of a polynomial there is a known multiple of its error in the middle of an interval.
"""

from __future__ import annotations

from collections.abc import Sequence
from enum import StrEnum
from itertools import pairwise
from math import exp, hypot, inf, pi, sqrt
from typing import NamedTuple

from fwav_companion.geometry.stamps import BootNs
from fwav_companion.telemetry.attitude.angular_motion import MOST_SWING, AngularMotion
from fwav_companion.telemetry.attitude.interpolation import quaternion_at, segment_with_rates
from fwav_companion.telemetry.attitude.leave_one_out import squared_angle, squared_leave_one_out_error
from fwav_companion.telemetry.attitude.rate_fit import RateFit
from fwav_companion.types import AttitudeSample
from fwav_companion.types.flight_status import AttitudeReport

SEVEN = 7
"""Number of neighbouring samples in one check."""
CHECK_EVERY_NS = 18_000_000
"""Least time between two checks: fifty checks a second suffice, and bound their cost."""
FIRST_TRIALS = 100
"""Number of first checks that test every interpolation: two seconds, as long as the memory. Later checks measure the
motion alone."""
THEN_EVERY_NS = 100_000_000
"""Mean pause between later trials (checks that test every interpolation): at 100 Hz about every tenth sample. A trial
costs as much time as two attitudes without one."""
GOLDEN = 0.6180339887498949
"""Golden ratio. Its multiples spread the trials evenly over the phases of their pauses: with a constant pause, a motion
of ten beats a second would be seen at one phase only."""
MEMORY_S = 2.0
CHECKS_TO_BEGIN = 20
UNEVEN = 2.5
"""Seven samples whose longest interval exceeds the shortest by this factor are not used for checks."""

FOUR_IS_ENOUGH = 1.5e-4
"""Error of four attitudes below which no other method is considered, rad, RMS: 1.5 mm from 10 m. Four attitudes need
the least waiting."""
CHANGE_FOR = 0.7
"""Factor on the present method's error: another method is chosen where its error is below the product."""

FOUR_LEFT_OUT, SIX_LEFT_OUT, RATES_LEFT_OUT = 64.0 / 9.0, 36.0 * 64.0 / 225.0, 16.0
"""Leave-one-out error over the error in the middle of an interval: ratios of the products of distances to the nodes."""
SIX_NOISE = 1.0 + 524.0 / 400.0
"""Variance of a leave-one-out error of six, for independent sample errors: one plus the squared weights."""
NOISE_SHARE = (1.0 + 34.0 / 36.0) / SIX_NOISE
"""Ratio of leave-one-out variances for independent sample errors: that of four attitudes over that of six."""
MOST_NOISE = 0.01
"""Largest noise of attitudes, rad, RMS about all axes together: an autopilot's attitudes scatter by 0.1 or 0.2 degrees.
A larger leave-one-out error of six is motion that the samples do not show."""
SLOWEST_CHECKED_RATE = 0.1
"""Angular rate below which an error of a stamp does not show in the attitudes, rad/s, RMS."""

UNCHECKED_SHARE = 0.1
"""Interpolation error before the stream was measured, as a share of acceleration times interval squared. A chord misses
an eighth."""
HOPELESS = 0.25
"""Share of the squared swing from which squared leave-one-out errors do not shrink by the known ratio."""
TOO_SLOW = 0.1
"""Share of the rates' mean square that the attitudes leave unexplained, above which the stream does not show the
motion."""
UNSEEN_LIMIT = 0.01
"""Bound on the motion that only the rates show, rad, RMS. A motion faster than half the sample rate has an amplitude
below its rate times the spacing over pi. If that is below 0.6 degrees, the vehicle moves smoothly: the missed part is
noise of its attitudes, and their instants are known. A wing of 5 degrees at 5 Hz, sampled at 3.3 Hz, is at 0.19."""
STILL = 0.03
"""Rate below which the vehicle is at rest, rad/s, RMS of the rates as sent, all axes together (1.7 deg/s). The
unexplained rest is then noise of the gyros (0.1 deg/s), or a step of the attitude alone, as when an EKF aligns its yaw.
A motion of 15 Hz below this rate has an amplitude of 0.5 mrad: 5 mm from 10 m. Interpolation and its sigma do not
depend on this bound, because at such rates an error of the instant has no effect."""


class Method(StrEnum):
    """Interpolation method."""

    FOUR = "four attitudes"
    SIX = "six attitudes"
    RATES = "two attitudes and their corrected rates"


POWERS = {Method.FOUR: 4, Method.SIX: 6, Method.RATES: 4}
"""Power of the interval's width by which each method's error grows."""


class _Unseen(NamedTuple):
    """Motion that the attitudes may miss, from the checks so far."""

    angle: float
    """RMS of a motion that only the rates show, rad; 0 where the stream is too slow for it."""
    unexplained: float
    """Rates that the attitudes leave unexplained, rad/s, where the stream is too slow for the motion."""
    instant_sigma_s: float


ALL_SEEN = _Unseen(0.0, 0.0, 0.0)
"""Result where the attitudes show the motion."""


class AttitudeQuality:
    """Quality of the attitude stream: running means over the last seconds' checks of seven neighbouring samples."""

    __slots__ = (
        "_due_ns",
        "_four2",
        "_last_ns",
        "_rates2",
        "_six2",
        "_tried_ns",
        "_unseen",
        "count",
        "method",
        "motion",
        "rates",
        "settled",
        "trials",
    )

    def __init__(self) -> None:
        self._last_ns: BootNs | None = None
        self._tried_ns: BootNs | None = None
        self._due_ns = 0
        self.count = self.trials = 0
        """Number of checks so far, and of those that tested the interpolations."""
        self.settled = False
        """Whether enough samples were checked for the results to be used."""
        self._four2 = self._six2 = self._rates2 = 0.0
        self._unseen: _Unseen | None = None
        self.rates = RateFit()
        """Correction of the rates as sent, and whether they can be used."""
        self.motion = AngularMotion(self.rates)
        """Motion that the interpolation has to follow."""
        self.method = Method.FOUR
        """Method in use."""

    # Results.

    @property
    def stamp_scatter_s(self) -> float:
        """Upper bound of the independent errors of stamps, s, RMS: larger errors would show in moving attitudes.

        Noise, and motion too fast for the stream, make the bound larger than the errors. It is infinite where the
        motion is too slow to show them.
        """
        if not self.settled or self.motion.rate2 < SLOWEST_CHECKED_RATE**2:
            return inf
        return sqrt(self._six2 / (SIX_NOISE * self.motion.rate2))

    @property
    def instant_sigma_s(self) -> float:
        """One sigma of an attitude's instant, s. Not 0 where attitudes are too slow for the motion: then the instant is
        uniform over the whole spacing.
        """
        return self._missed().instant_sigma_s if self.settled else 0.0

    @property
    def still(self) -> bool:
        """Whether the autopilot sends rates that show no motion."""
        return 0.0 < self.rates.sent_rms < STILL and not self.motion.alternates

    @property
    def too_slow(self) -> bool:
        """Whether the rates show motion that the attitudes do not: it is faster than they are sampled."""
        unexplained = self.rates.disagreement
        return self.motion.alternates or unexplained * unexplained > TOO_SLOW * self.rates.sent_rms**2

    def sigma(self, interval_s: float, method: Method) -> float:
        """One sigma of interpolating over an interval of this width, rad about each axis."""
        if not self.settled:
            return min(MOST_SWING, UNCHECKED_SHARE * self.motion.angular_acceleration * interval_s**2)
        missed, spacing_s = self._missed(), self.motion.spacing_s
        error = hypot(self._error(method), missed.angle) * max(1.0, interval_s / spacing_s) ** POWERS[method]
        if missed.unexplained:
            error += 0.5 * missed.unexplained * max(interval_s, spacing_s)
        return min(error, self.motion.swing)

    def _error(self, method: Method) -> float:
        """RMS error of an interpolation at the stream's own spacing, rad."""
        if method is Method.FOUR:
            return sqrt(self._four_truncation2())
        if method is Method.SIX:
            return sqrt(self._amid_interval2(self._six2, SIX_LEFT_OUT))
        return sqrt(self._amid_interval2(self._rates2, RATES_LEFT_OUT))

    def _missed(self) -> _Unseen:
        """The missed motion, cached: every queried attitude needs it, and only checks change it."""
        if self._unseen is None:
            self._unseen = self._motion_unseen() if self.too_slow else ALL_SEEN
        return self._unseen

    def _motion_unseen(self) -> _Unseen:
        motion, disagreement = self.motion, self.rates.disagreement
        unseen = disagreement * motion.spacing_s / pi
        if unseen < UNSEEN_LIMIT and not motion.alternates:
            return _Unseen(unseen, 0.0, 0.0)
        return _Unseen(0.0, disagreement, motion.spacing_s / sqrt(12.0))

    def status(self) -> AttitudeReport:
        """Part of the status: the interpolation, and the motion that it has to follow."""
        frequency = self.motion.frequency
        gain, lag_s = self.rates.model.response(frequency)
        return AttitudeReport(
            interpolation=self.method.value,
            interpolation_sigma=self.sigma(self.motion.spacing_s, self.method) if self.settled else None,
            motion_hz=0.0 if self.still else frequency / (2.0 * pi),
            motion_swing=self.motion.swing,
            too_slow_for_motion=self.too_slow and not self.still,
            rates_agree=self.rates.usable,
            rates_lag_s=lag_s if self.rates.usable else None,
            rates_gain=gain if self.rates.usable else None,
        )

    # Measurements.

    def is_due(self, middle_ns: BootNs) -> bool:
        """Whether seven samples around this instant are to be checked."""
        return self._last_ns is None or not 0 <= middle_ns - self._last_ns < CHECK_EVERY_NS

    def check(self, seven: Sequence[AttitudeSample]) -> None:
        """Check seven neighbouring samples, the newest last."""
        middle_ns = seven[3].boot_ns
        steps = [(b.boot_ns - a.boot_ns) * 1e-9 for a, b in pairwise(seven)]
        if max(steps) > UNEVEN * min(steps) and max(steps) - min(steps) > 3e-3:
            return
        elapsed_s = MEMORY_S if self._last_ns is None else abs(middle_ns - self._last_ns) * 1e-9
        self._last_ns = middle_ns
        self.count += 1
        self.settled = self.count >= CHECKS_TO_BEGIN
        self.motion.measure(seven[2:5], max(1.0 / self.count, 1.0 - exp(-elapsed_s / MEMORY_S)))
        self._unseen = None
        if self._tried_ns is None or not self._tried_ns <= middle_ns < self._due_ns:
            self._try_all(seven, middle_ns)

    def _try_all(self, seven: Sequence[AttitudeSample], middle_ns: BootNs) -> None:
        """Test every interpolation and the rates, and choose a method."""
        elapsed_s = MEMORY_S if self._tried_ns is None else abs(middle_ns - self._tried_ns) * 1e-9
        self._tried_ns = middle_ns
        self.trials += 1
        if self.trials >= FIRST_TRIALS:
            pause_ns = round(THEN_EVERY_NS * (1.0 + (self.trials + 1) * GOLDEN % 1.0 - self.trials * GOLDEN % 1.0))
            late_ns = middle_ns - self._due_ns
            self._due_ns = pause_ns + (self._due_ns if 0 <= late_ns < THEN_EVERY_NS else middle_ns)
        gain = max(1.0 / self.trials, 1.0 - exp(-elapsed_s / MEMORY_S))
        self.rates.insert(seven[1:6], self.motion.frequency, elapsed_s)
        self._try_out(seven, gain)
        self.motion.measure_alternation(seven[2:6], gain)
        self._choose()

    def _try_out(self, seven: Sequence[AttitudeSample], gain: float) -> None:
        others = [seven[k] for k in (0, 1, 2, 4, 5, 6)]
        middle = seven[3]
        self._four2 += gain * (squared_leave_one_out_error(others[1:5], middle) - self._four2)
        self._six2 += gain * (squared_leave_one_out_error(others, middle) - self._six2)
        if self.rates.usable:
            model = self.rates.model
            segment = segment_with_rates(seven[2], seven[4], model.corrected(seven[1:4]), model.corrected(seven[3:6]))
            self._rates2 += gain * (
                squared_angle(quaternion_at(segment, middle.boot_ns), middle.ned_from_body) - self._rates2
            )

    def _four_truncation2(self) -> float:
        """Squared error of four attitudes due to the motion alone, without the noise of the samples."""
        if self._hopeless(self._four2):
            return self._four2
        noise2 = min(self._six2, SIX_NOISE * MOST_NOISE**2)
        return max(0.0, self._four2 - NOISE_SHARE * noise2) / FOUR_LEFT_OUT**2

    def _amid_interval2(self, left_out2: float, ratio: float) -> float:
        return left_out2 if self._hopeless(left_out2) else left_out2 / ratio**2

    def _hopeless(self, left_out2: float) -> bool:
        return left_out2 > HOPELESS * self.motion.swing**2

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
