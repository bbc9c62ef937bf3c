"""LANDING_TARGET (149), which steers a landing: predicted to one instant, or withheld for a named reason. Pure.

The claimed error decides, and nothing else about clock or camera: a target that was confirmed is sent until its last
fix is 1.5 s old, whether or not the newest frame shows it, and however late that frame came. ArduPilot coasts for 2 s
itself: 1.5 s leave it half a second, after which it reports the loss and retries.
"""

from __future__ import annotations

from collections.abc import Callable, Collection
from math import hypot

from fwav_companion.geometry.rotations import euler_from_quaternion
from fwav_companion.geometry.stamps import NS_PER_MS, NS_PER_S, NS_PER_US, BootNs, HostNs, s_from_ns
from fwav_companion.geometry.vectors import Vector3, add, norm
from fwav_companion.publishing import enums
from fwav_companion.publishing.landing_claim import image_motion_m_s, is_nearer, landing_sigma_m
from fwav_companion.publishing.landing_reports import LandingReports, LandingSight, Refusal, Withheld, landing_sight
from fwav_companion.publishing.landing_vector import (
    MovedBetween,
    StateAt,
    at_landing_point,
    by_fix,
    in_body,
    landing_fields,
    moved_since,
    relative_to_vehicle,
    state_when_used,
)
from fwav_companion.publishing.options import PublishOptions
from fwav_companion.publishing.selection import seniority, successor
from fwav_companion.types.flight_status import LandingReport
from fwav_companion.types.messages import Destination, Notice, Outgoing
from fwav_companion.types.reasons import Reason
from fwav_companion.types.sightings import GroundFix
from fwav_companion.types.situation import AutopilotKind, Situation
from fwav_companion.types.telemetry import VehicleState
from fwav_companion.types.tracks import Track, TrackState

DEFAULT_LAG_S = 0.02
"""Default of ArduPilot's PLND_LAG, seconds."""
LEAST_LAG_S, MOST_LAG_S = 0.02, 0.25
"""Limits that ArduPilot sets to PLND_LAG (AC_PrecLand::init), seconds."""
MOST_AGE_S = 1.5
"""Greatest age of the last fix of a target that is sent, seconds."""
LATEST_FRAME_NS = 2500 * NS_PER_MS
"""Age at its arrival up to which a frame is used where it steers a landing: so late a camera keeps its track, and the
pilot reads how late it is. Attitudes are stored for 3 s, and a frame may wait 0.4 s for them."""
COAST_NS = 200 * NS_PER_MS
"""Interval of messages while no frame comes: ArduPilot starts its filter again after a gap of 0.5 s."""
SILENT_NS = NS_PER_S
"""Time without a frame after which the lack of frames is the reason, and without the target after which it is lost."""
OLDEST_ATTITUDE_S = 0.5
"""Greatest age of the newest attitude of a PX4, seconds: the slowest stream, 4 Hz, with one loss."""
UNSEEN = frozenset({Reason.NOT_SEEN, Reason.NOT_SEEN_LONG})
"""Reasons of a track's end after which its prediction still holds."""

LocalPositionAt = Callable[[BootNs], Vector3 | None]
"""The autopilot's LOCAL_POSITION_NED at an instant of its clock, metres; None where it is not known."""


