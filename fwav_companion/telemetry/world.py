"""Origin and home surface of the world, or the decision that it is the autopilot's local frame or relative."""

from __future__ import annotations

from math import hypot

from fwav_companion.geometry.earth import Geodetic, TangentPlane
from fwav_companion.geometry.stamps import NS_PER_S, HostNs
from fwav_companion.geometry.vectors import ZERO3, Vector3, subtract
from fwav_companion.telemetry.decoding import FIX_3D, Position
from fwav_companion.telemetry.events import HomeMoved, LocalWorld, OriginSet, RelativeWorld, TakeOffFound
from fwav_companion.telemetry.filter_status import FilterStatus
from fwav_companion.types import TakeOff, TakeOffSource

PATIENCE_NS = 10 * NS_PER_S
"""Time to wait for a position after the first attitude; then the world becomes relative."""
LOCAL_FRESH_NS = NS_PER_S
"""Age up to which a local position counts as arriving: twice the slowest interval that is useful."""
LOST_NS = 3 * NS_PER_S // 2
"""Time for which local positions come without a global one until they carry it on: one and a half intervals of the
slowest stream of positions, and within the two seconds that a position is extrapolated."""
STANDING_M_S = 0.5
"""Speed below which a disarmed vehicle is at rest, m/s: a GNSS velocity at rest is a few tenths."""
FLIGHT_M = 2.0
"""Change of an armed vehicle's height above home from which it has flown: its height at rest drifts by decimetres."""
LEAST_HOME_MOVE_M = 0.01
"""Least move of home that is reported, metres."""
MOST_HOME_DISTANCE_M = 100_000.0
"""Largest plausible distance between home and vehicle, metres: beyond the range of any vehicle of this service."""
MOST_HOME_CLIMB_M = 10_000.0
"""Largest plausible difference between the altitudes of home and vehicle, metres."""
LEAST_ALTITUDE_M = 1.0
"""Least height of a take-off ground above or below the sea that contradicts a home at altitude 0, metres: an autopilot
without an altitude, or a station that sets home by hand, sends exactly 0."""

_STRENGTH = {source: strength for strength, source in enumerate(TakeOffSource)}

WorldEvent = OriginSet | RelativeWorld | LocalWorld | TakeOffFound | HomeMoved


