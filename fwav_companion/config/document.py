"""The whole file as one frozen value."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import msgspec

from fwav_companion.config.estimation import GroundConfig, TrackingConfig, UncertaintyConfig
from fwav_companion.config.inputs import (
    CameraConfig,
    DetectionsConfig,
    LinkConfig,
    RatesConfig,
    Section,
    SigningConfig,
    VehicleConfig,
    VisionConfig,
)
from fwav_companion.config.outputs import PublishConfig, RecordConfig, StateConfig, StatusConfig
from fwav_companion.errors import ConfigError
from fwav_companion.types import ErrorPriors


class Document(Section, frozen=True):
    """The tables of the file, by their names."""

    vehicle: VehicleConfig = VehicleConfig()
    """Whom we fly with."""
    link: tuple[LinkConfig, ...] = ()
    """The ways in and out, in the file's order."""
    signing: SigningConfig | None = None
    """None: unsigned is accepted, and sent."""
    rates: RatesConfig = RatesConfig()
    """What is asked of the autopilot."""
    camera: CameraConfig = CameraConfig()
    """The lens, its timing and its mount."""
    detections: DetectionsConfig = DetectionsConfig()
    """Pixels from another process."""
    vision: VisionConfig | None = None
    """None: no camera is opened."""
    ground: GroundConfig = GroundConfig()
    """What rays are intersected with."""
    uncertainty: UncertaintyConfig = UncertaintyConfig()
    """One sigma of everything that is not known."""
    tracking: TrackingConfig = TrackingConfig()
    """How fixes become targets."""
    publish: PublishConfig = PublishConfig()
    """Which target is told to whom."""
    record: RecordConfig = RecordConfig()
    """What a flight leaves behind."""
    state: StateConfig = StateConfig()
    """What is kept between flights."""
    status: StatusConfig = StatusConfig()
    """The file that is rewritten each second."""


class Config(Document, frozen=True, kw_only=True):
    """A file that was read and found good."""

    file: str
    """Its path, as the user named it: errors begin with it, and relative paths count from its folder."""

    def resolve(self, path: str) -> Path:
        """A path of the file's, relative to the file."""
        return Path(self.file).parent / path

    @property
    def calibration_path(self) -> Path:
        """The camera file. ConfigError where none is named: pixels cannot be localized."""
        if not self.camera.calibration:
            raise ConfigError(f"{self.file}: [camera] calibration: missing; accepted: the path of a camera file")
        return self.resolve(self.camera.calibration)

    @property
    def priors(self) -> ErrorPriors:
        """[uncertainty] in SI, the readout's among them."""
        return self.uncertainty.priors(
            readout_known=self.camera.known_readout_s is not None, surveyed=self.ground.model == "terrain"
        )

    @property
    def localizes(self) -> bool:
        """Whether pixels arrive in ``run`` at all; without them the service is a relay."""
        return bool(self.detections.url) or self.vision is not None

    def require_links(self) -> None:
        """ConfigError unless there is a way to an autopilot: what ``run`` needs and ``replay`` does not."""
        if not any(link.role == "autopilot" for link in self.link):
            raise ConfigError(
                f'{self.file}: [[link]]: none has role "autopilot"; accepted: at least one, '
                'as url = "serial:///dev/serial0:921600"'
            )

    def as_builtins(self) -> dict[str, Any]:
        """Every key with its value, for a recording's header: the same wherever the file lies."""
        tree: dict[str, Any] = msgspec.to_builtins(self)
        del tree["file"]
        return tree
