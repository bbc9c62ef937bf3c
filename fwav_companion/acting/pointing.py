"""Where the gimbal has to look to keep the target in the middle of the picture. Pure.

The direction comes from the target's track and the vehicle's motion, predicted to the instant at which the command is
carried out. With the target in the picture its distance from the middle is integrated: what the errors of attitude,
mount and delay leave there is turned away, with a time constant that the delay of gimbal and pictures cannot make
unstable (T = 0.5 s: 45 deg of phase left at a delay of 0.39 s).
"""

from __future__ import annotations

from collections import deque
from math import atan2, copysign, cos, hypot, pi, radians
from typing import Final

from fwav_companion.acting.aim import Angles, direction, from_vehicle_ned, heading, moved, wrapped
from fwav_companion.acting.options import ActOptions
from fwav_companion.geometry.stamps import NS_PER_MS, NS_PER_S, HostNs, ns_from_s
from fwav_companion.geometry.vectors import Vector3, add, larger_semi_axis, norm, scale, subtract
from fwav_companion.types.situation import Situation
from fwav_companion.types.telemetry import VehicleState
from fwav_companion.types.tracks import Track

LEAD_S: Final = 0.08
"""Time from a command to the gimbal's arrival: serial gimbals take 50 to 100 ms."""
TRIM_TIME_S: Final = 0.5
TURN_NS: Final = 200 * NS_PER_MS
"""Time over which the vehicle's rate of turn is taken: over 10 ms the noise of two attitudes, 0.1 deg, would be 1 deg
at the gimbal's arrival, over 200 ms it is 0.06 deg."""
PLACE_TIME_S: Final = 0.5
"""Time constant of the target's place from the vehicle, which moves with both velocities: 0.3 m of the vehicle's noise
are 1 deg at 20 m, and an estimate that moves by 1 m within its claim would turn the gimbal by 3 deg before the picture
can object."""
PLACE_JUMP_M: Final = 3.0
"""Difference at which the low-pass starts at the new place."""
LONGEST_STEP_S: Final = 0.1
"""Longest time for which one picture's error is integrated."""
MOST_TRIM: Final = radians(20.0)
DOWNWARD_COSINE: Final = 0.087
"""Cosine of a pitch of 85 deg: beyond it yaw moves the axis by nothing, and the target's bearing is noise."""
STEEPEST_COSINE: Final = 0.26
"""Cosine of a pitch of 75 deg: beyond it a sideward error turns the yaw no faster, because yaw rolls the picture."""
WIDEST_BAND: Final = radians(5.0)
STOP_HELD: Final = radians(15.0)
"""Angle by which a target behind the vehicle is nearer on the other side before the gimbal is turned there, through the
front: it would swing to and fro below a target that crosses the rear. The target stays in most pictures."""
JUMP_SIGMAS: Final = 3.0
LEAST_JUMP_M: Final = 0.5
JUMP_HELD_NS: Final = 2 * NS_PER_S
"""Time after which a place that the track jumped to is its place: an exchange of two things is over by then."""


