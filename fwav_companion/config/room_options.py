"""The options of the rooms from a configuration: the one place that knows both.

[publish], [tracking] and [vision] are declared in their rooms. This module makes the options that need several tables,
other units, or facts that are not in the file. Only a flight imports this module, because it loads the rooms.
"""

from __future__ import annotations

from collections.abc import Mapping
from math import radians

import msgspec

from fwav_companion import __version__
from fwav_companion.acting.options import ActOptions, ActTable
from fwav_companion.camera import Calibration
from fwav_companion.config.document import Config
from fwav_companion.config.rules import CAMERA_COMPONENT_ID
from fwav_companion.errors import ConfigError
from fwav_companion.links.url import UdpUrl
from fwav_companion.mavlink.router.node import LinkPolicy, SigningPolicy
from fwav_companion.pairing import CameraTiming, StampRule
from fwav_companion.publishing.camera_information import horizontal_fov_deg, vertical_fov_deg
from fwav_companion.publishing.options import PublishOptions
from fwav_companion.recording.folder import BYTES_PER_MB, RecordingPlan, SpacePolicy
from fwav_companion.telemetry import TelemetryOptions
from fwav_companion.tracking import TrackingOptions


def link_policies(config: Config) -> list[LinkPolicy]:
    """The policy of each link, in the file's order."""
    return [
        LinkPolicy(
            name=link.name,
            role=link.role,
            max_rate_hz=link.max_rate_hz,
            forward_rate_requests=link.forward_rate_requests,
            relay_unsigned=link.relay_unsigned,
            max_bytes_per_s=link.byte_budget,
            datagrams=isinstance(link.parsed_url, UdpUrl),
        )
        for link in config.link
    ]


def signing_policy(config: Config, key: bytes | None, timestamp: int) -> SigningPolicy | None:
    """The policy of message signing, whose timestamps start at ``timestamp``; None without a key."""
    if key is None or config.signing is None:
        return None
    return SigningPolicy(key=key, timestamp=timestamp, accept_unsigned=frozenset(config.signing.accept_unsigned))


def telemetry_options(config: Config, attitudes_kept_s: float | None, clock_rate: float = 1.0) -> TelemetryOptions:
    """The options of the telemetry. ``attitudes_kept_s``: None for the room's default."""
    options = TelemetryOptions(
        position=config.vehicle.position,
        attitude_message=config.vehicle.attitude_message,
        local_drift=config.vehicle.local_drift,
        position_delay_s=config.vehicle.position_delay_s,
        position_bias_by_receiver=config.uncertainty.position_bias_m == "auto",
        attitude_stamp_delay_s=config.uncertainty.attitude_stamp_delay_s,
        gimbal_device_id=config.camera.mount.gimbal_device_id,
        gimbal_levelled=config.camera.mount.levelled,
        gimbal_delay_s=config.camera.mount.gimbal_delay_s,
        clock_rate=clock_rate,
    )
    if attitudes_kept_s is None:
        return options
    return msgspec.structs.replace(options, attitudes_kept_s=attitudes_kept_s)


def camera_timing(config: Config, calibration: Calibration) -> CameraTiming:
    """The timing of the camera. The calibration's delay, if it has one, replaces the default of the configuration."""
    camera = config.camera
    # The service's own libcamera source is picamera2's, which exists only on a Raspberry Pi.
    on_libcamera = config.vision is not None and config.vision.source.startswith("libcamera:")
    asked_s = "auto" if config.vision is None else config.vision.exposure_s
    return CameraTiming(
        time_offset_s=camera.time_offset_s or calibration.time_offset_s or 0.0,
        readout_s=camera.known_readout_s,
        stamp_rule=StampRule(camera.stamp_rule(libcamera_on_raspberry_pi=on_libcamera)),
        exposure_s=camera.exposure_s if asked_s == "auto" else asked_s,
    )


def tracking_options(config: Config) -> TrackingOptions:
    """The options of the tracker. ConfigError where the filter is a class of the user."""
    if config.tracking.is_own_filter:
        raise ConfigError(
            f'{config.file}: [tracking] filter = "{config.tracking.filter}": a filter of your own works only in '
            '`replay`; accepted: "kalman" | "lowpass"'
        )
    return config.tracking


def publish_options(config: Config, calibration: Calibration | None, unit: str) -> PublishOptions:
    """The options of the publisher. ``unit``: the permanent name of this board."""
    return PublishOptions(
        **msgspec.structs.asdict(config.publish),
        image_size=(0, 0) if calibration is None else calibration.image_size,
        hfov_deg=0.0 if calibration is None else horizontal_fov_deg(calibration.lens),
        vfov_deg=0.0 if calibration is None else vertical_fov_deg(calibration.lens),
        gimbal_device_id=config.camera.mount.gimbal_device_id,
        camera_position_m=config.camera.mount.lever_arm_m,
        companion_component=config.vehicle.component_id,
        camera_component=CAMERA_COMPONENT_ID,
        version=version_numbers(),
        unit=unit,
    )


def act_options(config: Config) -> ActOptions:
    """The options of acting on the selected target; [act] is present."""
    table, mount = config.act or ActTable(), config.camera.mount
    return ActOptions(
        **msgspec.structs.asdict(table),
        gimbal_device_id=mount.gimbal_device_id,
        mount_pitch=radians(mount.pitch_deg),
        mount_yaw=radians(mount.yaw_deg),
        companion_component=config.vehicle.component_id,
        gcs_links=frozenset(link.name for link in config.link if link.role == "gcs"),
        signed=config.signing is not None,
    )


def recording_plan(config: Config, extra_files: Mapping[str, bytes]) -> RecordingPlan | None:
    """The plan of the recording; None where nothing is recorded. ``extra_files``: files kept with it, by name."""
    record = config.record
    if not record.directory:
        return None
    return RecordingPlan(
        directory=config.resolve(record.directory),
        when=record.when,
        sync_s=record.sync_s,
        space=SpacePolicy(
            most_used_bytes=round(record.max_used_mb * BYTES_PER_MB),
            least_free_bytes=round(record.min_free_mb * BYTES_PER_MB),
            remove_oldest=record.remove_oldest,
        ),
        extra_files=extra_files,
    )


def version_numbers() -> tuple[int, int, int]:
    """The version of this package as three numbers."""
    major, minor, patch = (int(part) for part in __version__.split(".")[:3])
    return (major, minor, patch)
