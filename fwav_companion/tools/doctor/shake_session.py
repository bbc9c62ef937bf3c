"""SHELL: ``check --shake``: runs the service while a vehicle is shaken over a tag, and keeps the estimate's inputs."""

from __future__ import annotations

import asyncio
import logging
import time
from collections import Counter
from collections.abc import Callable, Mapping
from math import radians
from typing import Final

import msgspec

from fwav_companion.camera import Calibration
from fwav_companion.config import Config
from fwav_companion.geometry.rotations import Quaternion, euler_from_quaternion
from fwav_companion.geometry.stamps import BootNs, host_from_seconds
from fwav_companion.pairing import Pairer, RefusedFrame, scaling_from_size
from fwav_companion.pipeline.pipeline_factory import make_pairer
from fwav_companion.telemetry import Telemetry
from fwav_companion.tools.doctor.gathering import quiet
from fwav_companion.tools.shake.estimate import ShakeData
from fwav_companion.tools.shake.instructions import Instruction, Instructor, ShakeInputs, ShakePhase
from fwav_companion.tools.shake.observations import TagObservation
from fwav_companion.types import Corners, Detection, Frame, Message, NoFrame, Reason, Unpaired
from fwav_companion.types.status import RunStatus
from fwav_companion.vision.task import shown_source

KEPT_S: Final = 120.0
"""Length of the attitude history, seconds: longer than a person shakes."""
MOST_FRAMES: Final = 12_000
"""Most frames that are kept: a minute at 200 frames/s."""
MOST_TAGS: Final = 8
"""Most tags that are kept of a frame, which may have 256 detections: a sheet of tags. 80 MB at most."""
GOOD_CLOCK_S: Final = 0.003
"""Largest sigma of the autopilot's clock at which the session begins; it improves during the session."""

Tag = tuple[str, int | None]
"""Label and detector's id: together they identify a tag."""


class ShakeResult(msgspec.Struct, frozen=True):
    """Result of the session."""

    advice: Instruction
    shaking: ShakeData | None
    """Inputs of the estimate; None if the session never began."""
    refused: Mapping[Reason, int]
    """Frames that could not be placed in time."""
    time_offset_s: float = 0.0
    """Configured time offset; the estimate is added to it."""


