"""History of the vehicle over the last seconds, interpolated at any instant of the autopilot's clock."""

from __future__ import annotations

from math import hypot

from fwav_companion.geometry.stamps import BootNs
from fwav_companion.geometry.vectors import Vector3, subtract
from fwav_companion.telemetry.attitude.history import AttitudeHistory
from fwav_companion.telemetry.attitude.stamp_delay import AttitudeStamps
from fwav_companion.telemetry.barometer import Barometer
from fwav_companion.telemetry.clock.clock import Clock
from fwav_companion.telemetry.gimbal import Gimbal
from fwav_companion.telemetry.hermite_series import HermiteSeries, RecentValues
from fwav_companion.telemetry.local_drift import LocalDrift
from fwav_companion.telemetry.position_bias import USUAL_SIGMA_M, PositionBias
from fwav_companion.types import (
    AttitudeSample,
    HeightSource,
    RangeSample,
    Reason,
    ReportedGimbal,
    Unpaired,
    VehicleState,
)

RANGE_NEAR_NS = 200_000_000
"""Age up to which a rangefinder reading counts as simultaneous; readings come at 10 Hz and more."""
TERRAIN_NEAR_NS = 2_000_000_000
"""Age up to which a TERRAIN_REPORT counts as simultaneous: it comes once a second, and the ground below changes little
within that time."""


