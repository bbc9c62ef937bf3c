"""Attitudes of the last seconds, and from them the attitude at any instant."""

from __future__ import annotations

from bisect import bisect_left, bisect_right
from math import sqrt

import msgspec

from fwav_companion.geometry.rotations import Quaternion, exp, multiply
from fwav_companion.geometry.stamps import NS_PER_S, BootNs
from fwav_companion.geometry.vectors import Vector3, norm, scale
from fwav_companion.nouns import AttitudeSample, Reason, Unpaired
from fwav_companion.telemetry.pieces import Piece, course_at, piece_through, quaternion_at

KEPT_NS = 3 * NS_PER_S
"""A frame may come 0.5 s late and wait 0.15 s; a clock that is unsure may place it half a second off."""
MOST_KEPT = 2048
"""3 s at 400 Hz are 1200; a sender that floods us is cut here."""
WIDEST_GAP_NS = 500_000_000
"""Autopilots that refuse every rate still send four a second: 250 ms apart, and one may be lost."""
MOST_EXTRAPOLATION_NS = 30_000_000
"""Beyond the newest attitude: a body that flaps at 5 Hz and 5 deg has then left its tangent by 2 degrees."""

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


class AttitudeHistory:
    """A bounded, ordered store of attitudes with an interpolation that is computed once an interval."""

    __slots__ = ("_pieces", "_samples", "_times")

    def __init__(self) -> None:
        self._times: list[BootNs] = []
        self._samples: list[AttitudeSample] = []
        self._pieces: list[Piece | None] = []  # by the interval's first sample

    def __len__(self) -> int:
        return len(self._times)

    @property
    def newest(self) -> AttitudeSample | None:
        """The latest sample."""
        return self._samples[-1] if self._samples else None

    def insert(self, sample: AttitudeSample) -> bool:
        """Take a sample, in any order. False: there is one of this instant already, or it is older than all kept."""
        times = self._times
        index = bisect_left(times, sample.boot_ns)
        if index < len(times) and times[index] == sample.boot_ns:
            return False
        if index == 0 and len(times) >= MOST_KEPT:
            return False
        times.insert(index, sample.boot_ns)
        self._samples.insert(index, sample)
        self._pieces.insert(index, None)
        for near in range(max(0, index - 3), min(len(times), index + 3)):
            self._pieces[near] = None
        self._trim()
        return True

    def clear(self) -> None:
        """Forget everything."""
        self._times.clear()
        self._samples.clear()
        self._pieces.clear()

    def shift(self, by_ns: int) -> None:
        """Move every kept sample in time, together."""
        self._samples = [AttitudeSample(BootNs(s.boot_ns + by_ns), s.ned_from_body, s.rates) for s in self._samples]
        self._times = [s.boot_ns for s in self._samples]
        self._pieces = [None] * len(self._samples)

    def _trim(self) -> None:
        excess = max(bisect_left(self._times, self._times[-1] - KEPT_NS), len(self._times) - MOST_KEPT)
        if excess > 0:
            del self._times[:excess], self._samples[:excess], self._pieces[:excess]

    def ready_for(self, boot_ns: BootNs) -> bool:
        """Two samples lie beyond this instant: the interpolation around it will not change."""
        return len(self._times) >= 2 and self._times[-2] >= boot_ns

    def quaternion_at(self, boot_ns: BootNs) -> Quaternion | Unpaired:
        """``ned_from_body`` alone, inside the history."""
        index = bisect_right(self._times, boot_ns) - 1
        if not 0 <= index < len(self._times) - 1:
            at = self.at(boot_ns)
            return at if isinstance(at, Unpaired) else at.ned_from_body
        return quaternion_at(self._pieces[index] or self._build(index), boot_ns)

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
        if times[index + 1] - times[index] > WIDEST_GAP_NS:
            return Unpaired(Reason.ATTITUDE_GAP, gap_s)
        piece = self._pieces[index] or self._build(index)
        ned_from_body, rates = course_at(piece, boot_ns)
        return AttitudeAt(ned_from_body, rates, 0.0, gap_s)

    def _beyond(self, boot_ns: BootNs) -> AttitudeAt | Unpaired:
        last = self._samples[-1]
        age_ns = boot_ns - last.boot_ns
        age_s = age_ns * 1e-9
        if age_ns > MOST_EXTRAPOLATION_NS:
            return Unpaired(Reason.STALE_ATTITUDE, age_s)
        q = multiply(last.ned_from_body, exp(scale(last.rates, age_s)))
        return AttitudeAt(q, last.rates, 0.5 * norm(last.rates) * 30.0 * age_s * age_s / sqrt(3.0), age_s)

    def _build(self, index: int) -> Piece:
        first, last = max(0, index - 1), min(len(self._times), index + 3)
        piece = piece_through(self._times[index], self._samples[first:last])
        self._pieces[index] = piece
        return piece
