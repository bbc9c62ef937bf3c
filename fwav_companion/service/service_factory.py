"""SHELL: makes the optional parts of the daemon from the configuration; None for a part that is not configured."""

from __future__ import annotations

import shutil
from collections.abc import Callable, Mapping
from typing import TYPE_CHECKING

import msgspec

from fwav_companion.config import Config
from fwav_companion.config.room_options import recording_plan
from fwav_companion.errors import ConfigError, UserError
from fwav_companion.geometry.stamps import HostNs
from fwav_companion.libraries import require
from fwav_companion.links import map_link
from fwav_companion.links.base import Link, OnState
from fwav_companion.links.url import UdpUrl
from fwav_companion.mount_points import missing_mount_above
from fwav_companion.pipeline.pipeline import Pipeline
from fwav_companion.recording.recorder import Recorder
from fwav_companion.types import Notice
from fwav_companion.types.status import VisionReport
from fwav_companion.vision.detections_in import DetectionsIn
from fwav_companion.vision.frame_receiver import FrameReceiver
from fwav_companion.vision.source_names import SourceKind, is_file_name, source_kind
from fwav_companion.vision.supervisor import VisionDesk, VisionProcess
from fwav_companion.vision.task import VisionTask

if TYPE_CHECKING:
    from fwav_companion.service.fleet_sharing import FleetSharing


def make_map_link(config: Config, on_state: OnState) -> Link | None:
    """Link for Cursor on Target."""
    if config.map_server is None:
        return None
    try:
        return map_link.make_map_link(config.map_server, on_state)[0]
    except UserError as error:
        raise ConfigError(f"{config.file}: [publish] {error}") from None


def make_detections(
    config: Config, receiver: FrameReceiver, on_state: Callable[[bool, str], None]
) -> DetectionsIn | None:
    """Intake of detections from another process."""
    url = config.detections.parsed_url
    if url is None:
        return None
    endpoint = (url.host, url.port) if isinstance(url, UdpUrl) else url.path
    return DetectionsIn(endpoint, receiver, on_state)


def make_vision(
    config: Config,
    image_size: tuple[int, int],
    receiver: FrameReceiver,
    on_state: Callable[[VisionReport], None],
    desk: VisionDesk,
) -> VisionProcess | None:
    """Vision process for the service's own camera. ``image_size``: that of the calibration."""
    task = make_vision_task(config)
    if task is None:
        return None
    kept = config.record.pictures if config.record.directory else 0
    task = msgspec.structs.replace(task, size=task.size or image_size)
    return VisionProcess(task, receiver, on_state, desk, kept=kept, pad_tags=config.pad_tags)


def make_vision_task(config: Config) -> VisionTask | None:
    """Task of the vision process; None without [vision]. UserError if this machine cannot do it."""
    vision = config.vision
    if vision is None:
        return None
    if not vision.python:  # another interpreter has its own libraries, and its process reports missing ones
        require(f"{config.file}: [vision]", *modules_of(vision))
    model = _model(config, vision)
    python = _interpreter(config, vision.python) if vision.python else ""
    source = str(config.resolve(vision.source)) if is_file_name(vision.source) else vision.source
    return msgspec.structs.replace(vision, source=source, model=model, python=python)


def modules_of(vision: VisionTask) -> tuple[str, ...]:
    """The modules that the vision process needs, by their import names."""
    onnx = ("onnxruntime",) if vision.detector == "onnx" else ()
    stream = ("av",) if source_kind(vision.source) is SourceKind.STREAM else ()
    return ("numpy", "cv2", *onnx, *stream)


def _model(config: Config, vision: VisionTask) -> str:
    """The path of the model. ConfigError where it does not exist."""
    if vision.detector != "onnx":
        return vision.model
    path = config.resolve(vision.model)
    if not path.is_file():
        raise ConfigError(f'{config.file}: [vision] model = "{vision.model}": no such file; accepted: an .onnx file')
    return str(path)


def _interpreter(config: Config, python: str) -> str:
    """The path of the interpreter. ConfigError where it cannot be run."""
    found = shutil.which(str(config.resolve(python)) if "/" in python else python)
    if found is None:
        raise ConfigError(
            f'{config.file}: [vision] python = "{python}": cannot be run; accepted: an interpreter, as /usr/bin/python3'
        )
    return found


def make_recorder(
    config: Config, extra_files: Mapping[str, bytes], pipeline: Pipeline, on_failure: Callable[[str], None]
) -> Recorder | None:
    """Recorder of the flight. ``extra_files``: files that are kept with the recording, by name."""
    plan = recording_plan(config, extra_files)
    if plan is None:
        return None
    missing = missing_mount_above(plan.directory.absolute())
    if missing is not None:
        on_failure(
            f"[record] directory = {config.record.directory}: {missing}: recordings go to the disk of the system. "
            f"Mount {missing.point}, or name another directory"
        )
    return Recorder(plan, on_failure, header=pipeline.target_log.header, summary=pipeline.target_log.summary)


def make_fleet(
    config: Config,
    pipeline: Pipeline,
    *,
    now: Callable[[], HostNs],
    warn: Callable[[str], None],
    on_notice: Callable[[Notice], None],
) -> FleetSharing | None:
    """Sharing with other vehicles. Only this function loads zenoh."""
    if config.fleet is None:
        return None
    require(f"{config.file}: [fleet]", "zenoh")
    from fwav_companion.service.fleet_sharing import FleetSharing

    return FleetSharing(config.fleet, config, pipeline, now=now, warn=warn, on_notice=on_notice)
