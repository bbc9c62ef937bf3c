"""Makes the pipeline and its rooms from a configuration: the one place that knows both. Pure."""

from __future__ import annotations

from collections.abc import Sequence
from functools import partial

from fwav_companion import __version__
from fwav_companion.acting.acting import Acting
from fwav_companion.camera import Calibration
from fwav_companion.config import Config, MountConfig
from fwav_companion.config.room_options import (
    act_options,
    camera_timing,
    publish_options,
    telemetry_options,
    tracking_options,
    version_numbers,
)
from fwav_companion.config.rules import CAMERA_COMPONENT_ID
from fwav_companion.geoid import geoid_undulation_m
from fwav_companion.localization import (
    AltitudeGround,
    Datum,
    ElevationModel,
    ElevationTile,
    FixedGround,
    Ground,
    HomeGround,
    LandmarkSights,
    Localizer,
    RangefinderGround,
    TerrainGround,
)
from fwav_companion.mavlink.client.commands import Commands, Handler
from fwav_companion.mavlink.client.identity import Identity
from fwav_companion.mavlink.client.one_shot_requests import FOLLOWED, LANDING_LIMITS
from fwav_companion.mavlink.client.rates import Rates
from fwav_companion.mavlink.client.subscriptions import default_subscriptions
from fwav_companion.mavlink.client.timesync import Timesync
from fwav_companion.pairing import LATEST_NS, Pairer, VehicleSource
from fwav_companion.pipeline.camera_parts import CameraParts
from fwav_companion.pipeline.camera_pipeline import CameraPipeline
from fwav_companion.pipeline.clicked_spots import ClickedSpots
from fwav_companion.pipeline.components import Components
from fwav_companion.pipeline.fix_agreement import FixAgreement
from fwav_companion.pipeline.pad_notices import PadJoiner
from fwav_companion.pipeline.pipeline import Pipeline
from fwav_companion.pipeline.readout_advice import ReadoutAdvice
from fwav_companion.pipeline.target_log import TargetLog
from fwav_companion.pipeline.tracking_commands import TrackingCommands
from fwav_companion.publishing.ground_messages import ONBOARD_COMPUTER_STATUS, requested_board_status
from fwav_companion.publishing.landing import LATEST_FRAME_NS
from fwav_companion.publishing.publisher import Publisher
from fwav_companion.self_calibration import KeptCalibration
from fwav_companion.telemetry import Telemetry
from fwav_companion.telemetry.gimbal import LAST_NON_MAVLINK_DEVICE
from fwav_companion.tracking import FrameTracker, Reorder, make_tracker, smoothed_tracker, tracker_with
from fwav_companion.tracking.filters.base import Filter
from fwav_companion.tracking.smoothed.sample_source import SampleSource
from fwav_companion.tracking.smoothed.solve_jobs import SmootherOptions
from fwav_companion.types import ElevatedTarget, Pad

WANTED = frozenset(
    {
        "HEARTBEAT", "TIMESYNC", "PING", "COMMAND_LONG", "COMMAND_INT", "COMMAND_ACK",
        "ATTITUDE", "ATTITUDE_QUATERNION", "GLOBAL_POSITION_INT", "LOCAL_POSITION_NED", "ALTITUDE", "VFR_HUD",
        "SCALED_PRESSURE", "ODOMETRY",
        "GPS_RAW_INT", "GPS_GLOBAL_ORIGIN", "HOME_POSITION", "DISTANCE_SENSOR", "TERRAIN_REPORT", "SYSTEM_TIME",
        "GIMBAL_DEVICE_ATTITUDE_STATUS", "MOUNT_ORIENTATION", "MOUNT_STATUS", "PARAM_VALUE", "STATUSTEXT",
        "MESSAGE_INTERVAL", "EKF_STATUS_REPORT", "ESTIMATOR_STATUS",
        "EXTENDED_SYS_STATE", "GIMBAL_MANAGER_INFORMATION", "GIMBAL_MANAGER_STATUS",
    }
)  # fmt: skip
"""Names of the messages that are used; no other is decoded."""
FILTER_STATUS_HZ = 0.5
"""Rate of the messages that show whether the autopilot's filter uses the receiver: 20 bytes/s, and known two seconds
after a change."""


