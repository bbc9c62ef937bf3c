"""Plan of a study: the configuration, the lens, and how flights are drawn. A worker needs nothing else. PURE."""

from __future__ import annotations

import hashlib
from collections.abc import Iterable
from functools import lru_cache
from typing import Final, Literal, TypeAlias

import msgspec
import numpy as np

from fwav_companion.camera import KannalaBrandt
from fwav_companion.config import Config, parse
from fwav_companion.errors import UserError
from fwav_companion.tools.study.keys import Variation, claim_settings, toml_text, truth_settings
from fwav_companion.types import Lens, NoRay

Pattern: TypeAlias = Literal["eight", "hover", "orbit", "survey", "straight"]
PATTERNS: Final = ("eight", "hover", "orbit", "survey", "straight")
ON_BY_DEFAULT: Final = "tracking.self_calibration"
AZIMUTHS: Final = 16
"""Directions over which the image radius of a lens is averaged."""
ANGLES: Final = 60
"""Angles from the axis at which the radius is fitted."""


class RadialLens(msgspec.Struct, frozen=True):
    """The radially symmetric part of a lens, which mock and pipeline both use: the model of Kannala and Brandt."""

    k_mm: tuple[float, float, float, float, float]
    pixels_per_mm: tuple[float, float]
    principal_point: tuple[float, float]
    image_size: tuple[int, int]
    max_angle: float
    """Largest angle from the axis, radians."""
    exact: bool = True
    """Whether this is the configured lens; otherwise its tangential or skewed part is left out."""

    @property
    def lens(self) -> KannalaBrandt:
        """The lens in the form for the pipeline."""
        return KannalaBrandt(
            self.k_mm, self.pixels_per_mm, self.principal_point, self.image_size, max_angle=self.max_angle
        )


class StudyPlan(msgspec.Struct, frozen=True, kw_only=True):
    """One study of simulated flights."""

    config: str
    """Text of the configuration file, TOML."""
    config_name: str
    """Name of the configuration file, as the user gave it."""
    lens: RadialLens
    flights: int
    seconds: float
    pattern: Pattern
    seed: int
    settings: tuple[tuple[str, str], ...] = ()
    """Key and value of each --set."""
    variations: tuple[Variation, ...] = ()
    preset: Literal["", "paper"] = ""

    @property
    def digest(self) -> str:
        """Identifier of studies whose flights of the same index are equal: it covers all but the number of flights."""
        return hashlib.sha256(msgspec.json.encode(msgspec.structs.replace(self, flights=0))).hexdigest()[:16]

    @property
    def asks_for_calibration(self) -> bool:
        """Whether a --set switches self-calibration on or off."""
        return any(key.endswith(ON_BY_DEFAULT) for key, _ in self.settings)

    @property
    def switches_calibration_on(self) -> bool:
        """Whether flights are replayed with self-calibration although the configuration has it off."""
        return not (self.asks_for_calibration or self.parsed(()).tracking.self_calibration)

    def claim_settings(self, more: Iterable[tuple[str, str]] = ()) -> tuple[str, ...]:
        """The ``KEY=VALUE`` of a flight's replay. Self-calibration is on unless --set has it off.

        All labels of the mock count, and an elevation model becomes an uncertainty of its level ground.
        """
        own = () if self.asks_for_calibration else ((ON_BY_DEFAULT, "true"),)
        chosen = (*claim_settings((*own, *self.settings, *more)), "detections.min_score=0.0", "detections.labels=[]")
        sigma_m = terrain_sigma_m(self.parsed(chosen))
        if not sigma_m:
            return chosen
        return (*chosen, "ground.model=home", "ground.terrain=[]", f"uncertainty.terrain_m={sigma_m!r}")

    def truth(self, more: Iterable[tuple[str, str]] = ()) -> Config:
        """The configuration by which flights are drawn."""
        return self.parsed(tuple(truth_settings((*self.settings, *more))))

    def parsed(self, settings: tuple[str, ...]) -> Config:
        """The configuration with these settings. ConfigError."""
        return _parsed(self.config, self.config_name, settings)

    def require_possible(self) -> None:
        """Raise ConfigError or UserError unless every flight can be flown: the ends of each variation are tried."""
        for variation in self.variations:
            for example in variation.examples:
                more = ((variation.key, toml_text(example)),)
                self.parsed(self.claim_settings(more))
                self.truth(more)
        config = self.parsed(self.claim_settings())
        if config.tracking.is_own_filter:
            raise UserError(f"{self.config_name}: [tracking] filter: a study flies kalman and lowpass only")
        if config.vehicle.position == "none":
            raise UserError(f'{self.config_name}: [vehicle] position = "none": a study needs a vehicle with a position')


