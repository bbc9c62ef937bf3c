"""The gimbal that carries the camera: its attitudes on its own clock, and its attitude at any instant.

GIMBAL_DEVICE_ATTITUDE_STATUS comes about five times a second, stamped by an unsynchronised clock. That clock is
estimated from arrivals, as the autopilot's clock is without TIMESYNC. Where the autopilot itself reports for the gimbal
and the stamps agree with the autopilot's clock, the autopilot's clock is used. Between two attitudes the rotation is
interpolated at a constant rate along the shorter way, because a gimbal turns smoothly. The error of this interpolation
is measured on attitudes that are left out.
"""

from __future__ import annotations

from bisect import bisect_right, insort
from itertools import pairwise
from math import exp, hypot, isfinite, radians, sqrt
from typing import Any

import msgspec

from fwav_companion.geometry import rotations
from fwav_companion.geometry.gimbal import counts_from_north, heading_only, heading_rate, ned_from_gimbal
from fwav_companion.geometry.rotations import (
    Quaternion,
    conjugate,
    difference,
    matrix_from_quaternion,
    multiply,
    quaternion_from_euler,
)
from fwav_companion.geometry.stamps import NS_PER_MS, NS_PER_S, BootNs, HostNs
from fwav_companion.geometry.vectors import ZERO3, Matrix3, Vector3, add, norm, scale
from fwav_companion.telemetry.attitude.history import AttitudeAt
from fwav_companion.telemetry.attitude.stamp_delay import HALF_MS_NS
from fwav_companion.telemetry.clock.boot_time import BootTimeline, Restarted, Skipped, Strange
from fwav_companion.telemetry.clock.clock import Clock
from fwav_companion.types import GimbalAt, Message, Reason, ReportedGimbal, Unpaired
from fwav_companion.types.flight_status import GimbalReport

MESSAGE = "GIMBAL_DEVICE_ATTITUDE_STATUS"
OLDER_MESSAGES = ("MOUNT_ORIENTATION", "MOUNT_STATUS")
"""Messages of gimbals from before the gimbal protocol, used while MESSAGE is not received. Roll and pitch count from
the horizon, yaw from the vehicle's heading, or from north where MOUNT_ORIENTATION has yaw_absolute. MOUNT_STATUS has no
stamp; its arrival is used instead."""
GIMBAL_MESSAGES = frozenset({MESSAGE, *OLDER_MESSAGES})
LAST_NON_MAVLINK_DEVICE = 6
"""Largest gimbal_device_id of a gimbal without MAVLink, for which the autopilot reports; the least is 1."""
SAME_CLOCK_NS = 100 * NS_PER_MS
"""Largest difference between the two clocks at which they count as one: an autopilot that reports for its gimbal stamps
by its own clock, and the delay of its link is less than this."""
KEPT_NS = 4 * NS_PER_S
MOST_KEPT = 512
WIDEST_GAP_NS = NS_PER_S
"""Longest interval that is interpolated, five times the usual one: a few messages were lost."""
LEAST_APART_NS = 4 * NS_PER_MS
"""Least time between two stored attitudes. Closer stamps in whole milliseconds determine no rate: they are the same
attitude over two links, or a flood."""
MOST_EXTRAPOLATION_NS = 300 * NS_PER_MS
"""Longest extrapolation, one interval and a half at 5 Hz: then the next attitude is missing."""
NEAR_NS = 250 * NS_PER_MS
STEADY = 0.1
"""One sigma of the rate of a gimbal that holds its camera still, rad/s. It applies to an attitude without neighbours,
as recorded around each photograph."""
MOST_SIGMA = 0.1
"""Largest one sigma of a usable attitude, rad: 6 degrees, as for the body."""
UNCHECKED = 2.0
"""RMS angular acceleration before it was measured, rad/s^2: an operator's stick turns a gimbal by 100 degrees a second,
within a second."""
MEMORY_S = 3.0
CHECKS_TO_BEGIN = 3
UNEVEN = 2.5
"""Five attitudes whose longest interval exceeds the shortest by this factor are not used for checks."""
MOST_UNRESOLVED = 4.0
"""Largest factor on the interpolation error where the motion is faster than the samples. A sample left out at twice the
spacing errs by four times the error in the middle of an interval if the motion is smooth; if it is faster than the
samples, the error is the same at every spacing."""
MOST_ANGLE_DEG = 720.0
IDENTITY: Matrix3 = ((1.0, 0.0, 0.0), (0.0, 1.0, 0.0), (0.0, 0.0, 1.0))