def make_pipeline(
    config: Config,
    calibration: Calibration | None,
    *,
    unix_offset_ns: int,
    live: bool,
    elevation: Sequence[ElevationTile] = (),
    kept: KeptCalibration | None = None,
    own_filter: Filter | None = None,
    sightings: bool = False,
    unit: str = "",
    attitudes_kept_s: float | None = None,
    clock_rate: float = 1.0,
    written: bool = True,
    smoother: SmootherOptions | None = None,
) -> Pipeline:
    """The pipeline of one flight. Without a calibration it is the pipeline of a relay, which localizes nothing.

    ``elevation``: tiles of [ground] terrain. ``kept``: a calibration of an earlier flight with this camera.
    ``own_filter``: replaces [tracking] filter; required where that names a class of the user (ConfigError).
    ``unit``: permanent name of this board, for uids that are the same after a restart. ``attitudes_kept_s``: time for
    which attitudes are kept, for callers that read them long afterwards; None: as long as flying needs them.
    ``clock_rate``: rate of the autopilot's clock from all arrivals of a recording. ``written``: false where the lines
    are not used. ``smoother``: the smoother estimates; None: it does not.
    """
    target_log = TargetLog(__version__, config.as_builtins(), unix_offset_ns, written=written)
    component, has_camera = config.vehicle.component_id, config.publish.camera_tracking and calibration is not None
    if calibration is None and attitudes_kept_s is None:
        attitudes_kept_s = 0.0  # a relay interpolates none
    telemetry = Telemetry(telemetry_options(config, attitudes_kept_s, clock_rate))
    camera = None
    if calibration is not None:
        camera = make_camera(
            config,
            calibration,
            telemetry,
            target_log,
            elevation=elevation,
            kept=kept,
            own_filter=own_filter,
            sightings=sightings,
            smoother=smoother,
        )
    follows_clicks = live and config.vision is not None and config.vision.track_clicks
    spots = ClickedSpots(camera.look) if camera is not None and follows_clicks else None
    publisher = Publisher(
        publish_options(config, calibration, unit),
        spots=spots,
        locate=None if camera is None else camera.look.locate,
        state_at=telemetry.state_at,
        local_position_at=telemetry.local_position_at,
        moved_between=telemetry.moved_between,
        look_at=None if camera is None else camera.look.aim,
        geoid=geoid_undulation_m,
    )
    acting = None
    if live and calibration is not None and config.act is not None and config.act.acts:
        acting = Acting(act_options(config))  # without the camera component, as in `check`, no selection reaches it
    handlers: dict[int, Handler | None] = {component: None}
    if has_camera:
        tracking = TrackingCommands(publisher, acting, CAMERA_COMPONENT_ID)
        handlers = {component: tracking.on_companion, CAMERA_COMPONENT_ID: tracking.on_camera}
    commands = Commands(handlers, require_signed=config.signing is not None, version=version_numbers())
    commands.system = config.vehicle.system_id
    commands.provide(component, ONBOARD_COMPUTER_STATUS, "ONBOARD_COMPUTER_STATUS", requested_board_status)
    timesync = Timesync(component, bauds=_bauds(config))
    rates = Rates(
        default_subscriptions(config.rates.attitude, config.rates.position) | _wanted_by(config),
        attitude_message=config.vehicle.attitude_message,
        component=component,
        more_parameters=_more_parameters(config),
        on_demand={
            "LOCAL_POSITION_NED": config.rates.position,
            "ODOMETRY": config.rates.position,
            "EKF_STATUS_REPORT": FILTER_STATUS_HZ,
            "ESTIMATOR_STATUS": FILTER_STATUS_HZ,
        },
    )
    rates.gate = timesync.leaves_link_free
    components = Components(
        identity=Identity(config.vehicle.system_id, component, CAMERA_COMPONENT_ID if has_camera else None),
        timesync=timesync,
        rates=rates,
        commands=commands,
        telemetry=telemetry,
        publisher=publisher,
        camera=camera,
        acting=acting,
        spots=spots,
    )
    return Pipeline(components, target_log, unix_offset_ns=unix_offset_ns, live=live)


