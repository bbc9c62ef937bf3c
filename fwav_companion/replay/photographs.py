"""Replays photographs that have their own poses: each frame is paired with the pose of its picture. PURE.

There is no autopilot: the camera's pose takes the place of the vehicle's state, and ``time_boot`` is null.
"""

from __future__ import annotations

from collections.abc import Iterable, Iterator, Sequence
from math import degrees, inf, nextafter
from statistics import median

import msgspec

from fwav_companion import __version__
from fwav_companion.camera import Calibration
from fwav_companion.config import Config, MountConfig, UncertaintyConfig
from fwav_companion.errors import ConfigError
from fwav_companion.geoid import geoid_undulation_m
from fwav_companion.geometry.earth import Geodetic
from fwav_companion.geometry.stamps import NS_PER_S, HostNs
from fwav_companion.localization import ElevationTile
from fwav_companion.pipeline.camera_pipeline import CameraPipeline
from fwav_companion.pipeline.pipeline_factory import make_camera
from fwav_companion.pipeline.target_log import TargetLog
from fwav_companion.recording.line_types import HeaderLine, Line, OriginLine, SightingLine, TargetLine
from fwav_companion.recording.photograph_poses import SHARED, PhotographPose, PosesFile, SharedSigmas
from fwav_companion.recording.summary_types import SummaryLine
from fwav_companion.recording.truth import TruthPoint
from fwav_companion.recording.truth_errors import ErrorTally
from fwav_companion.replay.kept_sights import KeptSights, SharedErrors
from fwav_companion.replay.photograph_source import PhotographSource, VideoPoses, least_sigmas
from fwav_companion.replay.recorded import SkippedLine, read_frames
from fwav_companion.tracking import Settled
from fwav_companion.tracking.filters.base import Filter
from fwav_companion.tracking.smoothed.solve_jobs import SmootherOptions
from fwav_companion.types import (
    Frame,
    NoFrame,
    TakeOff,
    TakeOffSource,
)
from fwav_companion.vision.wall_clock import RecordingClock

GROUNDS = ("fixed", "terrain", "altitude", "home")
RELIEF_M, RELIEF_PER_HEIGHT = 4.0, 0.05
"""One sigma of the relief of ground that is taken as flat: a floor, and a part of the height above ground."""


class Photographs(msgspec.Struct, frozen=True):
    """Photographs with poses and detections. Host clock and autopilot clock are Unix time."""

    poses: Sequence[PhotographPose]
    frames: Sequence[Frame | NoFrame]
    """The lines of the detections: frames in the order of their stamps, then lines that are not frames."""
    skipped_lines: Sequence[SkippedLine] = ()
    """Lines of the detections that are not frames."""
    notes: Sequence[str] = ()
    """Warnings to the user."""
    sigmas_are_total: bool = False
    """Whether a row's sigmas also cover what all pictures share."""
    shared: SharedSigmas = SharedSigmas()
    """What all pictures share, by their source."""


def join_photographs(file: PosesFile, detections: bytes) -> Photographs:
    """Poses and detections of the same pictures."""
    poses = file.poses
    entries, _, skipped = read_frames(detections, RecordingClock())
    frames = sorted((entry for entry in entries if isinstance(entry, Frame)), key=lambda frame: frame.stamp_ns)
    rejected = [entry for entry in entries if isinstance(entry, NoFrame)]
    source = PhotographSource(poses, Geodetic(0.0, 0.0, 0.0))
    without = sum(source.pose_of(frame) is None for frame in frames)
    notes = [f"{without} of {len(frames)} pictures in the detections have no pose in it"] if without else []
    has_sigmas = any(s is not None for p in poses for s in (p.position_sigma_m, p.height_sigma_m, p.attitude_sigma))
    if has_sigmas and not file.sigmas_are_total:
        notes.append("its sigmas are each picture's own; `# sigmas: total` keeps the meaning of older files")
    return Photographs(poses, [*frames, *rejected], skipped, notes, file.sigmas_are_total, file.shared)


