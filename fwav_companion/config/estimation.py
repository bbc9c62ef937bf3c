"""The tables of the estimation: the ground, and one sigma of every error."""

from __future__ import annotations

from math import hypot, radians, sqrt
from typing import Annotated, Literal, TypeAlias

import msgspec
from msgspec import Meta

from fwav_companion.config.inputs import NotNegative, Positive
from fwav_companion.geometry.earth import Geodetic
from fwav_companion.types import BIAS_COUNT, Bias, ErrorPriors, GimbalSigmas, Landmark

SigmaDeg: TypeAlias = Annotated[float, Meta(ge=0, le=180)]
SigmaM: TypeAlias = Annotated[float, Meta(ge=0, le=10_000)]
SigmaPx: TypeAlias = Annotated[float, Meta(gt=0, le=10_000)]
"""Sigma of a pixel; the largest means complete ignorance. With 1e9 and centimetres together, 64-bit floats cannot
represent the covariance."""

READOUT_SIGMA_UNKNOWN_S = 1.0 / 30.0 / sqrt(12.0)
"""One sigma of an unknown readout before the frame interval is known: uniform over [0, interval] at 30 frames/s, the
most common rate. The pairer replaces it by the median interval of the frames."""


STREAM_LATENCY_SIGMA_S = 0.1
"""One sigma of a stream's constant latency, seconds. Stamps cannot show it: encoders and cameras add 0 to 0.3 s."""
GIMBAL_DELAY_SIGMA_S = 0.05
"""One sigma of the age of a gimbal's attitude at its stamp, seconds: gimbals on serial lines report what they measured
0 to 0.1 s ago."""
LEAST_TILT_SIGMA = 1e-6
"""Least sigma of a gimbal's roll and pitch, radians: the error of a doubtful message is expressed in units of it."""
MODEL_SIGMA_M, LEAST_MODEL_SIGMA_M = 4.0, 0.01
"""One sigma of an elevation model, and the least that is used, metres. Global models differ from one another by 2.4 to
4.5 +- 3 to 4 m on three pairs of tiles."""


USUAL_POSITION_SIGMA_M = 1.0
"""One sigma of a receiver without corrections, metres an axis."""


UNKNOWN_TIMES_S = (60.0, 1800.0)
"""Time constants, seconds, of the two processes of equal variance that replace one of unknown time constant.

Over 300 flights with time constants drawn log-uniformly from 30 s to 30 min, the reported 90 % ellipses contained the
target in 88 % (11 fixes of 1 m over 5 min) and 93 % (3 passes of 20 s in 8 min); with one process of 60 s, in 64 % and
73 %."""


class GroundConfig(msgspec.Struct, frozen=True, kw_only=True):
    """[ground]: the surface that rays are intersected with."""

    model: Literal["home", "fixed", "rangefinder", "terrain", "altitude"] = "home"
    """``home``: the surface at take-off height; ``fixed``: height_m below the camera; ``altitude``: at alt_amsl."""
    alt_amsl: Annotated[float, Meta(ge=-1000, le=10_000)] | None = None
    """Altitude of the ground for ``altitude``, metres above mean sea level (EGM96)."""
    height_m: Positive = 1.2
    """Height of the camera above ground for ``fixed``, metres."""
    min_height_m: NotNegative = 0.5
    """Least height above ground at which fixes are made, metres."""
    terrain: tuple[Annotated[str, Meta(min_length=1)], ...] = ()
    """Paths of .hgt or GeoTIFF files."""
    terrain_datum: Literal["", "egm96", "egm2008", "ellipsoid"] = ""
    """Datum of the heights in these files."""


class LandmarkConfig(msgspec.Struct, frozen=True, kw_only=True):
    """[[landmark]]: a surveyed thing that the camera sees."""

    label: Annotated[str, Meta(min_length=1)]
    """Label of its detections."""
    lat: Annotated[float, Meta(ge=-90, le=90)]
    """Latitude, degrees."""
    lon: Annotated[float, Meta(ge=-180, le=180)]
    """Longitude, degrees."""
    alt_amsl: Annotated[float, Meta(ge=-1000, le=10_000)]
    """Altitude above mean sea level of the autopilot's geoid, metres."""
    sigma_m: Annotated[float, Meta(gt=0, le=100)] = 0.05
    """One sigma of the survey, metres an axis."""

    @property
    def known(self) -> Landmark:
        """The landmark in the form that the rooms use."""
        return Landmark(self.label, Geodetic.from_degrees(self.lat, self.lon, self.alt_amsl), self.sigma_m)


