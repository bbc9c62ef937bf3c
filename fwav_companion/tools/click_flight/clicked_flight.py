"""SHELL: a rendered flight through the service's pipeline and its spot tracker, with one click of a ground station.

The station sees each picture [publish] video_delay_s after its capture, and clicks on a random place of one. The
service then does its own work: it finds the picture that was meant, the spot in later ones, and its ground position.
"""

from __future__ import annotations

from collections.abc import Callable, Iterator
from heapq import merge
from random import Random
from typing import Final

import msgspec

from fwav_companion.camera import Calibration
from fwav_companion.config import Config
from fwav_companion.config.rules import CAMERA_COMPONENT_ID
from fwav_companion.geometry.earth import Geodetic
from fwav_companion.geometry.stamps import NS_PER_US, HostNs, ns_from_s
from fwav_companion.mavlink.wire.codec import Encoder, decode
from fwav_companion.mavlink.wire.scanner import Scanner
from fwav_companion.pipeline.pipeline_factory import make_pipeline, own_components
from fwav_companion.recording.line_types import HeaderLine, TargetLine
from fwav_companion.replay import Recording
from fwav_companion.replay.recorded import is_own
from fwav_companion.types import Detection, Frame, Message
from fwav_companion.types.spots import CLICK_LABEL, FollowSpot, ReleaseSpot, SpotRefused
from fwav_companion.vision.images import Pixels
from fwav_companion.vision.patch import FollowedSpots, KeptPictures, NoMatch

STATION: Final = (255, 190)
"""System and component of the ground station: 190 is MAV_COMP_ID_MISSIONPLANNER."""
TRACK_POINT: Final = 2004
"""MAV_CMD_CAMERA_TRACK_POINT."""
MIDDLE: Final = 0.25
"""Margin without clicks, as a share of the picture's sides: a spot there has just come, or is about to leave."""
MOST_CLICKS: Final = 10
"""Most attempts: the service refuses a uniform place, and the operator clicks on the next picture."""

Pictures = Iterator[tuple[int, Pixels]]
Event = tuple[HostNs, Message | Frame]


class Click(msgspec.Struct, frozen=True):
    """A click that the service took."""

    frame: int
    """Frame that the operator saw."""
    pixel: tuple[float, float]
    taken_frame: int
    """Frame to which the service assigned the click."""


class FoundSpot(msgspec.Struct, frozen=True):
    """The spot as it was found in one frame."""

    frame: int
    pixel: tuple[float, float]
    sigma_px: float


