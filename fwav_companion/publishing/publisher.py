"""All messages for autopilot, ground stations and maps, from the tracks of each frame. Pure."""

from __future__ import annotations

from collections import deque
from typing import Any

from fwav_companion.geometry.earth import TangentPlane
from fwav_companion.geometry.stamps import NS_PER_S, HostNs
from fwav_companion.publishing.announcer import Announcer, TargetNotices
from fwav_companion.publishing.camera_component import CameraComponent
from fwav_companion.publishing.cot_events import GeoidHeight, LookAt
from fwav_companion.publishing.cot_markers import MapMarkers
from fwav_companion.publishing.distance_sensor import TagRange
from fwav_companion.publishing.enums import MAV_TYPE_GCS
from fwav_companion.publishing.ground_messages import adsb_vehicle, named_values
from fwav_companion.publishing.intervals import UNASKED_NS, Cadence
from fwav_companion.publishing.landing import Landing, LocalPositionAt
from fwav_companion.publishing.landing_vector import MovedBetween, StateAt
from fwav_companion.publishing.options import PublishOptions
from fwav_companion.publishing.selection import Locate, PixelFromNed, Selection, Spots, seniority
from fwav_companion.publishing.target_report import track_report
from fwav_companion.publishing.tracking_status import FORGOTTEN_NS
from fwav_companion.types.commands import Command, CommandAnswer
from fwav_companion.types.flight_status import PublishingReport, TrackReport
from fwav_companion.types.messages import Destination, Message, Notice, NoticeCode, Outgoing, Severity
from fwav_companion.types.situation import Situation
from fwav_companion.types.spots import SpotRefused
from fwav_companion.types.tracks import Track

VALUES_NS = UNASKED_NS
"""Interval of the named values for a display: people do not read faster than twice a second."""
ADSB_NS = NS_PER_S
MAX_DATAGRAMS = 64
MAX_EVENTS = 256
"""Most events of Cursor on Target between two calls of :meth:`Publisher.datagrams`."""
NO_EVENT = {
    NoticeCode.COT_WITHOUT_POSITION: "no global position: wait for the autopilot's GPS",
    NoticeCode.COT_WITHOUT_UTC: "UTC is unknown: wait for the autopilot's GPS, or run NTP on this board",
}
"""Reasons why no event of Cursor on Target is sent, and what to do."""
MAX_TRACK_REPORTS = 64
"""Most tracks in the status: 16 kB of its limit of 64 kB."""