class UncertaintyConfig(msgspec.Struct, frozen=True, kw_only=True):
    """[uncertainty]: one sigma each. Noise is independent in every sample, a bias is the same through a flight.

    The biases of height, heading and mount also accept ``auto``, which is the same as to leave them out: the default
    here, and by the source of photographs where they have poses of their own.
    """

    pixel_noise_px: SigmaPx = 4.0
    """Noise of a detection that brings no sigma, pixels."""
    attitude_noise_deg: SigmaDeg = 0.1
    """Noise of roll, pitch and yaw, degrees."""
    attitude_bias_deg: SigmaDeg = 0.5
    """Bias of roll and pitch, degrees."""
    heading_bias_deg: SigmaDeg = 2.0
    """Bias of the heading, degrees."""
    position_noise_m: SigmaM = 0.1
    """Noise of the horizontal position, metres an axis."""
    position_bias_m: Literal["auto"] | SigmaM = "auto"
    """Bias of the horizontal position, metres an axis; it wanders with position_bias_time_s. ``auto``: by the
    receiver's own word, 1.0 without one."""
    position_bias_time_s: Literal["auto"] | Positive = "auto"
    """Time constant of the position bias, seconds; ``auto``: unknown, between 30 s and 30 min."""
    position_delay_sigma_s: Annotated[float, Meta(ge=0, le=10)] = 0.05
    """Bias of [vehicle] position_delay_s, seconds."""
    lever_arm_sigma_m: SigmaM = 0.03
    """Bias of [camera.mount] position_m and of the antenna's position, metres, each body axis."""
    height_noise_m: SigmaM = 0.3
    """Noise of the height, metres."""
    height_bias_m: SigmaM = 0.5
    """Bias of the height, metres."""
    terrain_m: Literal["auto"] | SigmaM = "auto"
    """Bias of the ground's own height, metres; ``auto``: 4 of an elevation model, else 0."""
    mount_bias_deg: SigmaDeg = 1.0
    """Bias of the mount about each body axis, degrees."""
    time_offset_sigma_s: Annotated[float, Meta(ge=0, le=10)] = 0.01
    """Bias of [camera] time_offset_s, seconds."""
    attitude_stamp_delay_s: Literal["auto"] | Annotated[float, Meta(ge=0, le=1)] = "auto"
    """Largest age of an attitude at its stamp, uniformly distributed, seconds; ``auto``: from the autopilot's loop."""

    def priors(
        self,
        *,
        readout_known: bool,
        surveyed: bool,
        standing: bool = False,
        stream: bool = False,
        gimbal_yaw_deg: float | None = None,
    ) -> ErrorPriors:
        """The error priors in radians, metres and seconds, the biases in the order of :class:`Bias`.

        ``surveyed``: the ground is an elevation model. ``standing``: some labels have a height.
        ``stream``: pictures come as a stream. ``gimbal_yaw_deg``: one sigma of a gimbal's own heading; None without a
        gimbal. A gimbal's heading error and its delay act as those of the vehicle and of the camera, and are added to
        them. Its attitude error is a small rotation about its three axes: the third is added to the mount's, because
        where the camera looks straight down the first is the heading.
        """
        on_gimbal = gimbal_yaw_deg is not None
        gimbal_heading, gimbal_delay_s = radians(gimbal_yaw_deg or 0.0), GIMBAL_DELAY_SIGMA_S if on_gimbal else 0.0
        heading = radians(self.heading_bias_deg)
        camera_delay_s = hypot(self.time_offset_sigma_s, STREAM_LATENCY_SIGMA_S if stream else 0.0)
        tilt = radians(self.attitude_bias_deg)
        sigmas = {
            Bias.ROLL: max(tilt, LEAST_TILT_SIGMA) if on_gimbal else tilt,
            Bias.PITCH: max(tilt, LEAST_TILT_SIGMA) if on_gimbal else tilt,
            Bias.HEADING: hypot(heading, gimbal_heading),
            Bias.MOUNT_X: radians(self.mount_bias_deg),
            Bias.MOUNT_Y: radians(self.mount_bias_deg),
            Bias.MOUNT_Z: hypot(radians(self.mount_bias_deg), tilt if on_gimbal else 0.0),
            Bias.TIME_OFFSET: hypot(camera_delay_s, gimbal_delay_s),
            Bias.READOUT: 0.0 if readout_known else READOUT_SIGMA_UNKNOWN_S,
            Bias.HEIGHT: self.height_bias_m,
            Bias.POSITION_NORTH: self.position_sigma_m,
            Bias.POSITION_EAST: self.position_sigma_m,
            Bias.TERRAIN: self._terrain_m(surveyed=surveyed),
            Bias.POSITION_DELAY: self.position_delay_sigma_s,
            Bias.LEVER_X: self.lever_arm_sigma_m,
            Bias.LEVER_Y: self.lever_arm_sigma_m,
            Bias.LEVER_Z: self.lever_arm_sigma_m,
            Bias.TARGET_HEIGHT: 1.0 if standing else 0.0,  # in units of the sigma of the label's height
        }
        gimbal = GimbalSigmas(
            heading=gimbal_heading, delay_s=gimbal_delay_s, vehicle_heading=heading, camera_delay_s=camera_delay_s
        )
        return ErrorPriors(
            pixel_noise_px=self.pixel_noise_px,
            attitude_noise=radians(self.attitude_noise_deg),
            position_noise_m=self.position_noise_m,
            height_noise_m=self.height_noise_m,
            bias_sigmas=tuple(sigmas[Bias(i)] for i in range(BIAS_COUNT)),
            gimbal=gimbal if on_gimbal else None,
            position_bias_time_s=UNKNOWN_TIMES_S[0]
            if self.position_bias_time_s == "auto"
            else self.position_bias_time_s,
            position_wander_times_s=UNKNOWN_TIMES_S if self.position_bias_time_s == "auto" else (),
        )

    @property
    def position_sigma_m(self) -> float:
        """One sigma of the horizontal position's bias where the receiver reports none, metres an axis."""
        return USUAL_POSITION_SIGMA_M if self.position_bias_m == "auto" else self.position_bias_m

    def _terrain_m(self, *, surveyed: bool) -> float:
        """One sigma of the ground's own height, metres. For an elevation model it is never 0, because the uncertainty
        of the model's shift is expressed in units of it.

        On level ground, a configured 4.0 (the model's default) is ignored: files that `init` wrote before ``auto`` have
        it for every ground, where it had no effect.
        """
        if not surveyed:
            return 0.0 if self.terrain_m in ("auto", MODEL_SIGMA_M) else float(self.terrain_m)
        return MODEL_SIGMA_M if self.terrain_m == "auto" else max(self.terrain_m, LEAST_MODEL_SIGMA_M)