class ClickedFlight:
    """One flight through the pipeline. :meth:`fly` does it; the attributes are its results."""

    def __init__(self, config: Config, calibration: Calibration, recording: Recording, *, seed: int, from_s: float):
        """``from_s``: time after the first frame at which the operator begins to look."""
        self._config = config
        self._recording = recording
        self._pipeline = make_pipeline(
            config, calibration, unix_offset_ns=recording.unix_offset_ns, live=True, written=True
        )
        self._rng = Random(seed)  # noqa: S311  # a drawn click, no secret
        self._size = calibration.image_size
        frames = [frame for frame in recording.frames if isinstance(frame, Frame)]
        self._looks_from_ns = (frames[0].stamp_ns if frames else 0) + ns_from_s(from_s)
        shown = (frame.number for frame in frames if frame.stamp_ns >= self._looks_from_ns)
        self.first_shown = next(shown, None) or 0
        """First frame that the operator sees: earlier frames need no picture."""
        self._pictures = KeptPictures()
        self._spots = FollowedSpots(self._pictures)
        self._station = Encoder(*STATION)
        self._awaited: tuple[HostNs, int, tuple[float, float]] | None = None
        """(instant of the click on the host clock, frame, pixel) of a click that the operator is about to make."""
        self._clicks = 0
        self.click: Click | None = None
        self.followed_from = 0
        """First frame after the order to follow the spot: the click arrived later than its picture."""
        self._newest = 0
        self.origin: Geodetic | None = None
        """Origin of the lines."""
        self.found: list[FoundSpot] = []
        self.lines: list[TargetLine] = []
        """Lines of the click's track."""
        self.refusals: list[str] = []
        """Why clicks were refused."""

    def fly(self, pictures: Pictures, on_step: Callable[[int], None]) -> None:
        """Process the recording in its own time. ``pictures``: those of its frames, in order."""
        own = own_components(self._config)
        now = HostNs(0)
        events: Iterator[Event] = merge(self._messages(), self._frames(), key=_at)
        for now, event in events:
            self._click_when_due(now)
            if isinstance(event, Frame):
                self._on_frame(event, pictures, now)
                on_step(self._newest)
            elif is_own(event, own, self._recording.own_system):
                self._pipeline.on_own_message(event, now)
            else:
                self._pipeline.on_message(event, now)
            self._take(now)
        self._pipeline.finish(now)
        self._take(now)

    def _messages(self) -> Iterator[Event]:
        for unix_us, message in self._recording.messages:
            yield HostNs(unix_us * NS_PER_US - self._recording.unix_offset_ns), message

    def _frames(self) -> Iterator[Event]:
        for frame in self._recording.frames:
            if isinstance(frame, Frame) and frame.arrival_ns is not None:
                yield frame.arrival_ns, frame

    def _on_frame(self, recorded: Frame, pictures: Pictures, now: HostNs) -> None:
        """Process a picture as the camera process does: ask where the spots are, and look there."""
        if recorded.stamp_ns < self._looks_from_ns or recorded.number is None:  # its picture is not rendered
            self._pipeline.on_frame(msgspec.structs.replace(recorded, detections=()), now)
            return
        number, pixels = next(pictures, (-1, None))
        if pixels is None or number != recorded.number:
            return
        frame = msgspec.structs.replace(recorded, detections=(), picture=number)
        self._newest = number
        self._pictures.add(number, pixels)
        views = self._pipeline.spot_views(frame, now).views if self._spots else {}
        found = [_detection(each) for each in self._spots.detections(pixels, views)]
        self.found += [FoundSpot(number, (each.u, each.v), each.sigma[0]) for each in found if each.sigma is not None]
        self._pipeline.on_frame(msgspec.structs.replace(frame, detections=tuple(found)), now)
        self._look(frame)

    def _look(self, frame: Frame) -> None:
        """Let the operator decide to click on what this picture shows, once it is on the screen."""
        if self.click is not None or self._awaited is not None or self._clicks >= MOST_CLICKS:
            return
        if frame.number is None:
            return
        width, height = self._size
        pixel = (
            self._rng.uniform(MIDDLE * width, (1.0 - MIDDLE) * width),
            self._rng.uniform(MIDDLE * height, (1.0 - MIDDLE) * height),
        )
        seen_ns = HostNs(frame.stamp_ns + ns_from_s(self._config.publish.video_delay_s))
        self._awaited = (seen_ns, frame.number, pixel)

    def _click_when_due(self, now: HostNs) -> None:
        if self._awaited is None or now < self._awaited[0]:
            return
        _, _, (u, v) = self._awaited
        width, height = self._size
        self._clicks += 1
        fields: dict[str, float] = {
            "target_system": self._recording.own_system or 1,
            "target_component": CAMERA_COMPONENT_ID,
        }
        fields |= {"command": TRACK_POINT, "confirmation": 0, "param1": (u + 0.5) / width, "param2": (v + 0.5) / height}
        fields |= {f"param{i}": 0.0 for i in range(3, 8)}
        for frame in Scanner().feed(self._station.encode("COMMAND_LONG", fields)):
            self._pipeline.on_message(decode(frame, "ground"), self._awaited[0])
        self._take(self._awaited[0])
        if self.click is None:
            self._awaited = None

    def _take(self, now: HostNs) -> None:
        outputs = self._pipeline.take()
        for line in outputs.lines:
            if isinstance(line, HeaderLine) and line.origin is not None:
                self.origin = line.origin.geodetic
            elif isinstance(line, TargetLine) and line.label == CLICK_LABEL:
                self.lines.append(line)
        for order in outputs.spot_messages:
            match order:
                case FollowSpot():
                    self._follow(order, now)
                case ReleaseSpot(spot=spot):
                    self._spots.release(spot)

    def _follow(self, order: FollowSpot, now: HostNs) -> None:
        refused = self._spots.follow(order)
        if isinstance(refused, NoMatch):
            self.refusals.append(refused.value)
            self._pipeline.on_spot_refused(SpotRefused(order.spot, refused.value), now)
        elif self._awaited is not None:
            self.click = Click(self._awaited[1], self._awaited[2], order.picture)
            self.followed_from = self._newest + 1


def _at(event: Event) -> HostNs:
    return event[0]


def _detection(found: dict[str, object]) -> Detection:
    """A detection as the pipeline gets it from the camera process."""
    given = msgspec.convert(found, _Found)
    return Detection(
        u=given.u,
        v=given.v,
        sigma=(given.sigma, given.sigma),
        label=given.label,
        score=given.score,
        box=given.box,
        detector_id=given.id,
    )


class _Found(msgspec.Struct):
    u: float
    v: float
    sigma: float
    label: str
    score: float
    box: tuple[float, float, float, float]
    id: int