def _more_parameters(config: Config) -> tuple[str, ...]:
    """The autopilot's parameters that matter for what this configuration sends."""
    follows = config.act is not None and config.act.follow_target
    return ((FOLLOWED,) if follows else ()) + (LANDING_LIMITS if config.publish.landing_label else ())


def _bauds(config: Config) -> dict[str, int]:
    """Baud rates of the serial links by name. In a recording, whose messages have no link, that of the autopilot's, if
    it has one rate.
    """
    named = {link.name: link.baud for link in config.link if link.baud is not None}
    autopilots = {link.baud for link in config.link if link.role == "autopilot"}
    recorded = autopilots.pop() if len(autopilots) == 1 else None
    return named if recorded is None else {"": recorded, **named}


def make_camera(
    config: Config,
    calibration: Calibration,
    vehicle: VehicleSource,
    target_log: TargetLog,
    *,
    elevation: Sequence[ElevationTile],
    kept: KeptCalibration | None = None,
    own_filter: Filter | None = None,
    sightings: bool = False,
    smoother: SmootherOptions | None = None,
) -> CameraPipeline:
    """The pipeline of one camera. ``vehicle``: the vehicle's telemetry, or the poses of photographs."""
    make_parts = partial(
        _camera_parts,
        config,
        calibration,
        vehicle,
        elevation=elevation,
        own_filter=own_filter,
        sightings=sightings,
        smoother=smoother,
    )
    return CameraPipeline(vehicle, make_parts, target_log, kept=kept, sightings=sightings)


def _camera_parts(
    config: Config,
    calibration: Calibration,
    vehicle: VehicleSource,
    kept: KeptCalibration | None,
    *,
    elevation: Sequence[ElevationTile],
    own_filter: Filter | None,
    sightings: bool,
    smoother: SmootherOptions | None,
) -> CameraParts:
    """The rooms of a camera's pipeline before the first frame."""
    landmarks = [landmark.known for landmark in config.landmark]
    ground = _ground(config, elevation)
    tracker = _tracker(config, vehicle, kept, own_filter, ground=ground, smoother=smoother)
    tracker.reports_innovations = sightings
    return CameraParts(
        make_pairer(config, calibration),
        localizer=Localizer(ground, config.priors, min_height_m=config.ground.min_height_m),
        reorder=Reorder(tracker, LATEST_FRAME_NS) if config.publish.landing_target else Reorder(tracker),
        agreement=FixAgreement(config.priors),
        readout=ReadoutAdvice(config.priors),
        landmarks=LandmarkSights(landmarks, config.priors, min_height_m=config.ground.min_height_m),
        pads=_pads(config, calibration),
    )


def _pads(config: Config, calibration: Calibration) -> PadJoiner | None:
    """The pads, and the tags of known size; None without one."""
    if not config.pad and all(target.size_m is None for target in config.target):
        return None
    from fwav_companion.pads.pad_sights import PadSights  # in numpy, which a daemon without pads does not load

    return PadSights(config.pad, config.target, calibration.lens)