class Landing:
    """Chooses the target to land on, and sends it until its last fix is too old; clicks do not change it."""

    def __init__(
        self,
        options: PublishOptions,
        state_at: StateAt | None = None,
        local_position_at: LocalPositionAt | None = None,
        moved_between: MovedBetween | None = None,
        notify: Callable[[Notice], None] | None = None,
    ):
        self._options = options
        self._state_at = state_at
        self._local_position_at = local_position_at
        self._moved_between = moved_between
        self._notify = notify
        self._track: Track | None = None
        """Newest report of the target, possibly its last one."""
        self._fix: GroundFix | None = None
        """Last fix of the target."""
        self._frame_ns: HostNs | None = None
        """Capture of the newest frame."""
        self._frame_came_ns: HostNs | None = None
        self._sent_usec: int | None = None
        self._sigma_m: float | None = None
        self._sight: LandingSight | None = None
        """The target in the message that is being made."""
        self._reports = LandingReports(options.landing_max_sigma_m)
        self.lag_s = DEFAULT_LAG_S
        """The autopilot's PLND_LAG, seconds; the default before it is known."""
        self.sent = 0
        self.withheld: dict[Withheld, int] = dict.fromkeys(Withheld, 0)
        self.last_withheld: Withheld | None = None
        """Reason at the newest attempt; None where its message was sent."""
        self.wake_at: HostNs | None = None
        """Instant at which :meth:`on_wake` is due, unless a frame comes before; None while nothing could change."""

    @property
    def target(self) -> int | None:
        """Id of the track to land on."""
        return None if self._track is None else self._track.id

    def status(self, now: HostNs) -> LandingReport:
        """Part of the status: the target, its claim, and the counts of messages and reasons."""
        sight, landed = self._reports.sight, self._reports.landed
        return LandingReport(
            target=self.target,
            sent=self.sent,
            sigma_m=self._sigma_m,
            offset_m=None if sight is None else (sight.forward_m, sight.right_m, sight.down_m),
            offset_age_s=None if sight is None else s_from_ns(now - sight.at_ns),
            landed_offset_m=None if landed is None else (landed.forward_m, landed.right_m),
            withheld={str(reason): count for reason, count in self.withheld.items() if count},
            withheld_s=self._reports.withheld_s(now),
            last_withheld=None if self.last_withheld is None else str(self.last_withheld),
        )

    def forget(self) -> None:
        """Forget the target: all tracks ended, and their places are in a former local frame."""
        self._track = self._fix = self.wake_at = None
        self._reports.on_lost()

    def on_tracks(self, tracks: tuple[Track, ...], situation: Situation) -> Outgoing | None:
        """LANDING_TARGET after the frame with these tracks; None where it is withheld, for a counted reason."""
        if not self._options.landing_target:
            return None
        if tracks:
            self._frame_ns = max(track.host_ns for track in tracks)
        self._frame_came_ns = situation.now_ns
        self._choose(tracks, situation.now_ns)
        return self._attempt(situation)

    def on_disarmed(self, now: HostNs) -> None:
        """Report where the vehicle landed, if it did on the target."""
        notice = self._reports.on_disarmed(now)
        if notice is not None and self._notify is not None:
            self._notify(notice)

    def on_wake(self, situation: Situation) -> Outgoing | None:
        """LANDING_TARGET where no frame has come for a while; None before that is due, and where it is withheld."""
        if self.wake_at is None or situation.now_ns < self.wake_at:
            return None
        return self._attempt(situation)

    def _attempt(self, situation: Situation) -> Outgoing | None:
        now, notice = situation.now_ns, None
        answer = self._message(situation)
        if isinstance(answer, Refusal):
            self.withheld[answer.reason] += 1
            self.last_withheld = answer.reason
            if self._track is None:
                self._reports.on_lost()
            else:
                notice = self._reports.on_withheld(answer, now)
        elif answer is not None and self._sight is not None and self._track is not None:
            self.sent += 1
            self.last_withheld = None
            notice = self._reports.on_sent(self._sight, self._lost(self._track, now), now)
        if notice is not None and self._notify is not None:
            self._notify(notice)
        coasts = self._track is not None and self._age_s(self._track, now) <= MOST_AGE_S
        self.wake_at = HostNs(now + COAST_NS) if coasts or self._reports.is_pending else None
        return answer if isinstance(answer, Outgoing) else None

    def _choose(self, tracks: tuple[Track, ...], now: HostNs) -> None:
        """Update the track to land on. Another one is chosen only after that track was dropped.

        A track that was dropped because it was not seen is predicted on, unless another one is confirmed.
        """
        live = {track.id: track for track in tracks if track.state is not TrackState.DROPPED}
        before, chosen = self._track, None
        if before is not None:
            number = before.id if before.id in live else successor(before.id, live.values())
            chosen = None if number is None else live[number]
        chosen = chosen or self._oldest_confirmed(live.values())
        if chosen is None and before is not None:
            ended = next((track for track in tracks if track.id == before.id), before)
            unseen = ended.state is not TrackState.DROPPED or ended.reason in UNSEEN
            chosen = ended if unseen and self._age_s(ended, now) <= MOST_AGE_S else None
        if chosen is None or before is None or chosen.id != before.id:
            self._fix = None
        if chosen is not None and chosen.fix is not None:
            self._fix = chosen.fix
        self._track = chosen

    def _oldest_confirmed(self, tracks: Collection[Track]) -> Track | None:
        confirmed = [
            track
            for track in tracks
            if track.label == self._options.landing_label and track.state is TrackState.CONFIRMED
        ]
        return min(confirmed, key=seniority, default=None)

    @staticmethod
    def _age_s(track: Track, now: HostNs) -> float:
        """Age of the track's last fix, seconds."""
        return s_from_ns(now - track.last_seen_host_ns)

    def _message(self, situation: Situation) -> Outgoing | Refusal | None:
        """The message, the reason why it is withheld, or None where one of this instant was sent already."""
        track, autopilot = self._track, situation.autopilot
        if track is None:
            return Refusal(Withheld.NO_TARGET)
        if self._age_s(track, situation.now_ns) > MOST_AGE_S:
            return self._too_old(track, situation.now_ns)
        if autopilot is None:
            return Refusal(Withheld.NO_AUTOPILOT)
        if autopilot.kind is AutopilotKind.ARDUPILOT:
            return self._to_ardupilot(track, situation)
        if autopilot.kind is AutopilotKind.PX4:
            return self._to_px4(track, situation)
        return Refusal(Withheld.UNKNOWN_AUTOPILOT)

    def _lost(self, track: Track, now: HostNs) -> Refusal | None:
        """Why the target is not seen while its prediction is sent; None before it has not been seen for a second.

        A camera that is late shows it all the same: what counts is the newest frame's capture.
        """
        silent = self._frame_came_ns is None or now - self._frame_came_ns > SILENT_NS
        unseen_ns = 0 if self._frame_ns is None else self._frame_ns - track.last_seen_host_ns
        return self._too_old(track, now) if silent or unseen_ns > SILENT_NS else None

    def _too_old(self, track: Track, now: HostNs) -> Refusal:
        """The reason why the last fix is too old: no frames, late frames, or frames without the target."""
        if self._frame_came_ns is None or now - self._frame_came_ns > SILENT_NS:
            return Refusal(Withheld.NO_FRAMES, s_from_ns(now - (self._frame_came_ns or track.last_seen_host_ns)))
        late_s = 0.0 if self._frame_ns is None else s_from_ns(now - self._frame_ns)
        if late_s > MOST_AGE_S:
            return Refusal(Withheld.LATE_FRAME, late_s)
        return Refusal(Withheld.NOT_SEEN, self._age_s(track, now))

    def _to_ardupilot(self, track: Track, situation: Situation) -> Outgoing | Refusal | None:
        state = state_when_used(situation, self.lag_s, self._state_at)
        if state is None:
            return _no_attitude(situation)
        relative = self._relative(track, state)
        if relative is None:
            return Refusal(Withheld.NO_HEIGHT)
        motion_m_s = image_motion_m_s(self._fix, state, relative)
        by_attitude_m = state.attitude_sigma * norm(relative)
        refusal = self._uncertain(track, state, situation, motion_m_s=motion_m_s, by_attitude_m=by_attitude_m)
        self._look(relative, state, situation)
        vector = in_body(relative, state)
        frame = enums.MAV_FRAME_BODY_FRD
        return refusal or self._outgoing(track, state, situation, (frame, vector), body_frd=vector)

    def _to_px4(self, track: Track, situation: Situation) -> Outgoing | Refusal | None:
        state = situation.vehicle
        if state is None or s_from_ns(situation.now_ns - situation.host_ns_of(state)) > OLDEST_ATTITUDE_S:
            return _no_attitude(situation)
        local = None if self._local_position_at is None else self._local_position_at(state.boot_ns)
        if local is None:
            return Refusal(Withheld.NO_LOCAL_POSITION)
        relative = self._relative(track, state)
        if relative is None:
            return Refusal(Withheld.NO_HEIGHT)
        motion_m_s = image_motion_m_s(self._fix, None, relative)
        refusal = self._uncertain(track, state, situation, motion_m_s=motion_m_s, by_attitude_m=0.0)
        self._look(relative, state, situation)
        point = (enums.MAV_FRAME_LOCAL_NED, add(local, relative))
        return refusal or self._outgoing(track, state, situation, point, body_frd=in_body(relative, state))

    def _relative(self, track: Track, state: VehicleState) -> Vector3 | None:
        """The vector from the vehicle to the landing point, NED, metres; None without a known height."""
        fix, camera_m = self._fix, self._options.camera_position_m
        moved_m = moved_since(fix, state, self._moved_between)
        if fix is not None and is_nearer(fix, track):
            return by_fix(fix, track, state, camera_m, moved_m)
        relative = relative_to_vehicle(track, fix, state, camera_m)
        return relative if relative is None else at_landing_point(relative, fix, state, camera_m, moved_m)

    def _uncertain(
        self, track: Track, state: VehicleState, situation: Situation, *, motion_m_s: float, by_attitude_m: float
    ) -> Refusal | None:
        """The refusal where the claim is beyond the limit. ``motion_m_s``: metres a second of clock error."""
        age_s = abs(s_from_ns(state.boot_ns - track.boot_ns))
        clock_sigma_s = 0.0 if situation.clock is None else situation.clock.sigma_s
        cov = track.relative_cov
        if self._fix is not None and is_nearer(self._fix, track):
            cov, age_s = self._fix.relative_cov, abs(s_from_ns(state.boot_ns - self._fix.sighting.boot_ns))
        sigma_m = hypot(landing_sigma_m(track, cov, state, age_s=age_s), clock_sigma_s * motion_m_s, by_attitude_m)
        self._sigma_m = sigma_m
        return None if sigma_m <= self._options.landing_max_sigma_m else Refusal(Withheld.TOO_UNCERTAIN, sigma_m)

    def _look(self, relative: Vector3, state: VehicleState, situation: Situation) -> None:
        """Keep where the target is in the message that is being made, for the texts and the status."""
        _, _, yaw = euler_from_quaternion(state.ned_from_body)
        self._sight = landing_sight(relative, yaw, self._sigma_m or 0.0, situation.host_ns_of(state))

    def _outgoing(
        self,
        track: Track,
        state: VehicleState,
        situation: Situation,
        point: tuple[int, Vector3],
        *,
        body_frd: Vector3,
    ) -> Outgoing | None:
        """The message; None where its time would not rise. ``point``: the frame, and the target in it."""
        instant_ns = situation.host_ns_of(state)
        if self._sent_usec is not None and instant_ns // NS_PER_US <= self._sent_usec:
            return None
        self._sent_usec = instant_ns // NS_PER_US
        return Outgoing(
            name="LANDING_TARGET",
            fields=landing_fields(track, instant_ns, *point, body_frd=body_frd),
            to=Destination.AUTOPILOT,
            component=self._options.companion_component,
        )


def _no_attitude(situation: Situation) -> Refusal:
    newest = situation.vehicle
    if newest is None:
        return Refusal(Withheld.NO_VEHICLE)
    return Refusal(Withheld.NO_VEHICLE, s_from_ns(situation.now_ns - situation.host_ns_of(newest)))
