"""The gimbal that carries the camera: its attitudes on its own clock, and its attitude at any instant.

GIMBAL_DEVICE_ATTITUDE_STATUS comes about five times a second, stamped by an unsynchronised clock. That clock is
estimated from arrivals, as the autopilot's clock is without TIMESYNC. Where the autopilot itself reports for the gimbal
and the stamps agree with the autopilot's clock, the autopilot's clock is used. Between two attitudes the rotation is
interpolated at a constant rate along the shorter way, because a gimbal turns smoothly. The error of this interpolation
is measured on attitudes that are left out.

The vehicle's frame is turned by the autopilot's heading, never by the gimbal's idea of it. While the motion has not
shown whether roll and pitch count from the horizon, the other reading is part of the uncertainty.
"""

from __future__ import annotations

from collections.abc import Callable
from math import atan2, degrees, hypot, pi, radians, sqrt
from typing import Any, Literal

from fwav_companion.geometry import rotations
from fwav_companion.geometry.gimbal import heading_only, heading_rate
from fwav_companion.geometry.rotations import (
    Quaternion,
    conjugate,
    difference,
    matrix_from_quaternion,
    multiply,
)
from fwav_companion.geometry.stamps import NS_PER_MS, BootNs, HostNs, ns_from_s
from fwav_companion.geometry.vectors import Vector3, add, norm
from fwav_companion.telemetry.attitude.history import AttitudeAt
from fwav_companion.telemetry.attitude.stamp_delay import HALF_MS_NS
from fwav_companion.telemetry.clock.boot_time import BootTimeline, Restarted, Skipped, Strange
from fwav_companion.telemetry.clock.clock import Clock
from fwav_companion.telemetry.events import GimbalHeadingDiffers
from fwav_companion.telemetry.gimbal_horizon import HorizonEvidence
from fwav_companion.telemetry.gimbal_reading import (
    GIMBAL_MESSAGES,
    MESSAGE,
    GimbalAttitude,
    read_attitude,
    read_older_attitude,
)
from fwav_companion.telemetry.gimbal_series import GimbalSeries
from fwav_companion.types import AutopilotKind, GimbalAt, Message, Reason, ReportedGimbal, Unpaired
from fwav_companion.types.flight_status import GimbalReport

LAST_NON_MAVLINK_DEVICE = 6
"""Largest gimbal_device_id of a gimbal without MAVLink, for which the autopilot reports; the least is 1."""
SAME_CLOCK_NS = 100 * NS_PER_MS
"""Largest difference between the two clocks at which they count as one: an autopilot that reports for its gimbal stamps
by its own clock, and the delay of its link is less than this."""
MOST_SIGMA = 0.1
"""Largest one sigma of a usable attitude, rad: 6 degrees, as for the body."""
HEADING_APART = radians(10.0)
"""Difference of the gimbal's idea of the vehicle's heading from the autopilot's at which it is reported."""
HEADINGS_TO_REPORT = 5
"""Number of messages in a row that differ: a delay in a fast turn makes one or two differ."""
UNDECIDED_SHARE = sqrt(0.5)
"""One sigma of two readings that are equally likely, as a share of the angle between them, about one of them."""