def terrain_sigma_m(config: Config) -> float:
    """One sigma of an elevation model, metres; 0 without one. On level ground a stated 4.0 counts as none."""
    if config.ground.model != "terrain":
        return 0.0
    return 4.000001 if config.uncertainty.terrain_m in ("auto", 4.0) else float(config.uncertainty.terrain_m)


@lru_cache(maxsize=16)
def _parsed(text: str, name: str, settings: tuple[str, ...]) -> Config:
    return parse(text, name, settings)


def radial_lens(lens: Lens) -> RadialLens:
    """The lens by its image radius over the angle from the axis, averaged over all directions."""
    if isinstance(lens, KannalaBrandt) and lens.skew == 0.0:
        return RadialLens(lens.k_mm, lens.pixels_per_mm, lens.principal_point, lens.image_size, lens.max_angle)
    centre, focal, largest = _centre(lens), _focal(lens), _largest_angle(lens)
    angles = np.linspace(largest / ANGLES, largest, ANGLES)
    radii = np.array([_radius(lens, angle, centre, focal) for angle in angles])
    seen = np.isfinite(radii)
    powers = angles[seen, None] ** np.arange(1, 10, 2)
    k, *_ = np.linalg.lstsq(powers, radii[seen], rcond=None)
    k1, k2, k3, k4, k5 = k.tolist()
    return RadialLens((k1, k2, k3, k4, k5), focal, centre, lens.image_size, float(angles[seen][-1]), exact=False)


def _pixel(lens: Lens, angle: float, azimuth: float) -> tuple[float, float]:
    across = np.sin(angle)
    point = (float(across * np.cos(azimuth)), float(across * np.sin(azimuth)), float(np.cos(angle)))
    pixel = lens.pixel_from_camera_point(point)
    return (np.nan, np.nan) if isinstance(pixel, NoRay) else pixel


def _centre(lens: Lens) -> tuple[float, float]:
    return _pixel(lens, 0.0, 0.0)


def _focal(lens: Lens) -> tuple[float, float]:
    """Pixels per radian on the axis, u and v."""
    (u0, v0), step = _centre(lens), 1e-4
    return (_pixel(lens, step, 0.0)[0] - u0) / step, (_pixel(lens, step, np.pi / 2.0)[1] - v0) / step


def _largest_angle(lens: Lens) -> float:
    """Angle of the corner that is farthest from the axis, or the end of the valid range, radians."""
    width, height = lens.image_size
    rays = [lens.camera_ray_from_pixel(u, v) for u in (0.0, width - 1.0) for v in (0.0, height - 1.0)]
    corners = [float(np.arccos(np.clip(ray[2], -1.0, 1.0))) for ray in rays if not isinstance(ray, NoRay)]
    return max(corners, default=lens.max_angle)


def _radius(lens: Lens, angle: float, centre: tuple[float, float], focal: tuple[float, float]) -> float:
    pixels = [_pixel(lens, angle, 2.0 * np.pi * k / AZIMUTHS) for k in range(AZIMUTHS)]
    radii = [float(np.hypot((u - centre[0]) / focal[0], (v - centre[1]) / focal[1])) for u, v in pixels]
    return float(np.nanmean(radii)) if np.isfinite(radii).any() else float("nan")
