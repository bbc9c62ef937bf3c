"""The height by a ground model and by the size of a tag, together.

A reported height h_g errs by a slow error b and by noise n, a height by size h_t by noise m and by a scale s (of the
print and of the lens), the same in every picture:

    h_g = h + b + n,    h_t = h (1 + s) + m

Kalman filter of b: a random walk, measured by h_g - h_t. The height of a picture is the mean of h_g - b and h_t,
weighted by their variances: of a tag far away nearly h_g - b, of a near one h_t.
"""

from __future__ import annotations

from math import sqrt
from typing import Final

import msgspec

from fwav_companion.geometry.stamps import HostNs, s_from_ns
from fwav_companion.geometry.vectors import Vector3
from fwav_companion.localization.covariance import noise_variances
from fwav_companion.localization.ground import (
    LEVEL_NORMAL,
    Intersection,
    camera_above_flat,
    flat_distance,
    lowered,
)
from fwav_companion.types import Bias, ErrorPriors, NoFix, Reason, Sighting, SizeHeight

WITHOUT_HEIGHT: Final = frozenset({Reason.NO_HEIGHT, Reason.NO_RANGE, Reason.RANGE_TILTED})
"""Refusals of a ground model that does not know the height: a tag's size may show it."""
DRIFT2_M2_S: Final = 0.05**2
"""Growth of the variance of a reported height's error, m^2/s: a barometer moves by 0.2 m in a quarter of a minute."""


class FusedHeight(msgspec.Struct, frozen=True, gc=False, kw_only=True):
    """Height of the camera above the detected point by both measurements."""

    height_m: float
    noise_m: float
    """One sigma that is independent in every picture, metres."""
    bias_m: float
    """One sigma of what pictures share, metres."""
    too_high_m: float
    """Reported minus best height over the pictures so far, metres."""


class HeightError(msgspec.Struct, frozen=True, gc=False):
    """Error of the reported height over one target: reported minus true, metres, and its variance."""

    error_m: float
    variance: float
    host_ns: HostNs


class SizeHeights:
    """Errors of the reported height, one for each label whose tags have a known size."""

    def __init__(self, priors: ErrorPriors) -> None:
        self._priors = priors
        self._errors: dict[str, HeightError] = {}

    def meet(
        self, sighting: Sighting, direction: Vector3, meeting: Intersection | NoFix, *, size: SizeHeight
    ) -> tuple[Intersection | NoFix, FusedHeight | None]:
        """The intersection at the height by the ground model and by a tag's size; by the size alone where the model
        has no height. An elevation model's stays: its error is in the ground's shape, too.

        The camera is lowered by what it is reported too high, so that the intersection is on the model's ground.
        """
        if isinstance(meeting, NoFix):
            return _by_size_alone(sighting, direction, meeting, size)
        if meeting.normal is not LEVEL_NORMAL or meeting.surveyed:
            return meeting, None
        noise_m2 = noise_variances(sighting, meeting, self._priors).height
        own_m = sighting.state.height_bias_m if meeting.ground == "home" else None
        fused = self.fused(
            sighting.detection.label,
            sighting.host_ns,
            size,
            ground_m=meeting.height_m,
            noise_m2=noise_m2,
            bias_m2=(self._priors.sigma(Bias.HEIGHT) if own_m is None else own_m) ** 2,
        )
        at_height = lowered(meeting, meeting.height_m - fused.height_m)
        return msgspec.structs.replace(at_height, height_noise_m=fused.noise_m), fused

    def fused(
        self, label: str, host_ns: HostNs, size: SizeHeight, *, ground_m: float, noise_m2: float, bias_m2: float
    ) -> FusedHeight:
        """The height of a picture. ``ground_m``: by the ground model, with the variances of its noise and bias."""
        known = self._errors.get(label)
        if known is None:
            error_m, variance = 0.0, bias_m2
        else:
            error_m = known.error_m
            variance = known.variance + DRIFT2_M2_S * max(0.0, s_from_ns(host_ns - known.host_ns))
        scale_m2, size_noise_m2 = (size.scale_sigma * size.height_m) ** 2, size.noise_m**2
        by_ground_m2, by_size_m2 = variance + noise_m2, size_noise_m2 + scale_m2
        ground_share = by_size_m2 / (by_ground_m2 + by_size_m2)
        size_share = 1.0 - ground_share
        innovation_m = ground_m - size.height_m - error_m
        height_m = ground_m - error_m - size_share * innovation_m
        gain = variance / (by_ground_m2 + by_size_m2)
        error_m += gain * innovation_m
        self._errors[label] = HeightError(error_m, variance * (1.0 - gain), host_ns)
        return FusedHeight(
            height_m=height_m,
            noise_m=sqrt(ground_share**2 * noise_m2 + size_share**2 * size_noise_m2),
            bias_m=sqrt(ground_share**2 * variance + size_share**2 * scale_m2),
            too_high_m=error_m,
        )


def _by_size_alone(
    sighting: Sighting, direction: Vector3, refusal: NoFix, size: SizeHeight
) -> tuple[Intersection | NoFix, FusedHeight | None]:
    """The intersection where the ground model has no height, or its refusal."""
    distance_m = refusal if refusal.reason not in WITHOUT_HEIGHT else flat_distance(direction, size.height_m)
    if isinstance(distance_m, NoFix):
        return distance_m, None
    by_size = Intersection(
        camera_above_flat(sighting, size.height_m),
        distance_m,
        size.height_m,
        "size",
        moves_with_camera=True,
        height_noise_m=size.noise_m,
    )
    bias_m = size.scale_sigma * size.height_m
    return by_size, FusedHeight(height_m=size.height_m, noise_m=size.noise_m, bias_m=bias_m, too_high_m=0.0)
