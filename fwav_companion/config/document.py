"""The whole configuration as one frozen value."""

from __future__ import annotations

from pathlib import Path
from typing import Annotated, Any, Literal

import msgspec
from msgspec import Meta

from fwav_companion.acting.options import ActTable
from fwav_companion.camera import file_and_camera
from fwav_companion.config.estimation import GroundConfig, LandmarkConfig, UncertaintyConfig
from fwav_companion.config.inputs import (
    CameraConfig,
    DetectionsConfig,
    LinkConfig,
    NotNegative,
    RatesConfig,
    SigningConfig,
    VehicleConfig,
)
from fwav_companion.errors import ConfigError
from fwav_companion.fleet.options import FleetTable
from fwav_companion.links.map_server import MapServer
from fwav_companion.publishing.options import PublishTable
from fwav_companion.tracking.options import TrackingOptions
from fwav_companion.types import ElevatedTarget, ErrorPriors, Pad
from fwav_companion.types.secrets import redacted, secrets_of
from fwav_companion.vision.source_names import SourceKind, source_kind
from fwav_companion.vision.task import KeptPicturesRule, VisionTask


class RecordConfig(msgspec.Struct, frozen=True, kw_only=True):
    """[record]: the recording of a flight."""

    directory: str = ""
    """Path of the recordings; "": nothing is recorded."""
    when: Literal["always", "armed"] = "always"
    """Whether recording waits for arming."""
    pictures: KeptPicturesRule = 0
    """Pictures of [vision] that are kept as JPEG with their stamps. 0: none; N: every Nth; ``detections``: those with
    a detection."""
    sync_s: Annotated[float, Meta(gt=0, le=3600)] = 1.0
    """Interval of writing to the disk, seconds: a power cut loses at most this."""
    max_used_mb: NotNegative = 4096.0
    """Size of all recordings together, 10^6 bytes: about a day of flight. 0: no limit."""
    min_free_mb: NotNegative = 200.0
    """Space that stays free on the disk, 10^6 bytes: for the system's logs, its updates and a login."""
    remove_oldest: bool = False
    """Whether the oldest recordings make room for new ones; else recording stops there, and reports it."""


class StateConfig(msgspec.Struct, frozen=True, kw_only=True):
    """[state]: the results that are kept between flights."""

    directory: str = ""
    """Path; "": $STATE_DIRECTORY, and where that is unset nothing is kept."""


class StatusConfig(msgspec.Struct, frozen=True, kw_only=True):
    """[status]: the file that ``check`` and scripts read."""

    file: str = ""
    """Path; "": status.json in the first runtime directory that may be written."""


class Document(msgspec.Struct, frozen=True, kw_only=True):
    """The tables of the file, each under its name. A table of one room is that room's options struct."""

    vehicle: VehicleConfig = VehicleConfig()
    """Identity in the MAVLink network."""
    link: tuple[LinkConfig, ...] = ()
    """MAVLink connections, in the file's order."""
    signing: SigningConfig | None = None
    """Message signing; None: unsigned frames are accepted and sent."""
    rates: RatesConfig = RatesConfig()
    """Rates requested of the autopilot."""
    camera: CameraConfig = CameraConfig()
    """Lens, timing and mount."""
    detections: DetectionsConfig = DetectionsConfig()
    """Pixels from another process."""
    vision: VisionTask | None = None
    """The service's own camera; None: no camera is opened."""
    target: tuple[ElevatedTarget, ...] = ()
    """Labels whose things are not flat on the ground."""
    pad: tuple[Pad, ...] = ()
    """Landing pads of several tags, each pad one target."""
    landmark: tuple[LandmarkConfig, ...] = ()
    """Surveyed things that cancel what they show of the common errors."""
    ground: GroundConfig = GroundConfig()
    """Surface that rays are intersected with."""
    uncertainty: UncertaintyConfig = UncertaintyConfig()
    """One sigma of every error."""
    tracking: TrackingOptions = TrackingOptions()
    """How fixes become targets."""
    publish: PublishTable = PublishTable()
    """Which target is reported to which receivers."""
    act: ActTable | None = None
    """What is done about the target that an operator selected; None: nothing."""
    fleet: FleetTable | None = None
    """What is shared with other vehicles; None: nothing."""
    record: RecordConfig = RecordConfig()
    """The recording of a flight."""
    state: StateConfig = StateConfig()
    """What is kept between flights."""
    status: StatusConfig = StatusConfig()
    """The file that is rewritten each second."""