def replay_photographs(
    photographs: Photographs,
    config: Config,
    calibration: Calibration,
    *,
    elevation: Sequence[ElevationTile] = (),
    own_filter: Filter | None = None,
    sightings: bool = False,
    truth: Sequence[TruthPoint] = (),
    shared_errors: SharedErrors | None = None,
    smooths: bool = False,
) -> Iterator[Line]:
    """The lines of a targets file, header first, summary last. With truth the summary has ``errors``.

    ``shared_errors``: what it returns is the summary's ``shared_errors``. ``smooths``: the smoother estimates.
    """
    origin = _origin(photographs.poses, config)
    total = photographs.sigmas_are_total
    moves = photographs.shared.time_offset_sigma_s is not None
    source_type = VideoPoses if moves else PhotographSource
    source = source_type(photographs.poses, origin, config, sigmas_are_total=total, moves=moves)
    config = _config_for(photographs, config)
    log = TargetLog(__version__, config.as_builtins(), 0)
    log.begin(origin)
    camera = make_camera(
        config,
        calibration,
        source,
        log,
        elevation=elevation,
        own_filter=own_filter,
        sightings=sightings,
        smoother=SmootherOptions() if smooths else None,
    )
    undulation_m = geoid_undulation_m(origin.lat_deg, origin.lon_deg) if config.ground.model == "terrain" else None
    camera.on_origin(source.plane, TakeOff(origin, TakeOffSource.POSES), undulation_m)
    tally = ErrorTally(truth) if truth else None
    on_takeoff = photographs.poses[0].above_takeoff
    kept = None if shared_errors is None or config.tracking.motion == "moving" else KeptSights()
    for written in _lines(photographs.frames, source, camera, log, kept):
        line = _above_takeoff(written) if on_takeoff else written
        if tally is not None:
            tally.add(line)
        match line:
            case SummaryLine():
                if kept is not None and shared_errors is not None:
                    shared = shared_errors(kept.confirmed(), config, kept.downs())
                    line = msgspec.structs.replace(line, shared_errors=shared)
                yield line if tally is None else msgspec.structs.replace(line, errors=tally.summary())
            case TargetLine() | SightingLine():
                yield msgspec.structs.replace(line, time_boot=None)
            case _:
                yield line


def _above_takeoff(line: Line) -> Line:
    """The line where altitudes count from a take-off whose own altitude is not known: alt_amsl is null."""
    replace = msgspec.structs.replace
    match line:
        case HeaderLine(origin=origin) | OriginLine(origin=origin) if origin is not None:
            return replace(line, origin=replace(origin, alt_amsl=None))
        case TargetLine():
            return replace(line, alt_amsl=None, alt_takeoff=line.alt_amsl)
    return line


def _lines(
    frames: Sequence[Frame | NoFrame],
    source: PhotographSource,
    camera: CameraPipeline,
    log: TargetLog,
    kept: KeptSights | None,
) -> Iterator[Line]:
    def settle(settled: Iterable[Settled]) -> None:
        log.settle(settled if kept is None else kept.add(settled), source.plane)

    now = reported = HostNs(0)
    for frame in frames:
        if isinstance(frame, NoFrame):
            log.drop_frames(frame.reason)
            continue
        now = HostNs(max(now, frame.stamp_ns))
        settle(camera.settle(now))
        source.take(frame)
        camera.on_frame(msgspec.structs.replace(frame, arrival_ns=None), now)
        camera.take_ready(now)
        if now - reported >= NS_PER_S:
            reported = now
            _report_calibration(camera, log, now)
        yield from log.take()
    settle(camera.finish(now))
    _report_calibration(camera, log, now)
    log.write(log.summary())
    yield from log.take()


def _report_calibration(camera: CameraPipeline, log: TargetLog, now: HostNs) -> None:
    """The line of self-calibration: of a video's poses, whose delay it estimates."""
    report = camera.calibration
    if report is None:
        return
    log.write(camera.calibration_news.line(report, now / NS_PER_S))
    for notice in camera.calibration_news.notices(report):
        log.note(notice)


def require_photograph_config(config: Config) -> None:
    """ConfigError where the configuration needs an autopilot."""
    ground = config.ground
    if ground.model not in GROUNDS:
        raise ConfigError(
            f"{config.file}: [ground] model: {ground.model} needs telemetry, --poses has none; "
            f"accepted: {', '.join(GROUNDS)}"
        )
    if ground.model == "terrain" and not ground.terrain:
        raise ConfigError(f"{config.file}: [ground] terrain: empty; accepted with --poses: elevation files")