class Publisher:
    """Publishes the tracks of every processed frame; answers commands to the camera; encodes notices.

    ``locate``: the ground at a pixel of an earlier picture, for clicks between two processed pictures. ``spots``:
    follows clicked spots that are not tracks. ``state_at``: the vehicle at an instant, for the attitude that ArduPilot
    will use; without it the newest state is extrapolated by its rates, which at 5 Hz and 20 ms is a degree worse.
    ``local_position_at``: PX4's own local position at an instant. ``moved_between``: the vehicle's way by velocities.
    ``look_at``: where the camera looks; ``geoid``: for heights on maps where the autopilot gives no ellipsoid height.
    """

    def __init__(
        self,
        options: PublishOptions,
        locate: Locate | None = None,
        state_at: StateAt | None = None,
        local_position_at: LocalPositionAt | None = None,
        moved_between: MovedBetween | None = None,
        spots: Spots | None = None,
        look_at: LookAt | None = None,
        geoid: GeoidHeight | None = None,
    ):
        self._options = options
        self._selection = Selection(options)
        self._notices: deque[Notice] = deque(maxlen=MAX_DATAGRAMS)
        self.landing = Landing(
            options, state_at, local_position_at, moved_between=moved_between, notify=self._notices.append
        )
        self._tag_range = TagRange(options.camera_position_m, options.companion_component)
        self._camera = CameraComponent(options, self._selection, locate, self._notices.append, spots)
        self._target_notices = TargetNotices()
        self._announcer = Announcer(options)
        self._values = Cadence()
        self._adsb = Cadence()
        self._cot = Cadence()
        self._values_shown = False
        self._sends_map = bool(options.cot or options.cot_package)
        self._markers = MapMarkers(options, look_at, geoid)
        self._datagrams: deque[bytes] = deque(maxlen=MAX_EVENTS)
        self._reported: set[NoticeCode] = set()
        self._started = False
        self.wake_at: HostNs | None = None
        """Instant at which :meth:`on_wake` is due; None before the first call of it or of :meth:`on_tracks`."""

    @property
    def selected(self) -> Track | None:
        """The selected target after the newest frame."""
        return self._selection.selected

    @property
    def clicked(self) -> Track | None:
        """The track that the operator selected, by a click on it or on a spot; None without one."""
        return self._selection.selected if self._selection.by_click else None

    @property
    def awaits_click(self) -> bool:
        """Whether the operator clicked a spot that has no track yet."""
        return self._selection.awaits_spot

    def on_tracks(
        self, tracks: tuple[Track, ...], situation: Situation, pixel_from_ned: PixelFromNed | None = None
    ) -> list[Outgoing]:
        """Messages after a processed frame. LANDING_TARGET is first, so that it does not wait for periodic messages.

        An empty tuple of tracks is a frame without live tracks.
        """
        landing = self.landing.on_tracks(tracks, situation)
        out = [landing] if landing is not None else []
        if self._options.distance_sensor and (reading := self._tag_range.on_tracks(tracks, situation)) is not None:
            out.append(reading)
        self._selection.on_tracks(tracks)
        if self._sends_map:
            self._markers.on_tracks(tracks)
        captured_ns = max([track.host_ns for track in tracks], default=None)
        self._camera.on_tracks(captured_ns, pixel_from_ned)
        self._notices.extend(self._target_notices.on_tracks(tracks, situation))
        if not self._started:
            out.extend(self.on_wake(situation.now_ns, situation))
        elif self._options.landing_target:
            self.wake_at = self._next_due()
        return out

    def is_own_range(self, message: Message, now: HostNs) -> bool:
        """Whether the autopilot's message repeats a DISTANCE_SENSOR of ours: then it is not to be used."""
        if message.name != "DISTANCE_SENSOR" or not self._options.distance_sensor:
            return False
        return self._tag_range.is_ours(message.fields, now)

    def on_own_message(self, message: Message, now: HostNs) -> None:
        """Take a recorded message that the service itself sent: its ranges, which the autopilot may repeat."""
        if message.name == "DISTANCE_SENSOR":
            self._tag_range.on_own(message.fields.current_distance, now)

    def on_wake(self, now: HostNs, situation: Situation) -> list[Outgoing]:
        """Messages that are due: LANDING_TARGET without a frame, tracking status, named values, map markers."""
        self._started = True
        landing = self.landing.on_wake(situation)
        out = [landing] if landing is not None else []
        if self._options.camera_tracking:
            out.extend(self._camera.on_wake(now, situation))
        track = self._selection.selected
        if track is not None and now - track.host_ns > FORGOTTEN_NS:
            track = None
        if self._options.named_values and self._values.tick(now, VALUES_NS):
            out.extend(self._named_values(track, situation))
        if self._options.adsb and self._adsb.tick(now, ADSB_NS):
            out.extend(self._adsb_marker(track, situation))
        if self._sends_map and self._cot.tick(now, round(NS_PER_S / self._options.cot_rate_hz)):
            self._make_events(track, situation)
        self.wake_at = self._next_due()
        return out

    def on_heartbeat(self, message: Message, now: HostNs) -> None:
        """Note a station that is heard."""
        self._camera.on_heartbeat((message.system, message.component), message.fields.type == MAV_TYPE_GCS, now)
        if self._started:
            self.wake_at = self._next_due()

    def on_command(self, command: Command, situation: Situation) -> CommandAnswer | None:
        """Answer to a command to the service's camera; None where it is not for the camera, or unknown."""
        if not self._options.camera_tracking or command.to_component != self._options.camera_component:
            return None
        answer = self._camera.on_command(command, situation)
        self.wake_at = self._next_due()
        return answer

    def on_spot_refused(self, refused: SpotRefused) -> None:
        """Report a clicked spot that cannot be followed, and select as before the click."""
        self._selection.forget_spot(refused.spot)
        text = f"tracking: this spot cannot be followed ({refused.refused.replace('_', ' ')}), click on another"
        self._notices.append(Notice(NoticeCode.CLICK_REFUSED, Severity.NOTICE, text, to_ground=True))

    def forget_targets(self) -> None:
        """Forget all targets: their tracks ended, and their places are in a former local frame. Another notice gives
        the reason.
        """
        self._target_notices.forget()
        self.landing.forget()

    def on_notice(self, notice: Notice, now: HostNs) -> list[Outgoing]:
        """STATUSTEXT messages of a notice for the ground; none where [publish] statustext is off."""
        return self._announcer.on_notice(notice, now)

    @property
    def has_datagrams(self) -> bool:
        """Whether :meth:`datagrams` would return any datagrams."""
        return bool(self._datagrams)

    def datagrams(self) -> list[bytes]:
        """Cursor on Target events since the last call, for the configured address."""
        made = list(self._datagrams)
        self._datagrams.clear()
        return made

    def notices(self) -> list[Notice]:
        """Notices of targets, clicks and Cursor on Target since the last call, for the log and :meth:`on_notice`."""
        made = list(self._notices)
        self._notices.clear()
        return made

    @property
    def image_size(self) -> tuple[int, int]:
        """Width and height of the calibration, pixels."""
        return self._options.image_size

    @property
    def reported_tracks(self) -> tuple[Track, ...]:
        """Confirmed and coasting tracks after the newest frame, the oldest first."""
        return tuple(sorted(self._selection.reported_tracks.values(), key=seniority))

    def track_reports(self, plane: TangentPlane | None, now: HostNs) -> list[TrackReport]:
        """Part of the status: the confirmed and coasting tracks, the oldest first."""
        return [track_report(track, plane, now) for track in self.reported_tracks[:MAX_TRACK_REPORTS]]

    def status(self, now: HostNs) -> PublishingReport:
        """Part of the status: the selected track, and the counts of LANDING_TARGET."""
        selected = self._selection.selected
        return PublishingReport(
            selected=None if selected is None else selected.id,
            selected_by="click" if self._selection.by_click else self._options.select,
            landing=self.landing.status(now),
        )

    def _next_due(self) -> HostNs | None:
        """The next instant with work. It is cached in :attr:`wake_at`, because that is read with every message."""
        due = [cadence.next_ns for cadence in (self._values, self._adsb, self._cot)] + [
            self._camera.wake_at,
            self.landing.wake_at,
        ]
        return min((at for at in due if at is not None), default=None)

    def _named_values(self, track: Track | None, situation: Situation) -> list[Outgoing]:
        """Named values while a target is selected, and once afterwards: a display keeps the last number."""
        if track is None and not self._values_shown:
            return []
        self._values_shown = track is not None
        return [
            self._companion("NAMED_VALUE_FLOAT", fields, Destination.GROUND)
            for fields in named_values(track, situation)
        ]

    def _adsb_marker(self, track: Track | None, situation: Situation) -> list[Outgoing]:
        if track is None or situation.autopilot is None:
            return []
        fields = adsb_vehicle(track, situation.autopilot.system, situation)
        return [self._companion("ADSB_VEHICLE", fields, Destination.GROUND_LINKS)] if fields is not None else []

    def _make_events(self, selected: Track | None, situation: Situation) -> None:
        """Append the events that are due, or, once, a notice with the reason why there are none."""
        events = self._markers.due(self.reported_tracks, selected, situation)
        if isinstance(events, list):
            self._datagrams.extend(events)
        elif events not in self._reported:
            self._reported.add(events)
            text = f"Cursor on Target is not sent: {NO_EVENT[events]}"
            self._notices.append(Notice(events, Severity.WARNING, text, to_ground=True))

    def _companion(self, name: str, fields: dict[str, Any], to: Destination) -> Outgoing:
        return Outgoing(name=name, fields=fields, to=to, component=self._options.companion_component)