class Gimbal:
    """The gimbal with the configured id: 1 to 6 behind the autopilot, else the MAVLink component itself."""

    def __init__(
        self,
        device_id: int,
        clock_rate: float = 1.0,
        *,
        levelled: Literal["auto"] | bool = "auto",
        delay_s: float = 0.0,
    ) -> None:
        """``clock_rate``: rate of the vehicle's clock, with which a simulator's gimbal runs too. ``levelled``: whether
        roll and pitch count from the horizon. ``delay_s``: age of an attitude at its stamp.
        """
        self._device_id, self._clock_rate = device_id, clock_rate
        self._clock = Clock(clock_rate)
        self._timeline = BootTimeline()
        self._series = GimbalSeries()
        self._by_autopilot = device_id <= LAST_NON_MAVLINK_DEVICE
        self._refused = 0
        self._refusal = Reason.NO_GIMBAL
        self._heard_newer = False
        self._delay_ns = ns_from_s(delay_s)
        self._horizon = HorizonEvidence(levelled)
        self._compared_ns: int | None = None
        self._contrary_headings = 0
        self._heading_off_deg: float | None = None

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

    def on_older_message(
        self, message: Message, autopilot: Clock, arrival_ns: HostNs, kind: AutopilotKind = AutopilotKind.OTHER
    ) -> None:
        """Take MOUNT_ORIENTATION or MOUNT_STATUS of this gimbal; a refused one is counted. ``kind``: the autopilot."""
        if self._heard_newer:
            return
        stamp_ms = getattr(message.fields, "time_boot_ms", None)
        if stamp_ms is None:
            arrived = autopilot.boot_from_host(arrival_ns) if self._by_autopilot else BootNs(arrival_ns)
            if isinstance(arrived, Unpaired):
                self._refuse(Reason.NO_GIMBAL)
                return
            stamp_ms = arrived // NS_PER_MS & 0xFFFFFFFF
        self._take(lambda stamp_ns: read_older_attitude(message, stamp_ns, kind), stamp_ms, arrival_ns)

    def on_message(self, fields: Any, arrival_ns: HostNs) -> None:
        """Take an attitude of this gimbal; a refused one is counted."""
        if not self._heard_newer:
            self._heard_newer = True
            self.clear()
        self._take(lambda stamp_ns: read_attitude(fields, stamp_ns), fields.time_boot_ms, arrival_ns)

    def compare(
        self, body_at: Callable[[BootNs], AttitudeAt | Unpaired], autopilot: Clock
    ) -> tuple[GimbalHeadingDiffers, ...]:
        """Compare the newest attitude before the last one with the vehicle's; returns what is to be reported.

        It is the newest for which the vehicle's attitudes on both sides have arrived.
        """
        look = self._series.last_but_one
        if look is None or (self._compared_ns is not None and look.stamp_ns <= self._compared_ns):
            return ()
        boot_ns = self._boot_of(look.stamp_ns, autopilot)
        body = None if boot_ns is None else body_at(boot_ns)
        if body is None or isinstance(body, Unpaired):
            return ()
        self._compared_ns = look.stamp_ns
        ned_from_body = matrix_from_quaternion(body.ned_from_body)
        if not look.from_north:
            self._horizon.add(
                look.stamp_ns,
                level_down=matrix_from_quaternion(look.q)[2],
                body_down=matrix_from_quaternion(multiply(body.ned_from_body, look.q))[2],
                vehicle_down=ned_from_body[2],
            )
        if look.heading is None:
            return ()
        off = (look.heading - atan2(ned_from_body[1][0], ned_from_body[0][0]) + pi) % (2.0 * pi) - pi
        self._contrary_headings = self._contrary_headings + 1 if abs(off) > HEADING_APART else 0
        if self._contrary_headings < HEADINGS_TO_REPORT or self._heading_off_deg is not None:
            return ()
        self._heading_off_deg = degrees(off)
        return (GimbalHeadingDiffers(self._heading_off_deg),)

    def clear(self) -> None:
        """Delete every attitude, and the estimate of the gimbal's clock."""
        self._clock = Clock(self._clock_rate)
        self._series.clear()
        self._compared_ns = None
        self._horizon.forget_last()

    # Queries.

    def ready_for(self, boot_ns: BootNs, autopilot: Clock) -> bool:
        """Whether an attitude lies beyond this instant of the autopilot's clock, or cannot be expected from a silent
        gimbal.
        """
        stamp = self._stamp_of(boot_ns, autopilot)
        return stamp is None or (newest := self._series.newest) is None or newest.stamp_ns >= stamp[0]

    def at(self, boot_ns: BootNs, autopilot: Clock, body: AttitudeAt) -> GimbalAt | Reason:
        """State of the gimbal at this instant of the autopilot's clock; ``body``: the vehicle's attitude then."""
        stamp = self._stamp_of(boot_ns, autopilot)
        if stamp is None or self._series.newest is None:
            return self._refusal
        stamp_ns, stamp_sigma_s = stamp
        reported = self._series.at(stamp_ns)
        if isinstance(reported, Reason):
            return reported
        look, rates, sigma, gap_s = reported
        q, tilt_sigma = look.q, look.tilt_sigma
        if not look.from_north:
            q, rates, other = self._with_vehicle_turned(look, rates, body)
            sigma = hypot(sigma, body.sigma)
            tilt_sigma = hypot(tilt_sigma, UNDECIDED_SHARE * other)
        sigma = hypot(sigma, norm(rates) * stamp_sigma_s)
        if not sigma <= MOST_SIGMA:
            return Reason.GIMBAL_GAP
        if not tilt_sigma <= MOST_SIGMA:
            return Reason.GIMBAL_HORIZON
        return GimbalAt(q, rates, sigma, gap_s, tilt_sigma)

    def reported_at(self, boot_ns: BootNs, autopilot: Clock, body: AttitudeAt | Unpaired) -> ReportedGimbal | Reason:
        """The attitude between two reports at this instant of the autopilot's clock, its yaw as reported.

        ``body``: the vehicle's attitude then, by which angles that count from the body are levelled. STALE_GIMBAL while
        no report lies beyond the instant.
        """
        stamp, newest = self._stamp_of(boot_ns, autopilot), self._series.newest
        if stamp is None or newest is None:
            return Reason.NO_GIMBAL
        if stamp[0] > newest.stamp_ns:
            return Reason.STALE_GIMBAL
        found = self._series.between(stamp[0])
        if isinstance(found, Reason):
            return Reason.NO_GIMBAL
        look, rates, sigma, _ = found
        q = look.q
        if not (look.from_north or self._counts_from_horizon(look)):
            if isinstance(body, Unpaired):
                return Reason.NO_GIMBAL
            heading = heading_only(matrix_from_quaternion(body.ned_from_body))
            q = multiply(conjugate(heading), multiply(body.ned_from_body, q))
        return ReportedGimbal(q, look.from_north, hypot(sigma, norm(rates) * stamp[1]))

    def status(self, now: HostNs) -> GimbalReport:
        """Part of the status: the newest attitude, and the uncertainty between two."""
        newest = self._series.newest
        host_ns = None if newest is None else self._clock.host_from_boot(BootNs(newest.stamp_ns))
        return GimbalReport(
            device_id=self._device_id,
            age_s=(now - host_ns) * 1e-9 if isinstance(host_ns, int) else None,
            yaw_from=None if newest is None else "north" if newest.from_north else "the vehicle's heading",
            levelled=None if newest is None else self._levelled(newest),
            refused_as=self._refusal.value if newest is None and self._refused else None,
            heading_off_deg=self._heading_off_deg,
            interpolation_sigma=self._series.interpolation_sigma,
            refused=self._refused,
        )

    # Steps.

    def _take(self, read: Callable[[int], GimbalAttitude | Reason], stamp_ms: int, arrival_ns: HostNs) -> None:
        """Place the stamp on the gimbal's clock, and insert what was read."""
        placed = self._timeline.place(stamp_ms, arrival_ns)
        if isinstance(placed, Restarted | Skipped):
            self.clear()
            placed = placed.boot_ns
        if isinstance(placed, Strange):
            self._refuse(Reason.NO_GIMBAL)
            return
        look = read(placed + HALF_MS_NS - self._delay_ns)
        if isinstance(look, Reason):
            self._refuse(look)
            return
        self._clock.on_arrival(placed, arrival_ns)
        self._series.insert(look)

    def _refuse(self, reason: Reason) -> None:
        self._refused += 1
        self._refusal = reason

    def _levelled(self, look: GimbalAttitude) -> bool | None:
        """Whether roll and pitch count from the horizon; None while both readings are possible. A gimbal's own flags
        are believed until its motion contradicts them, an autopilot's for its mounts are not; the older messages count
        from the horizon by definition, and have a wide claim.
        """
        trusted = not self._by_autopilot or look.tilt_sigma > 0.0
        return look.from_north or self._horizon.levelled(locked=look.locked, trusted=trusted)

    def _counts_from_horizon(self, look: GimbalAttitude) -> bool:
        """The likelier reading of roll and pitch."""
        levelled = self._levelled(look)
        return look.locked if levelled is None else levelled

    def _with_vehicle_turned(
        self, look: GimbalAttitude, rates: Vector3, body: AttitudeAt
    ) -> tuple[Quaternion, Vector3, float]:
        """Attitude in NED and rates of a gimbal whose angles count from the vehicle, and the angle to the other reading
        of roll and pitch where it is possible, radians.
        """
        ned_from_body = matrix_from_quaternion(body.ned_from_body)
        level = multiply(heading_only(ned_from_body), look.q)
        tilted = multiply(body.ned_from_body, look.q)
        other = norm(difference(level, tilted)) if self._levelled(look) is None else 0.0
        if self._counts_from_horizon(look):
            turn: Vector3 = (0.0, 0.0, heading_rate(ned_from_body, body.rates))
            return level, add(rates, rotations.rotate(conjugate(level), turn)), other
        return tilted, add(rates, rotations.rotate(conjugate(look.q), body.rates)), other

    def _boot_of(self, stamp_ns: int, autopilot: Clock) -> BootNs | None:
        """Instant of the autopilot's clock at a stamp of the gimbal's; None while a clock is unknown."""
        host_ns = self._clock.host_from_boot(BootNs(stamp_ns))
        boot_ns = host_ns if isinstance(host_ns, Unpaired) else autopilot.boot_from_host(host_ns)
        if isinstance(boot_ns, Unpaired):
            return BootNs(stamp_ns) if self._by_autopilot else None
        return BootNs(stamp_ns) if self._by_autopilot and abs(stamp_ns - boot_ns) <= SAME_CLOCK_NS else boot_ns

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