def _tracker(
    config: Config, vehicle: VehicleSource, kept: KeptCalibration | None, own_filter: Filter | None, *,
    ground: Ground, smoother: SmootherOptions | None,
) -> FrameTracker:  # fmt: skip
    """The tracker before the first frame: by the smoother, the user's own filter, or as [tracking] selects.

    ``ground``: of the smoother. ``smoother``: None where the smoother is not used.
    """
    options = config.tracking if own_filter is not None else tracking_options(config)
    priors, landmarks, smoothed = config.priors, [landmark.known for landmark in config.landmark], None
    motion_of = _motion_of(config)
    if smoother is not None and (options.filter == "kalman" or options.self_calibration):
        smoothed = smoothed_tracker(
            options,
            priors,
            vehicle if isinstance(vehicle, SampleSource) else None,
            kept,
            lever_m=config.camera.mount.lever_arm_m,
            smoother=smoother,
            ground=ground.reference,
            landmarks=landmarks,
            motion_of=motion_of,
            own_poses=not isinstance(vehicle, Telemetry),
        )
    if own_filter is not None:
        calibrates = options.self_calibration
        return tracker_with(
            own_filter, priors, vehicle.state_at, kept, self_calibration=calibrates, calibrating=smoothed
        )
    if smoothed is not None and options.filter == "kalman":
        return smoothed
    return make_tracker(
        options, priors, vehicle.state_at, kept, landmarks=landmarks, calibrating=smoothed, motion_of=motion_of
    )


def _motion_of(config: Config) -> dict[str, str]:
    """Motion of the labels that have their own."""
    things: tuple[ElevatedTarget | Pad, ...] = (*config.target, *config.pad)
    return {thing.label: thing.motion for thing in things if thing.motion is not None}


def own_components(config: Config) -> frozenset[int]:
    """The component ids under which the service sends."""
    return frozenset({config.vehicle.component_id, CAMERA_COMPONENT_ID})


def make_pairer(config: Config, calibration: Calibration) -> Pairer:
    """The pairer. A delay or mount in the calibration file replaces a default of the configuration."""
    camera = config.camera
    left_alone = not camera.mount.gimbal_device_id and camera.mount.angles == MountConfig().angles
    by_file = calibration.body_from_camera if left_alone else None
    return Pairer(
        lens=calibration.lens,
        body_from_camera=by_file or camera.mount.body_from_camera,
        lever_arm_m=camera.mount.lever_arm_m,
        timing=camera_timing(config, calibration),
        pixel_noise_px=config.uncertainty.pixel_noise_px,
        min_score=config.detections.min_score,
        labels=_used_labels(config),
        standing=config.target,
        latest_ns=LATEST_FRAME_NS if config.publish.landing_target else LATEST_NS,
    )


def _used_labels(config: Config) -> tuple[str, ...]:
    """Labels of the detections that are used, with those of the tags whose pad is among them; empty: all."""
    labels = config.detections.labels
    return (*labels, *(tag.label for pad in config.pad if pad.label in labels for tag in pad.tags))


def _ground(config: Config, elevation: Sequence[ElevationTile]) -> Ground:
    ground = config.ground
    match ground.model:
        case "fixed":
            return FixedGround(ground.height_m)
        case "rangefinder":
            return RangefinderGround(config.uncertainty.height_noise_m)
        case "terrain":
            model = ElevationModel(elevation) if elevation else None
            stated = next((tile.datum for tile in elevation if tile.datum), "")
            return TerrainGround(model, Datum(stated or ground.terrain_datum or Datum.EGM96))
        case "altitude":
            return AltitudeGround(ground.alt_amsl or 0.0)
        case "home":
            return HomeGround()


def _wanted_by(config: Config) -> dict[str, float]:
    """Rates, Hz, of further messages by name: for the receiver's own position accuracy, for an elevation model, or for
    a gimbal behind the autopilot.
    """
    wanted = {"TERRAIN_REPORT": 1.0} if config.ground.model == "terrain" else {}
    if config.localizes and config.uncertainty.position_bias_m == "auto":
        wanted |= {"EKF_STATUS_REPORT": FILTER_STATUS_HZ, "ESTIMATOR_STATUS": FILTER_STATUS_HZ}
    if 0 < config.camera.mount.gimbal_device_id <= LAST_NON_MAVLINK_DEVICE:
        wanted["GIMBAL_DEVICE_ATTITUDE_STATUS"] = config.rates.position
    return wanted
