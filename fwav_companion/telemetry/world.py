"""Origin and home surface of the local world, or the decision that it is relative to the vehicle."""

from __future__ import annotations

from math import hypot

from fwav_companion.geometry.earth import Geodetic, TangentPlane
from fwav_companion.geometry.stamps import NS_PER_S, HostNs
from fwav_companion.telemetry.decoding import FIX_3D, Position
from fwav_companion.telemetry.events import HomeMoved, OriginSet, RelativeWorld, TakeOffFound
from fwav_companion.telemetry.filter_status import FilterStatus
from fwav_companion.types import TakeOff, TakeOffSource

PATIENCE_NS = 10 * NS_PER_S
"""Time to wait for a position after the first attitude; then the world becomes relative."""
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

WorldEvent = OriginSet | RelativeWorld | TakeOffFound | HomeMoved


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
        self._position: Position | None = None
        """Newest position with a place."""
        self._gps_fix_type: int | None = None
        self._waits = use_position
        """Whether the wait for a position is still to begin."""
        self.wake_at: HostNs | None = None
        """End of the wait for a position; None before the wait, and after the decision."""

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
        return TakeOff(self.plane.origin, TakeOffSource.ASSUMED)

    def on_wake(self, now: HostNs) -> tuple[WorldEvent, ...]:
        """Decide for a relative world when the wait for a position is over."""
        if self.wake_at is None or now < self.wake_at:
            return ()
        self.relative, self.wake_at = True, None
        return (RelativeWorld(),)

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

    def on_position(self, position: Position) -> tuple[WorldEvent, ...]:
        """Freeze the origin at the first usable position. Each position may show where the vehicle is at rest."""
        if position.place is not None:
            self._position = position
        if self._gps_fix_type is None or self._gps_fix_type >= FIX_3D:
            self._last = position
        self._flies(position)
        return (*self._decide(position), *self._stands(position))

    def _flies(self, position: Position) -> None:
        """Detect that an armed vehicle flies: its height changes. A vehicle first received in the air descends."""
        if self._armed is not True:
            self._armed_height_m = None
        elif self._armed_height_m is None:
            self._armed_height_m = position.height_above_home_m
        elif abs(position.height_above_home_m - self._armed_height_m) > FLIGHT_M:
            self._flew = True

    def _decide(self, position: Position) -> tuple[WorldEvent, ...]:
        if self.plane is not None or position.place is None or not self._use_position:
            return ()
        if self._gps_fix_type is not None and self._gps_fix_type < FIX_3D:
            return ()
        ground_m = position.place.alt_amsl_m - position.height_above_home_m
        home = self._take_off
        if home is not None and home.source is TakeOffSource.HOME_POSITION and not self._is_plausible(home.place):
            self._take_off = self._home_alt_amsl_m = None
        at = self._global_origin or position.place
        self.plane = TangentPlane(Geodetic(at.lat, at.lon, ground_m))
        late = self.relative is True
        self.relative, self.wake_at, self._waits = False, None, False
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