class Pointing:
    """The commanded angles of one target, yaw from the vehicle's heading."""

    def __init__(self, options: ActOptions) -> None:
        self._rate = radians(options.point_rate_deg_s)
        self._mount = Angles(options.mount_pitch, options.mount_yaw)
        self._track: Track | None = None
        self._jumped: Track | None = None
        self._trim = Angles(0.0, 0.0)
        self._seen_ns: HostNs | None = None
        self._band = WIDEST_BAND
        self._headings: deque[tuple[HostNs, float]] = deque()
        self._away: Vector3 | None = None
        self._last: tuple[HostNs, Angles] | None = None
        self.limits: tuple[Angles, Angles] | None = None
        """Least and largest pitch and yaw that the gimbal reports; None where unknown."""
        self.at_limit = False
        self.trims = True
        """Whether the error in the picture is turned away: not that of a gimbal that does not look where it should."""

    @property
    def holds(self) -> bool:
        """Whether the pointing rests because the track jumped beyond its claim."""
        return self._jumped is not None

    def start(self, look: Angles | None, now: HostNs) -> None:
        """Begin from where the gimbal looks."""
        self._last = None if look is None else (now, look)
        self._trim, self._track, self._jumped, self._seen_ns = Angles(0.0, 0.0), None, None, None
        self._away = None
        self._headings.clear()
        self.at_limit, self.trims = False, True

    def on_track(self, track: Track) -> None:
        """Take the target after a frame; one that jumped beyond its claim is not followed until it stays."""
        if self._track is not None and track.id == self._track.id and self._has_jumped(self._track, track):
            if self._jumped is None or self._has_jumped(self._jumped, track):
                self._jumped = track
            if track.host_ns - self._jumped.host_ns < JUMP_HELD_NS:
                return
            self._trim, self._away = Angles(0.0, 0.0), None
        elif self._track is not None and track.id != self._track.id:
            self._away = None
        self._track, self._jumped = track, None
        self._band = self._dead_band(track)
        if track.fix is not None:
            self._turn_error_away(track.fix.sighting.ray.direction, track.host_ns)

    def command(self, situation: Situation) -> Angles | None:
        """The angles to command now; None while the vehicle or the target is not known."""
        now, state = situation.now_ns, situation.recent_vehicle
        if self._track is None or state is None:
            return None if self._last is None else self._last[1]
        arrival, state_ns = HostNs(now + ns_from_s(LEAD_S)), situation.host_ns_of(state)
        away = self._away_ned(self._track, state, state_ns, now)
        if away is None:
            return None if self._last is None else self._last[1]
        looks = direction(moved(moved(away, self._track.velocity_ned, LEAD_S), state.velocity_ned, -LEAD_S))
        ahead = heading(state) + self._turn_rate(heading(state), state_ns) * (arrival - state_ns) * 1e-9
        yaw = looks.yaw - ahead - self._mount.yaw + self._trim.yaw
        wanted = Angles(looks.pitch - self._mount.pitch + self._trim.pitch, wrapped(yaw))
        return self._step(self._limited(wanted), now)

    def _turn_rate(self, heading_now: float, at: HostNs) -> float:
        """The vehicle's rate of turn by its headings of the last TURN_NS, rad/s; 0 before two of them."""
        headings = self._headings
        if not headings or at > headings[-1][0]:
            headings.append((at, heading_now))
        while len(headings) > 2 and headings[1][0] <= at - TURN_NS:
            headings.popleft()
        began_ns, began = headings[0]
        return wrapped(heading_now - began) / ((at - began_ns) * 1e-9) if at > began_ns else 0.0

    def _away_ned(self, track: Track, state: VehicleState, state_ns: HostNs, now: HostNs) -> Vector3 | None:
        """The target minus the vehicle now, without the noise of both places; None where the vehicle's is unknown."""
        reported = from_vehicle_ned(track, state, state_ns, now)
        if reported is None or self._away is None or self._last is None:
            self._away = reported
            return reported
        seconds = (now - self._last[0]) * 1e-9
        expected = moved(moved(self._away, track.velocity_ned, seconds), state.velocity_ned, -seconds)
        off = subtract(reported, expected)
        share = self._share(PLACE_TIME_S, now) if norm(off) < PLACE_JUMP_M else 1.0
        self._away = add(expected, scale(off, share))
        return self._away

    def _share(self, time_s: float, now: HostNs) -> float:
        """Gain of a first-order low pass since the last command."""
        return 1.0 if self._last is None else min(1.0, (now - self._last[0]) * 1e-9 / time_s)

    def _step(self, wanted: Angles, now: HostNs) -> Angles:
        """The next command: the last one within the dead band, else towards it, at most at the rate."""
        if self._last is None:
            self._last = (now, wanted)
            return wanted
        since_ns, last = self._last
        most = self._rate * min((now - since_ns) * 1e-9, LONGEST_STEP_S)
        # A gimbal with stops is not turned through the rear.
        has_stops = self.limits is not None
        yaw_way = wanted.yaw - last.yaw if has_stops else wrapped(wanted.yaw - last.yaw)
        pitch = last.pitch + _way(wanted.pitch - last.pitch, self._band, most)
        level = cos(wanted.pitch)
        yaw_band = self._band / level if level > DOWNWARD_COSINE else pi
        yaw = last.yaw + _way(yaw_way, yaw_band, most)
        self._last = (now, Angles(pitch, yaw if has_stops else wrapped(yaw)))
        return self._last[1]

    def _limited(self, wanted: Angles) -> Angles:
        if self.limits is None:
            self.at_limit = False
            return wanted
        low, high = self.limits
        last_yaw = wanted.yaw if self._last is None else self._last[1].yaw
        wanted = Angles(wanted.pitch, _nearer_yaw(wanted.yaw, max(low.yaw, -pi), min(high.yaw, pi), last_yaw))
        within = Angles(
            max(low.pitch, min(high.pitch, wanted.pitch)),
            max(low.yaw, -pi, min(high.yaw, pi, wanted.yaw)),
        )
        self.at_limit = within != wanted
        return within

    def _turn_error_away(self, ray: Vector3, seen_ns: HostNs) -> None:
        """Integrate the target's angles from the optical axis; ``ray``: right, down, forward."""
        before_ns, self._seen_ns = self._seen_ns, seen_ns
        if before_ns is None or seen_ns <= before_ns or ray[2] <= 0.0 or self._last is None:
            return
        if self.at_limit or not self.trims:
            return
        share = min((seen_ns - before_ns) * 1e-9, LONGEST_STEP_S) / TRIM_TIME_S
        level = max(cos(self._last[1].pitch), STEEPEST_COSINE)
        pitch = self._trim.pitch - share * atan2(ray[1], ray[2])
        yaw = self._trim.yaw + share * atan2(ray[0], ray[2]) / level
        self._trim = Angles(max(-MOST_TRIM, min(MOST_TRIM, pitch)), max(-MOST_TRIM, min(MOST_TRIM, yaw)))

    def _dead_band(self, track: Track) -> float:
        """One sigma of where the target is: in the picture that of its pixel, else that of its place, radians."""
        if track.fix is not None:
            sighting = track.fix.sighting
            return min(max(sighting.pixel_sigma) * norm(sighting.ray.d_du), WIDEST_BAND)
        away_m = norm(subtract(track.apparent_ned, track.vehicle_ned)) if track.vehicle_ned is not None else 0.0
        return min(larger_semi_axis(track.relative_cov) / max(away_m, 1.0), WIDEST_BAND)

    def _has_jumped(self, before: Track, after: Track) -> bool:
        """Whether the target's place moved by more than both claims and its velocity allow."""
        seconds = (after.host_ns - before.host_ns) * 1e-9
        moved = subtract(after.apparent_ned, before.apparent_ned)
        speed = before.velocity_ned or (0.0, 0.0, 0.0)
        off_m = hypot(moved[0] - speed[0] * seconds, moved[1] - speed[1] * seconds)
        claim_m = hypot(larger_semi_axis(before.relative_cov), larger_semi_axis(after.relative_cov))
        return off_m > max(LEAST_JUMP_M, JUMP_SIGMAS * claim_m)


def _nearer_yaw(wanted: float, low: float, high: float, last: float) -> float:
    """The wanted yaw, by a full turn less or more than it where its stop is on the last command's side: the other side
    is taken only if it is nearer to the target by STOP_HELD.
    """
    near = last + wrapped(wanted - last)
    far = near - copysign(2.0 * pi, near)
    beyond, beyond_far = (max(low - yaw, yaw - high, 0.0) for yaw in (near, far))
    return near if beyond <= beyond_far + STOP_HELD else far


def _way(way: float, band: float, most: float) -> float:
    """The part of a way that is gone now: to the edge of the dead band, so that a steady motion has no steps."""
    return copysign(min(most, max(0.0, abs(way) - band)), way)