class World:
    """Decides once where the origin lies. The origin never moves; HOME_POSITION moves only the home surface.

    The origin is GPS_GLOBAL_ORIGIN if it was received before the first usable position, else that position. Its
    altitude is the take-off ground's, ``alt - relative_alt`` of that position.
    """

    def __init__(self, *, use_position: bool) -> None:
        self.plane: TangentPlane | None = None
        """Tangent plane about the origin; None while there is no origin."""
        self.relative: bool | None = None if use_position else True
        """Whether targets are relative to the point below the camera; None while that is undecided."""
        self.local = False
        """Whether positions are the autopilot's local ones: in a world without an origin, or after that was lost."""
        self.local_zero_ned = ZERO3
        """Zero of the autopilot's local frame in the world's, NED, metres."""
        self._local_since_ns: HostNs | None = None
        """Arrival of the first local position after the newest global one."""
        self._local_heard_ns = HostNs(0)
        """Arrival of the newest local position beside an origin."""
        self._local: tuple[HostNs, float] | None = None
        """Arrival of the newest local position, and the depth of the home surface by it."""
        self.filter_status = FilterStatus()
        """What the autopilot's filter reports of its position."""
        self.home_down_m = 0.0
        """Home surface, metres below the origin."""
        self._use_position = use_position
        self._global_origin: Geodetic | None = None
        self._home_alt_amsl_m: float | None = None
        self._take_off: TakeOff | None = None
        self._armed: bool | None = None
        self._armed_height_m: float | None = None
        """Height above home at the first position while armed; None while disarmed."""
        self._flew = False
        self._last: Position | None = None
        """Newest position that may show the vehicle at rest."""
        self._carried_ground_m: float | None = None
        """Altitude of the take-off ground where a local world's zero became the origin; None elsewhere."""
        self._position: Position | None = None
        """Newest position with a place."""
        self._gps_fix_type: int | None = None
        self._waits = use_position
        """Whether the wait for a position is still to begin."""
        self.wake_at: HostNs | None = None
        """End of the wait for a position; None before the wait, and after the decision."""

    @property
    def position_in_use(self) -> str | None:
        """What the world's positions are: global, local or none; None while that is undecided."""
        if self.local:
            return "local"
        return "global" if self.plane is not None else "none" if self.relative else None

    @property
    def home_alt_amsl_m(self) -> float | None:
        """Altitude of the home surface; None before home or an origin is known."""
        if self._home_alt_amsl_m is not None:
            return self._home_alt_amsl_m
        return None if self.plane is None else self.plane.origin.alt_amsl_m

    @property
    def take_off(self) -> TakeOff | None:
        """Take-off place as far as known: the first home received; until then the place where the vehicle landed, was
        armed, or was at rest; until then the origin.

        A service that starts in flight has its origin where the vehicle was first received, not where it took off.
        """
        if self.plane is None or self._take_off is not None:
            return self._take_off
        origin = self.plane.origin
        if self._carried_ground_m is not None:
            origin = Geodetic(origin.lat, origin.lon, self._carried_ground_m)
        return TakeOff(origin, TakeOffSource.ASSUMED)

    def on_wake(self, now: HostNs) -> tuple[WorldEvent, ...]:
        """Decide for the local frame or a relative world when the wait for a global position is over."""
        if self.wake_at is None or now < self.wake_at:
            return ()
        self.wake_at = None
        if self._local is not None and now - self._local[0] <= LOCAL_FRESH_NS and self._is_local_good:
            return self._begin_local(self._local[1], late=False)
        self.relative = True
        return (RelativeWorld(),)

    def on_local_position(self, home_down_m: float, now: HostNs) -> tuple[WorldEvent, ...]:
        """Take the arrival of a local position where there is no origin. ``home_down_m``: depth of the home surface
        below the local frame's origin by this position.
        """
        self._local = (now, home_down_m)
        if self.relative is True and self._use_position and self._is_local_good:
            return self._begin_local(home_down_m, late=True)
        return ()

    @property
    def _is_local_good(self) -> bool:
        return self.filter_status.local_trouble == ""

    def is_global_lost(self, now: HostNs) -> bool:
        """Whether good local positions have come for a while, this one included, without a global one."""
        if self.local or not self._use_position:
            return False
        heard_ns, self._local_heard_ns = self._local_heard_ns, now
        if self._local_since_ns is None or now - heard_ns > LOCAL_FRESH_NS:  # else a silence of all is a loss
            self._local_since_ns = now
        return now - self._local_since_ns >= LOST_NS and self._is_local_good

    def go_local(self, local_zero_ned: Vector3) -> None:
        """Carry the lost global positions on by local ones."""
        self.local, self.local_zero_ned = True, local_zero_ned

    def _begin_local(self, home_down_m: float, *, late: bool) -> tuple[WorldEvent, ...]:
        self.local, self.relative = True, False
        self.home_down_m = home_down_m
        return (LocalWorld(late, home_down_m),)

    def on_reboot(self) -> bool:
        """Take a reboot of the autopilot. Returns whether it ended the local frame that was the world: then it waits
        for a position again.
        """
        ended, self._local, self._local_since_ns = self.local and self.plane is None, None, None
        self.local, self.local_zero_ned = False, ZERO3
        if ended:
            self.relative, self._waits = None, True
        return ended

    def on_attitude(self, now: HostNs) -> None:
        """Start the wait for a position at the first attitude."""
        if self._waits:
            self._waits, self.wake_at = False, HostNs(now + PATIENCE_NS)

    def on_gps_fix(self, fix_type: int) -> None:
        """Take the fix type of GPS_RAW_INT: from now on positions are used only with a 3D fix."""
        self._gps_fix_type = fix_type

    def on_heartbeat(self, *, armed: bool) -> tuple[WorldEvent, ...]:
        """Take whether the vehicle is armed. Its take-off place is where it is armed, or at rest and disarmed."""
        was, self._armed = self._armed, armed
        self.filter_status.on_heartbeat(armed=armed)
        if self._last is None or self._last.place is None:
            return ()
        if armed:
            return self._found(self._last.place, TakeOffSource.ARMING) if was is False else ()
        return self._stands(self._last)

    def on_global_origin(self, place: Geodetic) -> None:
        """Take GPS_GLOBAL_ORIGIN; it is used only before the origin is frozen."""
        self._global_origin = place

    def on_position(self, position: Position, here_ned: Vector3 | None = None) -> tuple[WorldEvent, ...]:
        """Freeze the origin at the first usable position. Each position may show where the vehicle is at rest.

        ``here_ned``: the vehicle's place in a local world at this instant, which stays where it is; None without one.
        """
        if position.place is not None:
            self._position, self._local_since_ns = position, None
            if self.plane is not None:
                self.local = False
        if self._gps_fix_type is None or self._gps_fix_type >= FIX_3D:
            self._last = position
        self._flies(position)
        return (*self._decide(position, here_ned), *self._stands(position))

    def _flies(self, position: Position) -> None:
        """Detect that an armed vehicle flies: its height changes. A vehicle first received in the air descends."""
        if self._armed is not True:
            self._armed_height_m = None
        elif self._armed_height_m is None:
            self._armed_height_m = position.height_above_home_m
        elif abs(position.height_above_home_m - self._armed_height_m) > FLIGHT_M:
            self._flew = True

    def _decide(self, position: Position, here_ned: Vector3 | None) -> tuple[WorldEvent, ...]:
        if self.plane is not None or position.place is None or not self._use_position:
            return ()
        if self._gps_fix_type is not None and self._gps_fix_type < FIX_3D:
            return ()
        ground_m = position.place.alt_amsl_m - position.height_above_home_m
        home = self._take_off
        if home is not None and home.source is TakeOffSource.HOME_POSITION and not self._is_plausible(home.place):
            self._take_off = self._home_alt_amsl_m = None
        late = self.relative is True or (self.local and here_ned is None)
        if self.local and here_ned is not None:
            self.plane, self._carried_ground_m = _plane_through(position.place, here_ned), ground_m
        else:
            at = self._global_origin or position.place
            self.plane, self.home_down_m = TangentPlane(Geodetic(at.lat, at.lon, ground_m)), 0.0
        self.local, self.relative, self.wake_at, self._waits = False, False, None, False
        return (OriginSet(self.plane.origin, late), *self._move_home())

    def on_home(self, place: Geodetic) -> tuple[WorldEvent, ...] | None:
        """Take HOME_POSITION. Its altitude is that of the home surface; the first home is the take-off place. Returns
        None for a home that contradicts the vehicle's position.
        """
        if not self._is_plausible(place):
            return None
        found = self._found(place, TakeOffSource.HOME_POSITION)
        self._home_alt_amsl_m = place.alt_amsl_m
        return (*found, *self._move_home())

    def _stands(self, position: Position) -> tuple[WorldEvent, ...]:
        if self._armed is not False or position is not self._last or position.place is None:
            return ()
        speed_m_s = hypot(*position.velocity_ned)
        if not speed_m_s < STANDING_M_S:
            return ()
        return self._found(position.place, TakeOffSource.LANDING if self._flew else TakeOffSource.STANDING)

    def _found(self, place: Geodetic, source: TakeOffSource) -> tuple[WorldEvent, ...]:
        """Set a take-off place that is better known than the previous one."""
        if self._take_off is not None and _STRENGTH[source] <= _STRENGTH[self._take_off.source]:
            return ()
        self._take_off = TakeOff(place, source)
        return (TakeOffFound(place),) if self.plane is not None else ()

    def _is_plausible(self, home: Geodetic) -> bool:
        if self._position is None or self._position.place is None:
            return True
        vehicle = self._position.place
        ground_m = vehicle.alt_amsl_m - self._position.height_above_home_m
        if home.alt_amsl_m == 0.0 and abs(ground_m) > LEAST_ALTITUDE_M:
            return False
        north_m, east_m, down_m = TangentPlane(vehicle).ned_from_geodetic(home)
        return hypot(north_m, east_m) <= MOST_HOME_DISTANCE_M and abs(down_m) <= MOST_HOME_CLIMB_M

    def _move_home(self) -> tuple[WorldEvent, ...]:
        if self.plane is None or self._home_alt_amsl_m is None:
            return ()
        down_m = self.plane.origin.alt_amsl_m - self._home_alt_amsl_m
        moved = abs(down_m - self.home_down_m) >= LEAST_HOME_MOVE_M
        self.home_down_m = down_m
        return (HomeMoved(down_m),) if moved else ()


def _plane_through(place: Geodetic, at_ned: Vector3) -> TangentPlane:
    """The tangent plane in which a place lies at this NED: its origin, by one step and a correction of the meridians'
    convergence.
    """
    plane = TangentPlane(Geodetic(place.lat, place.lon, place.alt_amsl_m + at_ned[2]))
    for _ in range(3):
        off_n, off_e, _ = subtract(plane.ned_from_geodetic(place), at_ned)
        moved = plane.geodetic_from_ned((off_n, off_e, 0.0))
        plane = TangentPlane(Geodetic(moved.lat, moved.lon, plane.origin.alt_amsl_m))
    return plane