class ShakeSession:
    """Keeps the frames that the estimate needs, and guides the person."""

    def __init__(
        self,
        config: Config,
        calibration: Calibration,
        *,
        wait_s: float,
        show: Callable[[Instruction], None],
        now_s: Callable[[], float] = time.monotonic,
    ) -> None:
        """``now_s``: CLOCK_MONOTONIC in seconds, as the service uses it."""
        self._config, self._calibration, self._show, self._now_s = config, calibration, show, now_s
        self._guide = Instructor(wait_s)
        self.frames: list[Frame] = []
        """Frames kept so far, reduced to their tags."""
        self._came = self._tags = 0
        self._telemetry: Telemetry | None = None
        self.advice = Instruction(ShakePhase.WAITING, "")

    def on_frame(self, frame: Frame | NoFrame) -> None:
        """Take a frame of any source."""
        self._came += 1
        if isinstance(frame, NoFrame):
            return
        tags = tuple(detection for detection in frame.detections if detection.corners)
        if not tags:
            return
        self._tags += 1
        if self._guide.begun and len(self.frames) < MOST_FRAMES:
            self.frames.append(msgspec.structs.replace(frame, detections=tags[:MOST_TAGS]))

    def on_message(self, _message: Message) -> None:
        """Ignore the message: the telemetry has all that the estimate needs."""

    def enough(self, status: RunStatus, telemetry: Telemetry) -> bool:
        """Show the person the next step; return whether the session is over."""
        self._telemetry = telemetry
        self.advice = self._guide.instruct(self._moment(status, telemetry))
        self._show(self.advice)
        return self.advice.phase in (ShakePhase.DONE, ShakePhase.FAILED)

    def result(self, tag_size_m: float) -> ShakeResult:
        """Return the inputs of the estimate, by the present clock estimate."""
        if self._telemetry is None or self.advice.phase is not ShakePhase.DONE:
            return ShakeResult(self.advice, None, {})
        pairer = make_pairer(self._config, self._calibration)
        views, refused = self._views(pairer, self._telemetry)
        shaking = self._shaking(pairer, self._telemetry, views, tag_size_m)
        return ShakeResult(self.advice, shaking, refused, pairer.time_offset_s)

    def _moment(self, status: RunStatus, telemetry: Telemetry) -> ShakeInputs:
        sigma_s, now_s = status.clock.sigma_s, self._now_s()
        state = telemetry.newest_state()
        return ShakeInputs(
            now_s=now_s,
            closed=_closed(status, self._config),
            autopilot=status.autopilot is not None,
            attitude_hz=telemetry.attitude_hz(host_from_seconds(now_s)),
            clock_known=sigma_s is not None and sigma_s <= GOOD_CLOCK_S,
            frames=self._came,
            tags=self._tags,
            attitude=None if isinstance(state, Unpaired) else euler_from_quaternion(state.ned_from_body),
        )

    def _views(self, pairer: Pairer, telemetry: Telemetry) -> tuple[list[TagObservation], Counter[Reason]]:
        """Return the views of the tag that was seen most, placed in time."""
        seen = Counter(_tag(detection) for frame in self.frames for detection in frame.detections)
        wanted = seen.most_common(1)[0][0] if seen else None
        views: list[TagObservation] = []
        refused: Counter[Reason] = Counter()
        for frame in self.frames:
            corners = _corners(frame, wanted, self._calibration.image_size)
            placed = pairer.pair(msgspec.structs.replace(frame, detections=()), telemetry)
            if isinstance(placed, RefusedFrame):
                refused[placed.reason] += 1
            elif corners is not None:
                views.append(TagObservation(placed.boot_ns, corners))
        return sorted(views, key=lambda view: view.boot_ns), refused

    def _shaking(
        self, pairer: Pairer, telemetry: Telemetry, views: list[TagObservation], tag_size_m: float
    ) -> ShakeData:
        newest = telemetry.newest_state()
        clock_sigma_s = max(
            (telemetry.clock.sigma_s_at(frame.arrival_ns) for frame in self.frames[:1] if frame.arrival_ns),
            default=0.0,
        )
        return ShakeData(
            tags=views,
            attitude_at=_attitude_of(telemetry),
            samples=telemetry.attitudes,
            lens=self._calibration.lens,
            body_from_camera=pairer.body_from_camera,
            tag_size_m=tag_size_m,
            readout_s=pairer.readout_s,
            readout_sigma_s=pairer.readout_sigma_s,
            attitude_noise=radians(self._config.uncertainty.attitude_noise_deg),
            clock_sigma_s=clock_sigma_s,
            stamp_sigma_s=0.0 if isinstance(newest, Unpaired) else newest.stamp_sigma_s,
        )


def shake(
    config: Config,
    calibration: Calibration,
    signing_key: bytes | None,
    *,
    tag_size_m: float,
    wait_s: float,
    show: Callable[[Instruction], None],
) -> ShakeResult:
    """Run the service quietly until the vehicle was shaken enough; return the inputs of the estimate."""
    from fwav_companion.service.daemon import Service

    logging.getLogger("fwav_companion").addHandler(logging.NullHandler())
    session = ShakeSession(config, calibration, wait_s=wait_s, show=show)

    async def attend() -> None:
        service = Service(
            quiet(config), calibration, signing_key, elevation=(), extra_files={}, attitudes_kept_s=KEPT_S
        )
        await service.attend(session)

    asyncio.run(attend())
    return session.result(tag_size_m)


def _attitude_of(telemetry: Telemetry) -> Callable[[BootNs], Quaternion | None]:
    def attitude_at(boot_ns: BootNs) -> Quaternion | None:
        state = telemetry.state_at(boot_ns)
        return None if isinstance(state, Unpaired) else state.ned_from_body

    return attitude_at


def _closed(status: RunStatus, config: Config) -> str:
    """Return the first input that could not be opened, with the reason; "" if all are open."""
    for link in config.link:
        report = status.link(link.name)
        if link.role == "autopilot" and report.state == "down" and report.why:
            return f"link {link.name} ({link.url}): {report.why}; does another program use it?"
    if status.intake.why:
        return f"detections ({config.detections.url}): {status.intake.why}; does another program use it?"
    if status.vision is not None and status.vision.why:
        return f"camera ({shown_source(config.vision) if config.vision else ''}): {status.vision.why}"
    return ""


def _tag(detection: Detection) -> Tag:
    return detection.label, detection.detector_id


def _corners(frame: Frame, wanted: Tag | None, image_size: tuple[int, int]) -> Corners | None:
    """Return the corners of the wanted tag in the calibration's pixels; None where it is absent or seen twice."""
    scaling = scaling_from_size(frame.size, image_size)
    there = [each for each in frame.detections if each.corners is not None and _tag(each) == wanted]
    if len(there) != 1 or isinstance(scaling, Reason):
        return None
    return scaling.detection(there[0]).corners
