"""How a pixel becomes a place: the ground, the uncertainties, the tracker."""

from __future__ import annotations

from math import radians, sqrt
from typing import Annotated, Literal, TypeAlias

from msgspec import Meta

from fwav_companion.config.inputs import NotNegative, Positive, Section
from fwav_companion.types import BIAS_COUNT, Bias, ErrorPriors

SigmaDeg: TypeAlias = Annotated[float, Meta(ge=0, le=180)]
SigmaM: TypeAlias = Annotated[float, Meta(ge=0, le=10_000)]
SigmaPx: TypeAlias = Annotated[float, Meta(gt=0, le=10_000)]
"""Up to where nothing at all is known. From 1e9 beside centimetres, a covariance is no longer one in 64-bit floats."""

READOUT_SIGMA_UNKNOWN_S = 1.0 / 30.0 / sqrt(12.0)
"""One sigma of an unknown readout until frames tell their interval: uniform over [0, interval] at 30 frames/s, the
commonest rate. Whoever hears the frames replaces it by their own median interval."""


class GroundConfig(Section, frozen=True):
    """[ground]: the surface that rays are intersected with."""

    model: Literal["home", "fixed", "rangefinder", "terrain"] = "home"
    """``home``: the surface at take-off height; ``fixed``: height_m below the camera."""
    height_m: Positive = 1.2
    """For ``fixed``, metres."""
    min_height_m: NotNegative = 0.5
    """Below this height above ground there is no fix, metres."""
    terrain: tuple[Annotated[str, Meta(min_length=1)], ...] = ()
    """Paths of .hgt or GeoTIFF files."""
    terrain_datum: Literal["", "egm96", "egm2008", "ellipsoid"] = ""
    """What the files' heights are counted from."""


class UncertaintyConfig(Section, frozen=True):
    """[uncertainty]: one sigma each. Noise is fresh in every sample, a bias the same through a flight."""

    pixel_noise_px: SigmaPx = 4.0
    """Where a detection brings none, pixels."""
    attitude_noise_deg: SigmaDeg = 0.1
    """Roll, pitch and yaw, degrees."""
    attitude_bias_deg: SigmaDeg = 0.5
    """Roll and pitch, degrees."""
    heading_bias_deg: SigmaDeg = 2.0
    """Degrees."""
    position_noise_m: SigmaM = 0.1
    """Horizontal, metres an axis."""
    position_bias_m: SigmaM = 1.0
    """Horizontal, metres an axis; wanders with position_bias_time_s."""
    position_bias_time_s: Positive = 60.0
    """Time constant of that wandering, seconds."""
    height_noise_m: SigmaM = 0.3
    """Metres."""
    height_bias_m: SigmaM = 0.5
    """Metres."""
    terrain_m: SigmaM = 4.0
    """Of the elevation model, metres."""
    mount_bias_deg: SigmaDeg = 1.0
    """About each body axis, degrees."""
    time_offset_sigma_s: Annotated[float, Meta(ge=0, le=10)] = 0.01
    """Of [camera] time_offset_s, seconds."""
    attitude_stamp_delay_s: Literal["auto"] | Annotated[float, Meta(ge=0, le=1)] = "auto"
    """An attitude is up to this older than its stamp, uniformly, seconds; ``auto`` by the autopilot's loop rate."""

    def priors(self, *, readout_known: bool, surveyed: bool) -> ErrorPriors:
        """The same in radians, metres and seconds, the biases in the order of :class:`nouns.Bias`.

        ``surveyed``: the ground is an elevation model. Any other has no error of one, and trackers need not carry it.
        """
        sigmas = {
            Bias.ROLL: radians(self.attitude_bias_deg),
            Bias.PITCH: radians(self.attitude_bias_deg),
            Bias.HEADING: radians(self.heading_bias_deg),
            Bias.MOUNT_X: radians(self.mount_bias_deg),
            Bias.MOUNT_Y: radians(self.mount_bias_deg),
            Bias.MOUNT_Z: radians(self.mount_bias_deg),
            Bias.TIME_OFFSET: self.time_offset_sigma_s,
            Bias.READOUT: 0.0 if readout_known else READOUT_SIGMA_UNKNOWN_S,
            Bias.HEIGHT: self.height_bias_m,
            Bias.POSITION_NORTH: self.position_bias_m,
            Bias.POSITION_EAST: self.position_bias_m,
            Bias.TERRAIN: self.terrain_m if surveyed else 0.0,
        }
        return ErrorPriors(
            pixel_noise_px=self.pixel_noise_px,
            attitude_noise=radians(self.attitude_noise_deg),
            position_noise_m=self.position_noise_m,
            height_noise_m=self.height_noise_m,
            bias_sigmas=tuple(sigmas[Bias(i)] for i in range(BIAS_COUNT)),
            position_bias_time_s=self.position_bias_time_s,
        )


class TrackingConfig(Section, frozen=True):
    """[tracking]: how fixes become targets."""

    filter: Annotated[
        str, Meta(pattern=r"^(kalman|lowpass|[A-Za-z_][\w.]*:[A-Za-z_]\w*)$", description='"kalman" | "lowpass"')
    ] = "kalman"
    """``lowpass`` is the paper's. In ``replay`` alone, ``module:Class`` is a filter of the user's own."""
    alpha: Annotated[float, Meta(gt=0, le=1)] = 0.125
    """Of the low-pass, at alpha_rate_hz."""
    alpha_rate_hz: NotNegative = 30.0
    """Hertz; 0: the paper's own recursion, a step a frame."""
    motion: Literal["static", "moving"] = "static"
    """What targets do."""
    self_calibration: bool = False
    """Whether the camera's delay and mount are estimated in flight, from targets that stand. Beside ``lowpass``, a
    filter of one's own or ``moving`` what is found is told and kept, not applied to the tracks."""

    @property
    def is_own_filter(self) -> bool:
        """``filter`` names a class of the user's."""
        return ":" in self.filter