class VehicleHistory:
    """Samples by kind, and the vehicle's state interpolated between them."""

    def __init__(
        self,
        clock: Clock,
        stamps: AttitudeStamps,
        gimbal: Gimbal | None,
        attitudes_kept_ns: int,
        *,
        barometer: Barometer,
        position_bias: PositionBias | None = None,
        local_drift: float = 0.01,
    ) -> None:
        """``gimbal``: the gimbal that carries the camera; None without one. ``position_bias``: None: as configured.
        ``local_drift``: one sigma of a local position's drift, of the way flown.
        """
        self.position_bias = position_bias
        self._drift_share = local_drift
        self._local_drift: LocalDrift | None = None
        """Drift of the positions; None where they are global."""
        self.barometer = barometer
        self._clock = clock
        self._stamps = stamps
        self._gimbal = gimbal
        self.attitudes = AttitudeHistory(attitudes_kept_ns)
        self.positions = HermiteSeries()
        self.local = HermiteSeries()
        """LOCAL_POSITION_NED or ODOMETRY of the autopilot, in the autopilot's own local frame."""
        self.heights = {source: HermiteSeries() for source in HeightSource}
        self.ranges = RecentValues()
        self.terrain = RecentValues()
        self._jumped_ns: BootNs | None = None
        """Instant of the first position after the last jump."""

    def on_local_place(self, place: Vector3) -> None:
        """Take the vehicle's place by the autopilot's local position, which is in use."""
        if self._local_drift is None:
            self._local_drift = LocalDrift(self._drift_share)
        self._local_drift.on_position(place)

    def begin_local(self) -> None:
        """Begin the drift of local positions that carry global ones on: it adds to the error that these have."""
        self._local_drift = LocalDrift(self._drift_share, self.receiver_sigma_m)

    def end_local(self) -> float:
        """End the drift of local positions; returns its one sigma, metres."""
        drift, self._local_drift = self._local_drift, None
        return 0.0 if drift is None else drift.sigma_m

    @property
    def receiver_sigma_m(self) -> float:
        """One sigma of a global position's slow error, metres an axis."""
        known_m = None if self.position_bias is None else self.position_bias.sigma_m
        return USUAL_SIGMA_M if known_m is None else known_m

    def place_at(self, boot_ns: BootNs) -> Vector3 | None:
        """Vehicle's place in the world's frame at the instant, NED, metres; None where it is not known."""
        point = self.positions.at(boot_ns)
        if point is None:
            return None
        north, east, down = point.values
        return (north, east, down)

    def local_zero_at(self, boot_ns: BootNs) -> Vector3 | None:
        """Zero of the autopilot's local frame in the world's: by its local position at this instant and the global one.

        Both are taken at the newest global position, else extrapolated to this instant from there.
        """
        newest_ns = self.positions.newest_ns
        for at_ns in (newest_ns, boot_ns):
            place = None if at_ns is None else self.place_at(at_ns)
            local = None if at_ns is None else self.local_position_at(at_ns)
            if place is not None and local is not None:
                return subtract(place, local)
        return None

    def split_at_jump(self, boot_ns: BootNs) -> None:
        """Split the history: the position of this instant jumped beyond its velocity."""
        self.positions.split_at(boot_ns)
        self._jumped_ns = boot_ns

    def clear(self) -> None:
        """Delete all samples: the autopilot's clock started again, so that old stamps have no place on it."""
        self.attitudes.clear()
        for course in (self.positions, self.local, *self.heights.values()):
            course.clear()
        for latest in (self.ranges, self.terrain):
            latest.clear()
        self.barometer.clear()
        self._jumped_ns = self._local_drift = None

    def state_at(self, boot_ns: BootNs) -> VehicleState | Unpaired:
        """Vehicle state at this instant, or the reason why its attitude is not known."""
        attitude = self.attitudes.at(boot_ns)
        if isinstance(attitude, Unpaired):
            return attitude
        position, position_ned, velocity_ned = self.positions.at(boot_ns), None, None
        if position is not None:
            (north, east, down), (v_north, v_east, v_down) = position.values, position.rates
            position_ned, velocity_ned = (north, east, down), (v_north, v_east, v_down)
        height_m, source = self.height_at(boot_ns)
        slow_error = self.position_bias if self._local_drift is None else self._local_drift
        nearest_range = self.ranges.near(boot_ns, RANGE_NEAR_NS)
        terrain = self.terrain.near(boot_ns, TERRAIN_NEAR_NS)
        return VehicleState(
            boot_ns=boot_ns,
            ned_from_body=attitude.ned_from_body,
            rates=attitude.rates,
            attitude_sigma=attitude.sigma,
            gap_s=attitude.gap_s,
            position_ned=position_ned,
            velocity_ned=velocity_ned,
            position_sigma_m=0.0 if position is None else position.sigma,
            position_bias_m=None if slow_error is None else slow_error.sigma_m,
            position_drifts=self._local_drift is not None,
            height_above_home_m=height_m,
            height_bias_m=self.barometer.sigma_m(boot_ns) if source is HeightSource.BAROMETER else None,
            range=nearest_range if isinstance(nearest_range, RangeSample) else None,
            terrain_height_m=terrain if isinstance(terrain, float) else None,
            stamp_sigma_s=hypot(self._stamps.sigma_s, self.attitudes.quality.instant_sigma_s),
            spacing_s=attitude.spacing_s,
            angular_acceleration=attitude.angular_acceleration,
            turning_frequency=attitude.frequency,
            gimbal=None if self._gimbal is None else self._gimbal.at(boot_ns, self._clock, attitude),
        )

    def attitudes_after(self, boot_ns: BootNs) -> list[AttitudeSample]:
        """Stored attitudes later than the instant, in order of time."""
        return self.attitudes.after(boot_ns)

    def positions_after(self, boot_ns: BootNs) -> list[tuple[BootNs, bool]]:
        """Instants of the stored positions later than the instant, in order, and whether the position jumped there."""
        return [(each, self.positions.begins_piece(each)) for each in self.positions.times_after(boot_ns)]

    def ranges_after(self, boot_ns: BootNs) -> list[RangeSample]:
        """Stored readings of the rangefinder later than the instant, in order of time."""
        return [each for each in self.ranges.after(boot_ns) if isinstance(each, RangeSample)]

    def gimbal_at(self, boot_ns: BootNs) -> ReportedGimbal | Reason:
        """Attitude between two reports of the gimbal that carries the camera, or the reason why it is not known."""
        if self._gimbal is None:
            return Reason.NO_GIMBAL
        return self._gimbal.reported_at(boot_ns, self._clock, self.attitudes.at(boot_ns))

    def ready_for(self, boot_ns: BootNs) -> bool:
        """Whether enough attitudes lie beyond this instant: waiting longer does not improve the answer."""
        return self.attitudes.ready_for(boot_ns) and (
            self._gimbal is None or self._gimbal.ready_for(boot_ns, self._clock)
        )

    def newest_state(self) -> VehicleState | Unpaired:
        """Vehicle state at the latest attitude."""
        newest = self.attitudes.newest
        return self.state_at(newest.boot_ns if newest else BootNs(0))

    def local_position_at(self, boot_ns: BootNs) -> Vector3 | None:
        """Autopilot's LOCAL_POSITION_NED at the instant, metres from the autopilot's own origin. Its frame differs from
        the service's local NED.
        """
        jumped_ns, newest_ns = self._jumped_ns, self.local.newest_ns
        if jumped_ns is not None and newest_ns is not None and newest_ns < jumped_ns <= boot_ns:
            return None  # in the frame from before the jump
        point = self.local.at(boot_ns)
        if point is None:
            return None
        north, east, down = point.values
        return (north, east, down)

    @property
    def height_source(self) -> str | None:
        """The message or sensor that shows the newest height; None without a height."""
        newest = self.attitudes.newest
        _, source = self.height_at(newest.boot_ns) if newest is not None else (None, None)
        if source is HeightSource.BAROMETER:
            return f"{source.value} ({self.barometer.source})"
        return None if source is None else source.value

    def height_at(self, boot_ns: BootNs) -> tuple[float | None, HeightSource | None]:
        """Height above home at the instant, metres, and what shows it; None where it is not known."""
        for source, course in self.heights.items():  # in order of preference
            point = course.at(boot_ns)
            if point is not None:
                return point.values[0], source
        return None, None
