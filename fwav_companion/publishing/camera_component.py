"""The camera component: describes the camera, takes clicks on the picture, and sends the selected target's place."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from math import isfinite, isnan
from typing import Any

from fwav_companion.geometry.stamps import NS_PER_S, HostNs
from fwav_companion.publishing import camera_information as information
from fwav_companion.publishing import enums
from fwav_companion.publishing.announcer import statustexts
from fwav_companion.publishing.intervals import UNASKED_NS, Cadence, Interval, Station, Stations
from fwav_companion.publishing.options import PublishOptions
from fwav_companion.publishing.selection import (
    Locate,
    Mark,
    Pictures,
    PixelFromNed,
    Selection,
    Spots,
    moment_of_click,
    track_on_ground,
)
from fwav_companion.publishing.tracking_status import FORGOTTEN_NS, ImagePlace, geo_status, image_status, pixel
from fwav_companion.types.commands import Command, CommandAnswer, CommandResult
from fwav_companion.types.messages import Destination, Notice, NoticeCode, Outgoing, Severity
from fwav_companion.types.situation import Situation
from fwav_companion.types.tracks import Track

IDLE_REPEATS = 3
"""Number of idle statuses after the last target: a lost datagram must not leave a box on the operator's picture."""
PREDICTED_SIGMA_PX = 10.0
"""One sigma of the pixel of a target that is shown at its predicted place, pixels."""
STATUS_IDS = (enums.CAMERA_TRACKING_IMAGE_STATUS, enums.CAMERA_TRACKING_GEO_STATUS)
STATUS_NAMES = {
    enums.CAMERA_TRACKING_IMAGE_STATUS: "CAMERA_TRACKING_IMAGE_STATUS",
    enums.CAMERA_TRACKING_GEO_STATUS: "CAMERA_TRACKING_GEO_STATUS",
}
CLICKED_NOTHING = {
    NoticeCode.CLICK_WITHOUT_CAMERA: "tracking: set [camera] calibration first",
    NoticeCode.CLICK_WITHOUT_TARGET: "tracking: no target there, click on a target",
    NoticeCode.CLICK_AMBIGUOUS: "tracking: several targets there, click nearer to one",
}
DENIED = CommandAnswer(CommandResult.DENIED)
DONE = CommandAnswer(CommandResult.ACCEPTED)