class Config(Document, frozen=True, kw_only=True):
    """A configuration file that was read and found valid."""

    file: str
    """Path of the file, as the user named it. Errors begin with it, and relative paths count from its folder."""
    stated_sigmas: frozenset[str] = frozenset()
    """The keys of [uncertainty] with a number in the file or in an override."""

    def resolve(self, path: str) -> Path:
        """Full path for a path in the file, which is relative to the file's folder."""
        return Path(self.file).parent / path

    @property
    def status_path(self) -> Path | None:
        """The path of the status file; None: in a runtime directory."""
        return self.resolve(self.status.file) if self.status.file else None

    @property
    def calibration_path(self) -> Path:
        """The path of the camera's calibration file. ConfigError without one, because pixels cannot be localized."""
        if not self.camera.calibration:
            raise ConfigError(f"{self.file}: [camera] calibration: missing; accepted: the path of a camera file")
        return self.resolve(file_and_camera(self.camera.calibration)[0])

    @property
    def calibration_camera(self) -> str:
        """The camera of a calibration file of several, as cam1; "" where none is named."""
        return file_and_camera(self.camera.calibration)[1]

    @property
    def map_server(self) -> MapServer | None:
        """Where Cursor on Target goes; None where it is not sent."""
        keys = self.publish
        if not keys.cot and not keys.cot_package:
            return None
        return MapServer(
            url=keys.cot,
            client_cert=keys.cot_client_cert,
            client_key=keys.cot_client_key,
            password_file=keys.cot_password_file,
            ca=keys.cot_ca,
            server_name=keys.cot_server_name,
            package=keys.cot_package,
        ).resolved(Path(self.file).parent)

    @property
    def priors(self) -> ErrorPriors:
        """[uncertainty] in radians, metres and seconds, with the prior of the readout."""
        return self.uncertainty.priors(
            readout_known=self.camera.known_readout_s is not None,
            surveyed=self.ground.model == "terrain",
            standing=bool(self.target) or any(pad.height_m for pad in self.pad),
            stream=self._has_mapped_stream,
            gimbal_yaw_deg=self.camera.mount.gimbal_yaw_bias_deg if self.camera.mount.gimbal_device_id else None,
        )

    @property
    def pad_tags(self) -> tuple[str, ...]:
        """Labels of the tags of all pads."""
        return tuple(tag.label for pad in self.pad for tag in pad.tags)

    @property
    def _has_mapped_stream(self) -> bool:
        """Whether pictures come as a stream whose stamps contain an unknown latency."""
        vision = self.vision
        return vision is not None and vision.stream_clock != "utc" and source_kind(vision.source) is SourceKind.STREAM

    @property
    def localizes(self) -> bool:
        """Whether ``run`` has a source of detections; without one the service is a relay."""
        return bool(self.detections.url) or self.vision is not None

    def require_links(self) -> None:
        """ConfigError unless a link leads to an autopilot: ``run`` needs one, ``replay`` does not."""
        if not any(link.role == "autopilot" for link in self.link):
            raise ConfigError(
                f'{self.file}: [[link]]: no link has role = "autopilot"; accepted: at least one, '
                'as url = "serial:///dev/serial0:921600"'
            )

    def heard_follow_id(self) -> ConfigError:
        """The error where another sender is heard with [act] follow_system_id."""
        system = 0 if self.act is None else self.act.follow_system_id
        return ConfigError(
            f"{self.file}: [act] follow_system_id = {system}: another sender is heard with it; accepted: an id that no "
            "other sender has"
        )

    def as_builtins(self) -> dict[str, Any]:
        """Every key with its value, passwords and tokens redacted; independent of the file's path."""
        tree: dict[str, Any] = redacted(msgspec.to_builtins(self), dict(secrets_of(self)))
        del tree["file"], tree["stated_sigmas"]
        return tree
