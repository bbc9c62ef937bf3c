"""Replays photographs that have their own poses: each frame is paired with the pose of its picture. PURE.

There is no autopilot: the camera's pose takes the place of the vehicle's state, and ``time_boot`` is null.
"""

from __future__ import annotations

from bisect import bisect_left
from collections.abc import Iterator, Sequence
from math import degrees, hypot, inf, nextafter, radians, sqrt
from statistics import median

import msgspec

from fwav_companion import __version__
from fwav_companion.camera import Calibration
from fwav_companion.config import Config, MountConfig
from fwav_companion.errors import ConfigError
from fwav_companion.geometry.earth import Geodetic, TangentPlane
from fwav_companion.geometry.stamps import BootNs, HostNs
from fwav_companion.geometry.vectors import ZERO3
from fwav_companion.localization import ElevationTile
from fwav_companion.pipeline.camera_pipeline import CameraPipeline
from fwav_companion.pipeline.pipeline_factory import make_camera
from fwav_companion.pipeline.target_log import TargetLog
from fwav_companion.recording.lines import Line
from fwav_companion.recording.photograph_poses import SAME_TIME_S, PhotographPose, PosesFile
from fwav_companion.recording.truth import TruthPoint
from fwav_companion.recording.truth_errors import ErrorTally
from fwav_companion.replay.recorded import SkippedLine, read_frames
from fwav_companion.tracking.filters.base import Filter
from fwav_companion.types import (
    Frame,
    NoFrame,
    Reason,
    TakeOff,
    TakeOffSource,
    Unpaired,
    VehicleState,
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
    return Photographs(poses, [*frames, *rejected], skipped, notes, file.sigmas_are_total)


def replay_photographs(
    photographs: Photographs,
    config: Config,
    calibration: Calibration,
    *,
    elevation: Sequence[ElevationTile] = (),
    own_filter: Filter | None = None,
    sightings: bool = False,
    truth: Sequence[TruthPoint] = (),
) -> Iterator[Line]:
    """The lines of a targets file, header first, summary last. With truth the summary has ``errors``."""
    origin = _origin(photographs.poses, config)
    total = photographs.sigmas_are_total
    source = PhotographSource(photographs.poses, origin, config, sigmas_are_total=total)
    config = _config_for(photographs.poses, config, sigmas_are_total=total)
    log = TargetLog(__version__, config.as_builtins(), 0)
    log.begin(origin)
    camera = make_camera(
        config, calibration, source, log, elevation=elevation, own_filter=own_filter, sightings=sightings
    )
    camera.placed(source.plane, TakeOff(origin, TakeOffSource.POSES), None)
    tally = ErrorTally(truth) if truth else None
    for line in _lines(photographs.frames, source, camera, log):
        if tally is not None:
            tally.add(line)
            if line["type"] == "summary":
                yield {**line, "errors": tally.summary()}
                continue
        yield {**line, "time_boot": None} if "time_boot" in line else line


def _lines(
    frames: Sequence[Frame | NoFrame], source: PhotographSource, camera: CameraPipeline, log: TargetLog
) -> Iterator[Line]:
    now = HostNs(0)
    for frame in frames:
        if isinstance(frame, NoFrame):
            log.drop_frames(frame.reason)
            continue
        now = HostNs(max(now, frame.stamp_ns))
        log.settle(camera.settle(now), source.plane)
        source.take(frame)
        camera.on_frame(msgspec.structs.replace(frame, arrival_ns=None), now)
        camera.take_ready(now)
        yield from log.take()
    log.settle(camera.finish(now), source.plane)
    log.write(log.summary())
    yield from log.take()


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
    if ground.model == "terrain" and ground.terrain_datum == "ellipsoid":
        raise ConfigError(
            f"{config.file}: [ground] terrain_datum: ellipsoid, but alt_amsl of --poses is above sea level; "
            "accepted: egm96, egm2008"
        )


def _config_for(poses: Sequence[PhotographPose], config: Config, *, sigmas_are_total: bool) -> Config:
    """The configuration of a camera that is its own carrier: without mount and lever arm.

    Each picture's own errors are noise, by :meth:`PhotographSource.state_at`: its attitude error is a small rotation
    about three axes, whatever it looks at. The biases of the configuration are shared by all pictures. Where sigmas are
    total, the least of all rows is that bias, and the mount is part of the attitude.
    """
    by_rows: dict[str, float] = {
        "lever_arm_sigma_m": 0.0, "attitude_bias_deg": 0.0, "attitude_noise_deg": 0.0, "position_noise_m": 0.0,
    }  # fmt: skip
    if sigmas_are_total:
        position, height, attitude = _least_sigmas(poses, config)
        by_rows |= {"position_bias_m": position, "height_bias_m": height, "heading_bias_deg": 0.0}
        by_rows |= {"mount_bias_deg": degrees(attitude)}
    if config.ground.model != "fixed" or any(pose.height_sigma_m is not None for pose in poses):
        by_rows["height_noise_m"] = 0.0
    if config.ground.model in ("home", "altitude") and config.uncertainty.terrain_m == "auto":
        height_m = median(pose.place.alt_amsl_m for pose in poses) - _ground_alt_m(poses, config)
        # The smallest number above 4: of level ground, exactly 4 is what older files have by default, without effect.
        by_rows["terrain_m"] = max(nextafter(RELIEF_M, inf), RELIEF_PER_HEIGHT * height_m)
    replace = msgspec.structs.replace
    return replace(
        config,
        camera=replace(config.camera, mount=MountConfig(pitch_deg=0.0)),
        uncertainty=replace(config.uncertainty, **by_rows),
        tracking=replace(config.tracking, self_calibration=False),
    )


def _least_sigmas(poses: Sequence[PhotographPose], config: Config) -> tuple[float, float, float]:
    """The least sigma of position, height and attitude over all pictures, metres and radians."""
    rows = [_sigmas(pose, config) for pose in poses]
    position, height, attitude = (min(column) for column in zip(*rows, strict=True))
    return position, height, attitude


def _own_sigmas(pose: PhotographPose, config: Config) -> tuple[float, float, float]:
    """One sigma of a picture's own errors of position, height and attitude: from its row, else the noise configured."""
    given = config.uncertainty
    by_config = (given.position_noise_m, given.height_noise_m, radians(given.attitude_noise_deg))
    of_row = (pose.position_sigma_m, pose.height_sigma_m, pose.attitude_sigma)
    position, height, attitude = (b if own is None else own for own, b in zip(of_row, by_config, strict=True))
    return position, height, attitude


def _sigmas(pose: PhotographPose, config: Config) -> tuple[float, float, float]:
    """One sigma of position, height and attitude of a picture: from its row, else noise and bias of the
    configuration.
    """
    given = config.uncertainty
    attitude_deg = hypot(max(given.attitude_bias_deg, given.heading_bias_deg), given.attitude_noise_deg)
    by_config = (
        hypot(given.position_sigma_m, given.position_noise_m),
        hypot(given.height_bias_m, given.height_noise_m),
        attitude_deg / degrees(1.0),
    )
    of_row = (pose.position_sigma_m, pose.height_sigma_m, pose.attitude_sigma)
    position, height, attitude = (b if own is None else own for own, b in zip(of_row, by_config, strict=True))
    return position, height, attitude


def _origin(poses: Sequence[PhotographPose], config: Config) -> Geodetic:
    """The origin: the ground below the first picture of the file; on an elevation model that picture's own place."""
    return msgspec.structs.replace(poses[0].place, alt_amsl_m=_ground_alt_m(poses, config))


def _ground_alt_m(poses: Sequence[PhotographPose], config: Config) -> float:
    """Altitude of the ground below the first picture, as far as it is flat; else of that picture. ConfigError."""
    first, ground = poses[0], config.ground
    if ground.model == "fixed":
        return first.place.alt_amsl_m - ground.height_m
    if ground.model == "altitude":
        return ground.alt_amsl or 0.0
    if ground.model == "home":
        if first.takeoff_alt_m is None:
            raise ConfigError(
                f"{config.file}: [ground] model: home, and the poses have no takeoff_alt; accepted: poses with it, "
                'model = "altitude" or "terrain"'
            )
        return first.takeoff_alt_m
    return first.place.alt_amsl_m


class UnixClock:
    """Conversion between host clock and autopilot clock where both are Unix time."""

    def host_from_boot(self, boot_ns: BootNs) -> HostNs | Unpaired:
        """The same instant."""
        return HostNs(boot_ns)

    def boot_from_host(self, host_ns: HostNs) -> BootNs | Unpaired:
        """The same instant."""
        return BootNs(host_ns)

    def sigma_s_at(self, host_ns: HostNs) -> float:  # noqa: ARG002
        """0: the offset is exact."""
        return 0.0

    def rate_at(self, host_ns: HostNs) -> float:  # noqa: ARG002
        """1: both clocks are the same."""
        return 1.0


class PoseWorld:
    """The local frame about the origin."""

    relative: bool | None = False


class PhotographSource:
    """Source of the camera's state: the pose of the picture that :meth:`take` selected last."""

    def __init__(
        self,
        poses: Sequence[PhotographPose],
        origin: Geodetic,
        config: Config | None = None,
        *,
        sigmas_are_total: bool = False,
    ) -> None:
        """``config``: None where poses are only looked up."""
        self.clock = UnixClock()
        self.world = PoseWorld()
        self.plane = TangentPlane(origin)
        self._by_frame = {pose.frame: pose for pose in poses if pose.frame is not None}
        timed = [(pose.time_unix, pose) for pose in poses if pose.frame is None and pose.time_unix is not None]
        self._timed = sorted(timed, key=lambda each: each[0])
        self._config = config
        self._shared = (0.0, 0.0, 0.0) if config is None or not sigmas_are_total else _least_sigmas(poses, config)
        self._sigmas = _sigmas if sigmas_are_total else _own_sigmas
        self._pose: PhotographPose | None = None

    def pose_of(self, frame: Frame) -> PhotographPose | None:
        """The pose of a frame: by its number, else by its time."""
        if frame.number in self._by_frame:
            return self._by_frame[frame.number]
        time_s = frame.stamp_ns * 1e-9
        after = bisect_left(self._timed, time_s, key=lambda each: each[0])
        near = min(self._timed[max(0, after - 1) : after + 1], key=lambda each: abs(each[0] - time_s), default=None)
        return near[1] if near is not None and abs(near[0] - time_s) <= SAME_TIME_S else None

    def take(self, frame: Frame) -> None:
        """Select the picture of this frame."""
        self._pose = self.pose_of(frame)

    def ready_for(self, boot_ns: BootNs) -> bool:  # noqa: ARG002
        """True: a pose is complete."""
        return True

    def newest_state(self) -> VehicleState | Unpaired:
        """NO_POSE: there is no vehicle now."""
        return Unpaired(Reason.NO_POSE)

    def state_at(self, boot_ns: BootNs) -> VehicleState | Unpaired:
        """State of the camera in the selected picture, the same for every row."""
        pose = self._pose
        if pose is None or self._config is None:
            return Unpaired(Reason.NO_POSE)
        own = self._sigmas(pose, self._config)
        position, height, attitude = (
            sqrt(max(0.0, sigma * sigma - shared * shared)) for sigma, shared in zip(own, self._shared, strict=True)
        )
        return VehicleState(
            boot_ns=boot_ns,
            ned_from_body=pose.ned_from_carrier,
            rates=ZERO3,
            attitude_sigma=attitude,
            gap_s=0.0,
            position_ned=self.plane.ned_from_geodetic(pose.place),
            velocity_ned=ZERO3,
            position_sigma_m=position,
            height_above_home_m=None,
            height_sigma_m=height,
        )