class CameraComponent:
    """Sends and answers as the camera. The selection is shared with the other displays of the selected target."""

    def __init__(
        self,
        options: PublishOptions,
        selection: Selection,
        locate: Locate | None,
        on_notice: Callable[[Notice], None],
        spots: Spots | None = None,
    ):
        """``on_notice``: receives notices for the log. ``spots``: None where clicks only select tracks."""
        self._options = options
        self._on_notice = on_notice
        self._selection = selection
        self._locate = locate
        self._spots = spots
        self._pictures = Pictures(options.image_size)
        self._places: dict[int, ImagePlace] = {}
        default_ns = round(NS_PER_S / options.rate_hz)
        self._stations = Stations()
        self._intervals = {message_id: Interval(default_ns) for message_id in STATUS_IDS}
        self._cadences = {message_id: Cadence() for message_id in STATUS_IDS}
        self._reached_ns: dict[int, HostNs] = {}
        self._idle_left = 0

    @property
    def wake_at(self) -> HostNs | None:
        """Instant of the next status; None before the first."""
        due = [
            cadence.next_ns
            for message_id, cadence in self._cadences.items()
            if cadence.next_ns is not None and self._intervals[message_id].ns is not None
        ]
        return min(due, default=None)

    def on_tracks(self, host_ns: HostNs | None, pixel_from_ned: PixelFromNed | None) -> None:
        """Keep the pixel, seen or predicted, of every confirmed or coasting track in the picture of this instant."""
        self._places = {}
        for track in self._selection.reported_tracks.values():
            place = _place_in_image(track, pixel_from_ned)
            if place is not None:
                self._places[track.id] = place
        if host_ns is None:
            return
        self._pictures.add(host_ns, [Mark(number, place.point, place.box) for number, place in self._places.items()])

    def on_heartbeat(self, sender: Station, is_station: bool, now: HostNs) -> None:
        """Note who is heard: requests for the statuses hold as long as their stations are."""
        if is_station or sender in self._stations:
            self._stations.hear(sender, now)
            self._refresh_intervals(now)

    def _refresh_intervals(self, now: HostNs) -> None:
        self._stations.expire(now)
        for message_id, interval in self._intervals.items():
            was_stopped = interval.ns is None
            interval.refresh(self._stations)
            if was_stopped and interval.ns is not None:
                self._cadences[message_id].next_ns = now

    def on_wake(self, now: HostNs, situation: Situation) -> list[Outgoing]:
        """Statuses that are due: while a target is selected, and :data:`IDLE_REPEATS` times afterwards."""
        track = self._selection.selected
        if track is not None and now - track.host_ns > FORGOTTEN_NS:
            track = None
        out = []
        for message_id in STATUS_IDS:
            interval_ns = self._intervals[message_id].ns
            if interval_ns is not None and self._cadences[message_id].tick(now, interval_ns):
                fields = self._due_fields(message_id, track, situation)
                if fields is not None:
                    out.append(self._to_ground(message_id, fields, now))
        return out

    def on_command(self, command: Command, situation: Situation) -> CommandAnswer | None:
        """Answer to a command to the camera; None where the command is unknown."""
        match command.number:
            case enums.MAV_CMD_REQUEST_MESSAGE:
                return self._on_request(command, situation)
            case enums.MAV_CMD_SET_MESSAGE_INTERVAL:
                return self._on_set_interval(command, situation.now_ns)
            case enums.MAV_CMD_GET_MESSAGE_INTERVAL:
                return self._on_get_interval(command, command.params[0])
            case enums.MAV_CMD_CAMERA_TRACK_POINT:
                return self._on_point(command, situation)
            case enums.MAV_CMD_CAMERA_TRACK_RECTANGLE:
                return self._on_rectangle(command, situation)
            case enums.MAV_CMD_CAMERA_STOP_TRACKING:
                self._selection.stop()
                if self._spots is not None:
                    self._spots.release_all()
                return DONE
        if command.number in information.OLD_REQUESTS:
            return self._describe(command, information.OLD_REQUESTS[command.number], situation, command.params[0])
        return None

    def _on_request(self, command: Command, situation: Situation) -> CommandAnswer | None:
        message_id = _whole(command.params[0])
        if message_id in information.DESCRIPTIONS:
            number = command.params[1] if message_id in information.NUMBERED else 0.0
            return self._describe(command, message_id, situation, number)
        if message_id == enums.MESSAGE_INTERVAL:
            return self._on_get_interval(command, command.params[1])
        if message_id in STATUS_NAMES:
            fields = self._status_fields(message_id, self._selection.selected, situation)
            if fields is None:
                return CommandAnswer(CommandResult.FAILED)
            return self._reply(command, STATUS_NAMES[message_id], fields)
        return DENIED if message_id is None else None

    def _describe(self, command: Command, message_id: int, situation: Situation, number: float) -> CommandAnswer | None:
        """Answer with a description. ``number``: 1 for the only one of its kind; 0 or NaN, the default, for all."""
        if number not in {0.0, 1.0} and not isnan(number):
            return DENIED
        name, describe = information.DESCRIPTIONS[message_id]
        fields = describe(self._options, situation.now_ns)
        return self._reply(command, name, fields) if fields is not None else None

    def _on_set_interval(self, command: Command, now: HostNs) -> CommandAnswer | None:
        message_id = _whole(command.params[0])
        if message_id is None or message_id not in self._intervals:
            return DENIED
        sender = (command.system, command.component)
        if not self._stations.hear(sender, now) or not self._intervals[message_id].ask(sender, command.params[1]):
            return DENIED
        self._refresh_intervals(now)
        self._cadences[message_id].next_ns = now
        return DONE

    def _on_get_interval(self, command: Command, of: float) -> CommandAnswer:
        message_id = _whole(of)
        if message_id is None or message_id not in self._intervals:
            return DENIED
        interval_ns = self._intervals[message_id].ns
        interval_us = -1 if interval_ns is None else interval_ns // 1000
        return self._reply(command, "MESSAGE_INTERVAL", {"message_id": message_id, "interval_us": interval_us})

    def _on_point(self, command: Command, situation: Situation) -> CommandAnswer:
        x, y, radius = command.params[:3]
        if not _in_image(x, y):
            return DENIED
        if not self._has_picture:
            return self._nothing(command, NoticeCode.CLICK_WITHOUT_CAMERA)
        point = pixel((x, y), self._options.image_size)
        reach_px = radius * self._options.image_size[0] if _in_image(radius) else 0.0
        when = moment_of_click(situation.now_ns, self._options.video_delay_s)
        hit = self._pictures.track_at(when, point, reach_px)
        if hit not in self._selection.reported_tracks:
            about = [
                each
                for each in self._pictures.tracks_about(when, point, reach_px)
                if each in self._selection.reported_tracks
            ]
            if len(about) > 1:
                return self._nothing(command, NoticeCode.CLICK_AMBIGUOUS)
            hit = about[0] if about else None
        return self._choose(command, hit, point, when)

    def _on_rectangle(self, command: Command, situation: Situation) -> CommandAnswer:
        x1, y1, x2, y2 = command.params[:4]
        if not _in_image(x1, y1, x2, y2):
            return DENIED
        if not self._has_picture:
            return self._nothing(command, NoticeCode.CLICK_WITHOUT_CAMERA)
        low = pixel((min(x1, x2), min(y1, y2)), self._options.image_size)
        high = pixel((max(x1, x2), max(y1, y2)), self._options.image_size)
        middle = (0.5 * (low[0] + high[0]), 0.5 * (low[1] + high[1]))
        when = moment_of_click(situation.now_ns, self._options.video_delay_s)
        return self._choose(command, self._pictures.track_in(when, low, high), middle, when)

    def _choose(self, command: Command, hit: int | None, point: tuple[float, float], when: HostNs) -> CommandAnswer:
        """Select a track by the picture of that instant, or by the ground where that picture shows no track or was not
        processed.

        Where there is no track, the spot itself is followed once the camera process confirms that it can be followed.
        """
        reported_tracks = self._selection.reported_tracks
        if hit not in reported_tracks and self._locate is not None:
            fix = self._locate(point[0], point[1], self._pictures.finger_px, when)
            hit = track_on_ground(fix, when, reported_tracks.values()) if fix is not None else None
        if hit is not None and hit in reported_tracks:
            self._selection.click(hit)
            return DONE
        spot = None if self._spots is None else self._spots.follow(point, when, self._pictures.finger_px)
        if spot is None:
            return self._nothing(command, NoticeCode.CLICK_WITHOUT_TARGET)
        self._selection.click_spot(spot)
        return DONE

    @property
    def _has_picture(self) -> bool:
        return min(self._options.image_size) > 0

    def _nothing(self, command: Command, code: NoticeCode) -> CommandAnswer:
        """Answer to a click that selects no target: FAILED for the station, a text for the operator and the log."""
        self._on_notice(Notice(code, Severity.NOTICE, CLICKED_NOTHING[code]))
        texts = statustexts(
            CLICKED_NOTHING[code],
            enums.MAV_SEVERITY_NOTICE,
            code=code,
            component=self._options.camera_component,
            to=Destination.REPLY,
            link=command.link,
        )
        return CommandAnswer(CommandResult.FAILED, tuple(texts))

    def _due_fields(self, message_id: int, track: Track | None, situation: Situation) -> Mapping[str, Any] | None:
        """Fields of a periodic status; None while no target is selected and IDLE has been sent."""
        if track is not None:
            self._idle_left = IDLE_REPEATS
        elif message_id == enums.CAMERA_TRACKING_IMAGE_STATUS and self._idle_left > 0:
            self._idle_left -= 1
        else:
            return None
        return self._status_fields(message_id, track, situation)

    def _status_fields(self, message_id: int, track: Track | None, situation: Situation) -> Mapping[str, Any] | None:
        if message_id == enums.CAMERA_TRACKING_GEO_STATUS:
            return geo_status(track, situation) if track is not None else None
        place = self._places.get(track.id) if track is not None else None
        return image_status(track, place, self._options.image_size, situation.now_ns)

    def _to_ground(self, message_id: int, fields: Mapping[str, Any], now: HostNs) -> Outgoing:
        """Message to the gcs links; on the autopilot's link at most at 2 Hz, unless a station requested more."""
        reached_ns = self._reached_ns.get(message_id)
        far = self._intervals[message_id].is_asked or reached_ns is None or now >= reached_ns + UNASKED_NS
        if far:
            self._reached_ns[message_id] = now
        return Outgoing(
            name=STATUS_NAMES[message_id],
            fields=fields,
            to=Destination.GROUND if far else Destination.GROUND_LINKS,
            component=self._options.camera_component,
        )

    def _reply(self, command: Command, name: str, fields: Mapping[str, Any]) -> CommandAnswer:
        reply = Outgoing(
            name=name,
            fields=fields,
            to=Destination.REPLY,
            component=self._options.camera_component,
            link=command.link,
        )
        return CommandAnswer(CommandResult.ACCEPTED, (reply,))


def _place_in_image(track: Track, pixel_from_ned: PixelFromNed | None) -> ImagePlace | None:
    """Pixel of the track's fix in this frame; else its predicted pixel; None outside the image."""
    if track.fix is not None:
        seen = track.fix.sighting
        detection = seen.detection
        return ImagePlace((detection.u, detection.v), max(seen.pixel_sigma), detection.box)
    predicted = pixel_from_ned(track.position_ned) if pixel_from_ned is not None else None
    return ImagePlace(predicted, PREDICTED_SIGMA_PX) if predicted is not None else None


def _whole(param: float) -> int | None:
    """The integer value of a parameter, as for message ids; None where it is not an integer."""
    return int(param) if isfinite(param) and param == int(param) else None


def _in_image(*params: float) -> bool:
    return all(0.0 <= param <= 1.0 for param in params)