def _config_for(photographs: Photographs, config: Config) -> Config:
    """The configuration of a camera that is its own carrier: without mount and lever arm.

    Each picture's own errors are noise, by :meth:`PhotographSource.state_at`: its attitude error is a small rotation
    about three axes, whatever it looks at. What all pictures share is by the configuration where it states a number,
    else by the file, which has it from the pictures' source. Where sigmas are total, the least of all rows is that
    bias, and the mount is part of the attitude. The delay of a video's telemetry is estimated; photographs have none.
    """
    poses, shared = photographs.poses, photographs.shared
    by_rows: dict[str, float] = {
        "lever_arm_sigma_m": 0.0, "attitude_bias_deg": 0.0, "attitude_noise_deg": 0.0, "position_noise_m": 0.0,
    }  # fmt: skip
    for name in SHARED:
        by_source = getattr(shared, name)
        if by_source is not None and not _is_stated(config, name):
            by_rows[name] = by_source
    if photographs.sigmas_are_total:
        position, height, attitude = least_sigmas(poses, config)
        by_rows |= {"position_bias_m": position, "height_bias_m": height, "heading_bias_deg": 0.0}
        by_rows |= {"mount_bias_deg": degrees(attitude)}
    if config.ground.model != "fixed" or any(pose.height_sigma_m is not None for pose in poses):
        by_rows["height_noise_m"] = 0.0
    if config.ground.model in ("home", "altitude") and config.uncertainty.terrain_m == "auto":
        height_m = median(pose.place.alt_amsl_m for pose in poses) - _ground_alt_m(poses, config)
        # The smallest number above 4: of level ground, exactly 4 is what older files have by default, without effect.
        by_rows["terrain_m"] = max(nextafter(RELIEF_M, inf), RELIEF_PER_HEIGHT * height_m)
    replace, moves = msgspec.structs.replace, shared.time_offset_sigma_s is not None
    return replace(
        config,
        camera=replace(config.camera, mount=MountConfig(pitch_deg=0.0)),
        uncertainty=replace(config.uncertainty, **by_rows),
        tracking=replace(config.tracking, self_calibration=config.tracking.self_calibration and moves),
    )


def _is_stated(config: Config, name: str) -> bool:
    """Whether the configuration has a number of its own; what `init` writes for the camera's stamps is not one of the
    telemetry's delay.
    """
    unstated = UncertaintyConfig().time_offset_sigma_s
    return name in config.stated_sigmas and not (
        name == "time_offset_sigma_s" and config.uncertainty.time_offset_sigma_s == unstated
    )


def _origin(poses: Sequence[PhotographPose], config: Config) -> Geodetic:
    """The origin: the ground below the first picture of the file; on an elevation model that picture's own place."""
    return msgspec.structs.replace(poses[0].place, alt_amsl_m=_ground_alt_m(poses, config))


def _ground_alt_m(poses: Sequence[PhotographPose], config: Config) -> float:
    """Altitude of the ground below the first picture, as far as it is flat; else of that picture. ConfigError."""
    first, ground = poses[0], config.ground
    if first.above_takeoff and ground.model in ("altitude", "terrain"):
        raise ConfigError(
            f"{config.file}: [ground] model: {ground.model}, and the poses count from a take-off of unknown altitude; "
            'accepted: poses with takeoff_alt (detect --takeoff-alt M), model = "home" or "fixed"'
        )
    if any(pose.above_takeoff != first.above_takeoff for pose in poses):
        raise ConfigError(
            f"{config.file}: some poses count from a take-off of unknown altitude, others do not; accepted: "
            "takeoff_alt for all of them (detect --takeoff-alt M)"
        )
    if ground.model == "fixed":
        return first.place.alt_amsl_m - ground.height_m
    if ground.model == "altitude":
        return ground.alt_amsl or 0.0
    if ground.model == "home":
        if first.takeoff_alt_m is None and not first.above_takeoff:
            raise ConfigError(
                f"{config.file}: [ground] model: home, and the poses have no takeoff_alt; accepted: poses with it, "
                'alt_datum takeoff, model = "altitude" or "terrain"'
            )
        return first.takeoff_alt_m or 0.0
    return first.place.alt_amsl_m
