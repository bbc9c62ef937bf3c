"""A bounded history of attitudes, and the attitude interpolated at any instant in it."""

from __future__ import annotations

from bisect import bisect_left, bisect_right
from math import inf, sqrt

import msgspec

from fwav_companion.geometry.rotations import Quaternion, difference, exp, multiply
from fwav_companion.geometry.stamps import NS_PER_S, BootNs
from fwav_companion.geometry.vectors import ZERO3, Vector3, add, dot, scale, subtract
from fwav_companion.telemetry.attitude.angular_motion import MOST_SWING
from fwav_companion.telemetry.attitude.interpolation import (
    Segment,
    course_at,
    quaternion_at,
    segment_through,
    segment_with_rates,
)
from fwav_companion.telemetry.attitude.quality import SEVEN, AttitudeQuality, Method
from fwav_companion.types import AttitudeSample, Reason, Unpaired

KEPT_NS = 3 * NS_PER_S
"""Time for which attitudes are stored. A frame may arrive 0.5 s late and wait 0.4 s; an uncertain clock may place it
half a second off."""
MOST_KEPT = 2048
"""Most stored samples: 3 s at 400 Hz are 1200. More than this is a flood, and the oldest samples are dropped."""
WIDEST_GAP_NS = 500_000_000
"""Longest interval that is interpolated. An autopilot that refuses every rate still sends 4 Hz: samples are 250 ms
apart, and one may be lost."""
MOST_EXTRAPOLATION_NS = 30_000_000
"""Longest extrapolation beyond the newest attitude: a body that flaps 5 deg at 5 Hz has then left its tangent by 2
deg."""
EXTRAPOLATED_SHARE = 0.5
"""Departure from a tangent, as a share of acceleration times time squared."""
UNSURE_RATE = 0.05
"""One sigma of the body rate at the newest attitude, rad/s, where the stream shows the motion well."""
END_SLOPE = 32.0 / 3.0
"""For a polynomial through four attitudes: slope error at its end times the spacing, over the error in the middle."""
MOST_SIGMA = 0.1
"""Largest one sigma of a usable attitude that is interpolated across a hole or extrapolated, rad: 6 degrees."""
HOLE = 2.5
"""An interval is a hole where it exceeds the stream's own spacing by this factor. A stream that is slow throughout has
no holes."""
REACH = 4
"""Number of intervals on each side of a new sample whose interpolation it may change."""

NONE_YET = Unpaired(Reason.NO_ATTITUDE)


class AttitudeAt(msgspec.Struct, frozen=True, gc=False):
    """Attitude at one instant."""

    ned_from_body: Quaternion
    rates: Vector3
    """Angular velocity of the interpolated attitude, rad/s, body axes."""
    sigma: float
    """One sigma that interpolation or extrapolation adds, about each axis, radians."""
    gap_s: float
    """Seconds to the nearest sample."""
    spacing_s: float = 0.0
    """Seconds between the samples around the instant; the stream's mean spacing beyond the newest sample."""
    angular_acceleration: Vector3 = ZERO3
    """Angular acceleration of the interpolated attitude, rad/s^2, body axes."""
    frequency: float = 0.0
    """Angular frequency of the motion that the samples show, rad/s."""