class _GimbalAttitude(msgspec.Struct, frozen=True, gc=False, order=True):
    """Content of one attitude message."""

    stamp_ns: int
    """Stamp on the gimbal's clock."""
    q: Quaternion
    """Attitude, levelled; its yaw counts from north or from the vehicle's heading."""
    from_north: bool


class Gimbal:
    """The gimbal with the configured id: 1 to 6 behind the autopilot, else the MAVLink component itself."""

    def __init__(self, device_id: int, clock_rate: float = 1.0, *, delay_ns: int = 0) -> None:
        """``clock_rate``: rate of the vehicle's clock, with which a simulator's gimbal runs too. ``delay_ns``: age of
        an attitude at its stamp.
        """
        self._device_id, self._clock_rate = device_id, clock_rate
        self._shift_ns = HALF_MS_NS - delay_ns
        self._clock = Clock(clock_rate)
        self._timeline = BootTimeline()
        self._looks: list[_GimbalAttitude] = []
        self._by_autopilot = device_id <= LAST_NON_MAVLINK_DEVICE
        self._checks = 0
        self._bend2 = self._wide_bend2 = 0.0
        self._refused = 0
        self._heard_newer = False

    # Inputs.

    def is_meant(self, message: Message, autopilot_component: int) -> bool:
        """Whether a message of the adopted vehicle is an attitude of this gimbal."""
        if message.name not in GIMBAL_MESSAGES:
            return False
        if not self._by_autopilot:
            return message.component == self._device_id
        return message.component == autopilot_component and (
            message.name != MESSAGE or message.fields.gimbal_device_id == self._device_id
        )

    def on_older_message(self, message: Message, autopilot: Clock, arrival_ns: HostNs) -> None:
        """Take MOUNT_ORIENTATION or MOUNT_STATUS of this gimbal; an implausible one is counted."""
        if self._heard_newer:
            return
        angles = _mount_angles(message)
        if message.name == "MOUNT_STATUS":
            stamp = autopilot.boot_from_host(arrival_ns) if self._by_autopilot else BootNs(arrival_ns)
            if isinstance(stamp, Unpaired) or angles is None:
                self._refused += 1
                return
            placed = self._timeline.place(stamp // NS_PER_MS & 0xFFFFFFFF, arrival_ns)
        else:
            placed = self._timeline.place(message.fields.time_boot_ms, arrival_ns)
        if isinstance(placed, Restarted | Skipped):
            self.clear()
            placed = placed.boot_ns
        if angles is None or isinstance(placed, Strange):
            self._refused += 1
            return
        roll, pitch, yaw, from_north = angles
        self._clock.on_arrival(placed, arrival_ns)
        self._insert(_GimbalAttitude(placed + self._shift_ns, quaternion_from_euler(roll, pitch, yaw), from_north))

    def on_message(self, fields: Any, arrival_ns: HostNs) -> None:
        """Take an attitude of this gimbal; an implausible one is counted."""
        if not self._heard_newer:
            self._heard_newer = True
            self.clear()
        q = (float(fields.q[0]), float(fields.q[1]), float(fields.q[2]), float(fields.q[3]))
        delta_yaw = float(fields.delta_yaw)
        levelled = ned_from_gimbal(q, fields.flags, IDENTITY, delta_yaw) if 0.95 <= hypot(*q) <= 1.05 else None
        placed = self._timeline.place(fields.time_boot_ms, arrival_ns)
        if isinstance(placed, Restarted | Skipped):
            self.clear()
            placed = placed.boot_ns
        if levelled is None or isinstance(placed, Strange):
            self._refused += 1
            return
        self._clock.on_arrival(placed, arrival_ns)
        self._insert(_GimbalAttitude(placed + self._shift_ns, levelled, counts_from_north(fields.flags, delta_yaw)))

    def clear(self) -> None:
        """Delete every attitude, and the estimate of the gimbal's clock."""
        self._clock = Clock(self._clock_rate)
        self._looks.clear()
        self._checks = 0

    # Queries.

    def ready_for(self, boot_ns: BootNs, autopilot: Clock) -> bool:
        """Whether an attitude lies beyond this instant of the autopilot's clock, or cannot be expected from a silent
        gimbal.
        """
        stamp = self._stamp_of(boot_ns, autopilot)
        return stamp is None or not self._looks or self._looks[-1].stamp_ns >= stamp[0]

    def at(self, boot_ns: BootNs, autopilot: Clock, body: AttitudeAt) -> GimbalAt | Reason:
        """State of the gimbal at this instant of the autopilot's clock; ``body``: the vehicle's attitude then."""
        stamp = self._stamp_of(boot_ns, autopilot)
        if stamp is None or not self._looks:
            return Reason.NO_GIMBAL
        stamp_ns, stamp_sigma_s = stamp
        reported = self._reported_at(stamp_ns)
        if isinstance(reported, Reason):
            return reported
        q, rates, sigma, gap_s, from_north = reported
        if not from_north:
            ned_from_body = matrix_from_quaternion(body.ned_from_body)
            q = multiply(heading_only(ned_from_body), q)
            turn = (0.0, 0.0, heading_rate(ned_from_body, body.rates))
            rates = add(rates, rotations.rotate(conjugate(q), turn))
            sigma = hypot(sigma, body.sigma)
        sigma = hypot(sigma, norm(rates) * stamp_sigma_s)
        return GimbalAt(q, rates, sigma, gap_s) if sigma <= MOST_SIGMA else Reason.NO_GIMBAL

    def reported_at(self, boot_ns: BootNs, autopilot: Clock) -> ReportedGimbal | Reason:
        """The attitude between two reports at this instant of the autopilot's clock, its yaw as reported.

        STALE_GIMBAL while no report lies beyond the instant.
        """
        stamp = self._stamp_of(boot_ns, autopilot)
        if stamp is None or not self._looks:
            return Reason.NO_GIMBAL
        if stamp[0] > self._looks[-1].stamp_ns:
            return Reason.STALE_GIMBAL
        found = self._between(stamp[0])
        if isinstance(found, Reason):
            return Reason.NO_GIMBAL
        q, rates, sigma, _, from_north = found
        return ReportedGimbal(q, from_north, hypot(sigma, norm(rates) * stamp[1]))

    def status(self, now: HostNs) -> GimbalReport:
        """Part of the status: the newest attitude, and the uncertainty between two."""
        newest = self._looks[-1] if self._looks else None
        host_ns = None if newest is None else self._clock.host_from_boot(BootNs(newest.stamp_ns))
        return GimbalReport(
            device_id=self._device_id,
            age_s=(now - host_ns) * 1e-9 if isinstance(host_ns, int) else None,
            yaw_from=None if newest is None else "north" if newest.from_north else "the vehicle's heading",
            interpolation_sigma=sqrt(self._bend2) / 8.0 * self._spacing_s() ** 2 * self._unresolved(),
            refused=self._refused,
        )

    # Steps.

    def _insert(self, look: _GimbalAttitude) -> None:
        if any(abs(known.stamp_ns - look.stamp_ns) < LEAST_APART_NS for known in self._looks):
            return
        insort(self._looks, look)
        oldest_ns = self._looks[-1].stamp_ns - KEPT_NS
        while self._looks[0].stamp_ns < oldest_ns or len(self._looks) > MOST_KEPT:
            del self._looks[0]
        if look is self._looks[-1] and len(self._looks) >= 5:
            self._check(self._looks[-5:])

    def _check(self, five: list[_GimbalAttitude]) -> None:
        """Update the angular acceleration from samples left out at twice and at four times the spacing."""
        steps = [b.stamp_ns - a.stamp_ns for a, b in pairwise(five)]
        if len({look.from_north for look in five}) > 1 or max(steps) > min(UNEVEN * min(steps), WIDEST_GAP_NS):
            return
        self._checks += 1
        elapsed_s = (five[4].stamp_ns - five[3].stamp_ns) * 1e-9
        gain = max(1.0 / self._checks, 1.0 - exp(-elapsed_s / MEMORY_S))
        self._bend2 += gain * (_bend(five[2], five[3], five[4]) ** 2 - self._bend2)
        self._wide_bend2 += gain * (_bend(five[0], five[2], five[4]) ** 2 - self._wide_bend2)

    def _unresolved(self) -> float:
        """Factor by which the error in the middle of an interval exceeds that of a smooth course."""
        if self._checks < CHECKS_TO_BEGIN or self._wide_bend2 <= 0.0:
            return 1.0
        return max(1.0, min(MOST_UNRESOLVED, sqrt(self._bend2 / self._wide_bend2)))

    def _acceleration(self) -> float:
        """RMS angular acceleration, rad/s^2."""
        return (UNCHECKED if self._checks < CHECKS_TO_BEGIN else sqrt(self._bend2)) * self._unresolved()

    def _spacing_s(self) -> float:
        if len(self._looks) < 2:
            return 0.0
        return (self._looks[-1].stamp_ns - self._looks[0].stamp_ns) * 1e-9 / (len(self._looks) - 1)

    def _stamp_of(self, boot_ns: BootNs, autopilot: Clock) -> tuple[int, float] | None:
        """Stamp of the gimbal's clock at an instant of the autopilot's clock, and its one sigma in seconds."""
        host_ns = autopilot.host_from_boot(boot_ns)
        if isinstance(host_ns, Unpaired):
            return None
        stamp_ns = self._clock.boot_from_host(host_ns)
        if isinstance(stamp_ns, Unpaired):  # too few messages: an autopilot stamps its gimbal's by its own clock
            return (boot_ns, 0.0) if self._by_autopilot else None
        if self._by_autopilot and abs(stamp_ns - boot_ns) <= SAME_CLOCK_NS:
            return boot_ns, 0.0
        return stamp_ns, self._clock.sigma_s_at(host_ns)

    def _reported_at(self, stamp_ns: int) -> tuple[Quaternion, Vector3, float, float, bool] | Reason:
        """(attitude, rates, sigma, gap, whether yaw counts from north) as the messages report it: yaw not yet converted
        to north. Far from other attitudes, the nearest one is used.
        """
        between = self._between(stamp_ns)
        if not isinstance(between, Reason):
            return between
        nearest = min(self._looks, key=lambda look: abs(look.stamp_ns - stamp_ns))
        gap_ns = abs(nearest.stamp_ns - stamp_ns)
        if gap_ns > NEAR_NS:
            return between
        gap_s = gap_ns * 1e-9
        return nearest.q, ZERO3, STEADY * gap_s, gap_s, nearest.from_north

    def _between(self, stamp_ns: int) -> tuple[Quaternion, Vector3, float, float, bool] | Reason:
        """(attitude, rates, sigma, gap, whether yaw counts from north) between two messages, or shortly after the
        last one.
        """
        looks = self._looks
        index = bisect_right(looks, stamp_ns, key=lambda look: look.stamp_ns)
        if index == 0:
            return Reason.NO_GIMBAL
        beyond = index == len(looks)
        if beyond:
            if stamp_ns - looks[-1].stamp_ns > MOST_EXTRAPOLATION_NS:
                return Reason.STALE_GIMBAL
            index -= 1
        if index == 0:
            return Reason.NO_GIMBAL
        first, last = looks[index - 1], looks[index]
        span_ns, since_s = last.stamp_ns - first.stamp_ns, (stamp_ns - first.stamp_ns) * 1e-9
        if span_ns > WIDEST_GAP_NS or first.from_north != last.from_north:
            return Reason.NO_GIMBAL
        rates = scale(difference(last.q, first.q), NS_PER_S / span_ns)
        q = multiply(first.q, rotations.exp(scale(rates, since_s)))
        until_s = (last.stamp_ns - stamp_ns) * 1e-9
        sigma = 0.5 * self._acceleration() * since_s * abs(until_s)
        gap_s = abs(until_s) if beyond else min(since_s, until_s)
        return q, rates, sigma, gap_s, first.from_north


def _mount_angles(message: Message) -> tuple[float, float, float, bool] | None:
    """Roll, pitch and yaw in radians, and whether yaw counts from north; None where they are not finite angles."""
    fields = message.fields
    if message.name == "MOUNT_STATUS":  # hundredths of a degree
        angles = (fields.pointing_b / 100.0, fields.pointing_a / 100.0, fields.pointing_c / 100.0)
        from_north = False
    else:
        absolute = float(getattr(fields, "yaw_absolute", 0.0))
        from_north = isfinite(absolute) and absolute != 0.0  # a sender without the field sends 0
        angles = (float(fields.roll), float(fields.pitch), absolute if from_north else float(fields.yaw))
    if not all(isfinite(angle) and abs(angle) <= MOST_ANGLE_DEG for angle in angles):
        return None
    roll, pitch, yaw = map(radians, angles)
    return roll, pitch, yaw, from_north


def _bend(first: _GimbalAttitude, middle: _GimbalAttitude, last: _GimbalAttitude) -> float:
    """Angular acceleration, rad/s^2, that would explain the middle attitude's deviation from a constant rate."""
    before_s, after_s = (middle.stamp_ns - first.stamp_ns) * 1e-9, (last.stamp_ns - middle.stamp_ns) * 1e-9
    turn = scale(difference(last.q, first.q), before_s / (before_s + after_s))
    off = norm(difference(middle.q, multiply(first.q, rotations.exp(turn))))
    return 2.0 * off / (before_s * after_s)