class AttitudeHistory:
    """A bounded store of attitudes in order of time; each interval's interpolation is computed once."""

    __slots__ = ("_kept_ns", "_most_kept", "_samples", "_segments", "_times", "quality")

    def __init__(self, kept_ns: int = KEPT_NS) -> None:
        self._kept_ns, self._most_kept = kept_ns, MOST_KEPT * max(1, kept_ns // KEPT_NS)
        self._times: list[BootNs] = []
        self._samples: list[AttitudeSample] = []
        self._segments: list[tuple[Segment, float] | None] = []  # segment and its sigma, by the interval's first sample
        self.quality = AttitudeQuality()
        """Measured quality of the stream."""

    def __len__(self) -> int:
        return len(self._times)

    @property
    def samples(self) -> tuple[AttitudeSample, ...]:
        """All stored samples, in order of time."""
        return tuple(self._samples)

    def after(self, boot_ns: BootNs) -> list[AttitudeSample]:
        """The stored samples later than this instant, in order of time."""
        return self._samples[bisect_right(self._times, boot_ns) :]

    @property
    def newest(self) -> AttitudeSample | None:
        """The latest sample."""
        return self._samples[-1] if self._samples else None

    def insert(self, sample: AttitudeSample) -> bool:
        """Store a sample, in any order. Returns False where its instant is already stored or older than the whole
        store.
        """
        times = self._times
        index = bisect_left(times, sample.boot_ns)
        if index < len(times) and times[index] == sample.boot_ns:
            return False
        if times and sample.boot_ns < times[-1] - self._kept_ns:
            return False
        times.insert(index, sample.boot_ns)
        self._samples.insert(index, sample)
        self._segments.insert(index, None)
        first, end = max(0, index - REACH), min(len(times), index + REACH)
        self._segments[first:end] = [None] * (end - first)
        if times[0] < times[-1] - self._kept_ns or len(times) > self._most_kept:
            self._trim()
        if len(times) >= SEVEN and self.quality.is_due(times[-4]):
            self.quality.check(self._samples[-SEVEN:])
        return True

    def shift(self, by_ns: int) -> None:
        """Move all stored samples in time by the same amount."""
        self._samples = [AttitudeSample(BootNs(s.boot_ns + by_ns), s.ned_from_body, s.rates) for s in self._samples]
        self._times = [s.boot_ns for s in self._samples]
        self._segments = [None] * len(self._samples)

    def clear(self) -> None:
        """Forget everything."""
        self._times.clear()
        self._samples.clear()
        self._segments.clear()
        self.quality = AttitudeQuality()

    def _trim(self) -> None:
        excess = max(bisect_left(self._times, self._times[-1] - self._kept_ns), len(self._times) - self._most_kept)
        if excess > 0:
            del self._times[:excess], self._samples[:excess], self._segments[:excess]

    def ready_for(self, boot_ns: BootNs) -> bool:
        """Whether enough samples lie beyond this instant that more samples would not change the answer."""
        beyond = 3 if self.quality.method is Method.SIX else 2
        return len(self._times) >= beyond and self._times[-beyond] >= boot_ns

    def quaternion_at(self, boot_ns: BootNs) -> Quaternion | Unpaired:
        """``ned_from_body`` at the instant, without rates and sigma."""
        index = bisect_right(self._times, boot_ns) - 1
        if 0 <= index < len(self._times) - 1:
            known = self._segments[index]
            if known is not None:
                return quaternion_at(known[0], boot_ns)
        at = self.at(boot_ns)
        return at if isinstance(at, Unpaired) else at.ned_from_body

    def at(self, boot_ns: BootNs) -> AttitudeAt | Unpaired:
        """Attitude at the instant with its uncertainty, or the reason why there is no attitude."""
        times = self._times
        if not times:
            return NONE_YET
        index = bisect_right(times, boot_ns) - 1
        if index < 0:
            return Unpaired(Reason.BEFORE_HISTORY, (times[0] - boot_ns) * 1e-9)
        if index == len(times) - 1:
            return self._beyond(boot_ns)
        gap_s = min(boot_ns - times[index], times[index + 1] - boot_ns) * 1e-9
        segment, sigma = self._segments[index] or self._build(index)
        hole = (times[index + 1] - times[index]) * 1e-9 > HOLE * self.quality.motion.spacing_s
        if sigma == inf or (sigma > MOST_SIGMA and hole):
            return Unpaired(Reason.ATTITUDE_GAP, gap_s)
        spacing_s = (times[index + 1] - times[index]) * 1e-9
        ned_from_body, rates, angular_acceleration = course_at(segment, boot_ns)
        return AttitudeAt(
            ned_from_body=ned_from_body,
            rates=rates,
            sigma=sigma,
            gap_s=gap_s,
            spacing_s=spacing_s,
            angular_acceleration=angular_acceleration,
            frequency=self.quality.motion.shown_frequency,
        )

    def _build(self, index: int) -> tuple[Segment, float]:
        """Segment after sample ``index``, by the chosen method as far as the neighbouring samples allow."""
        times, samples, quality = self._times, self._samples, self.quality
        inside_four, inside_six = 1 <= index <= len(times) - 3, 2 <= index <= len(times) - 4
        interval_s = (times[index + 1] - times[index]) * 1e-9
        if quality.method is Method.RATES and inside_four:
            model = quality.rates.model
            at_first, at_last = (model.corrected(samples[k - 1 : k + 2]) for k in (index, index + 1))
            segment = segment_with_rates(samples[index], samples[index + 1], at_first, at_last)
            sigma = quality.sigma(interval_s, Method.RATES)
        elif quality.method is Method.SIX and inside_six:
            segment = segment_through(times[index], samples[index - 2 : index + 4])
            sigma = quality.sigma(interval_s, Method.SIX)
        else:
            segment = segment_through(times[index], samples[max(0, index - 1) : index + 3])
            sigma = quality.sigma(interval_s, Method.FOUR)
            if not inside_four:
                sigma += 0.125 * quality.motion.angular_acceleration * interval_s**2 * 0.2
        if not quality.settled:
            sigma = max(sigma, _first_guess(samples[index], samples[index + 1], interval_s))
        built = (segment, sigma if interval_s * 1e9 <= WIDEST_GAP_NS else inf)
        self._segments[index] = built
        return built

    def _beyond(self, boot_ns: BootNs) -> AttitudeAt | Unpaired:
        """Attitude extrapolated from the newest sample at the interpolated rate there."""
        last = self._samples[-1]
        age_ns = boot_ns - last.boot_ns
        age_s = age_ns * 1e-9
        if age_ns > MOST_EXTRAPOLATION_NS:
            return Unpaired(Reason.STALE_ATTITUDE, age_s)
        rates = last.rates
        if len(self._times) >= 2:
            segment, _ = self._segments[-2] or self._build(len(self._times) - 2)
            _, rates, _ = course_at(segment, last.boot_ns)
        q = multiply(last.ned_from_body, exp(scale(rates, age_s)))
        sigma = (
            EXTRAPOLATED_SHARE * self.quality.motion.angular_acceleration * age_s * age_s + age_s * self._unsure_rate
        )
        spacing_s = self.quality.motion.spacing_s
        return (
            AttitudeAt(ned_from_body=q, rates=rates, sigma=sigma, gap_s=age_s, spacing_s=spacing_s)
            if sigma <= MOST_SIGMA
            else Unpaired(Reason.ATTITUDE_GAP, age_s)
        )

    @property
    def _unsure_rate(self) -> float:
        """One sigma of the interpolated rate at the newest attitude, rad/s."""
        spacing_s = self.quality.motion.spacing_s
        return UNSURE_RATE + (END_SLOPE * self.quality.sigma(spacing_s, Method.FOUR) / spacing_s if spacing_s else 0.0)


def _first_guess(first: AttitudeSample, last: AttitudeSample, interval_s: float) -> float:
    """Interpolation error assumed before the stream was measured: the disagreement of two samples with their own
    rates.
    """
    turn = scale(difference(last.ned_from_body, first.ned_from_body), 1.0 / interval_s)
    sent = scale(add(first.rates, last.rates), 0.5)
    change = subtract(last.rates, first.rates)
    apart = subtract(turn, sent)
    return min(MOST_SWING, interval_s * (0.5 * sqrt(dot(apart, apart)) + 0.125 * sqrt(dot(change, change))))
