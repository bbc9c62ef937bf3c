"""Places to what is printed and written: latitude, longitude, altitudes with datums, grids, ellipse, budget. PURE."""

from __future__ import annotations

from collections.abc import Sequence
from math import degrees, hypot, log, sqrt
from typing import Final

import msgspec

from fwav_companion.geometry.earth import TangentPlane
from fwav_companion.geometry.ellipses import NORMAL_95, circle_radius, ellipse_outline, semi_axes
from fwav_companion.geometry.geoid import Geoid
from fwav_companion.geometry.map_grid import utm_from_degrees
from fwav_companion.geometry.vectors import Matrix3
from fwav_companion.photographs.picture_pose import AltDatum
from fwav_companion.recording.summary_types import SharedErrorObject
from fwav_companion.tools.locate.shots import PixelPrediction, Place, SharedError, SharedEstimate, SightsEstimate
from fwav_companion.tools.locate.world import PictureWorld

SHARE: Final = 0.95
SCALE_95: Final = sqrt(-2.0 * log(1.0 - SHARE))
"""Semi-axes of the 95 % ellipse in sigmas: chi-square quantile with 2 degrees of freedom."""
CAUSES: Final = {
    "pixel": "the click",
    "own_position": "each picture's position and height",
    "own_attitude": "each picture's attitude",
    "shared_position": "the position that all pictures share",
    "shared_height": "the height that all pictures share",
    "mount": "the camera's alignment",
    "heading": "the heading",
    "focal": "the focal length",
    "ground": "the ground's height",
    "delay": "the delay of the video's telemetry",
}


class Sighted(msgspec.Struct, frozen=True, kw_only=True):
    """A target in one picture."""

    file: str
    u: float | None
    """Where the target should be by the answer, as viewers turn the picture; None outside the lens."""
    v: float | None
    sigmas: float
    """Distance of the click from it over its expected error."""


class ExpectedPixel(msgspec.Struct, frozen=True, kw_only=True):
    """Where a target should be in a picture without a click of it, as viewers turn the picture."""

    file: str
    u: float
    v: float
    outline: list[tuple[float, float]]
    """Pixels (u, v) of the 95 % ellipse."""


class PlaceAnswer(msgspec.Struct, frozen=True, kw_only=True):
    """The place of one target."""

    label: str
    lat: float
    lon: float
    alt_amsl: float | None
    """Metres above EGM96; None where the take-off's altitude is not known."""
    alt_takeoff: float | None
    """Metres above the take-off; None where that is not known."""
    alt_hae: float | None
    """Metres above the ellipsoid."""
    alt_datum: str
    """What the altitude that is known counts from: egm96 (``alt_amsl``), else takeoff (``alt_takeoff``)."""
    mgrs: str | None
    utm: str | None
    ellipse95_major_m: float
    ellipse95_minor_m: float
    ellipse95_bearing_deg: float
    radius95_m: float
    height95_m: float
    """Half of the 95 % interval of the altitude."""
    cov: Matrix3
    """North, east, down, m^2."""
    budget_m: dict[str, float]
    """One sigma of the horizontal position by cause."""
    dominant: str
    dominant_share: float
    outline: list[tuple[float, float]]
    """(latitude, longitude) of the 95 % ellipse."""
    pictures: list[Sighted]
    expected: list[ExpectedPixel] = []
    """In the other pictures, where asked for."""


class PlaceAnswers(msgspec.Struct, frozen=True, kw_only=True):
    """The answer of one call."""

    targets: list[PlaceAnswer]
    shared: list[SharedErrorObject]
    """Errors that all pictures share, as far as the sights show them."""
    assumed: list[str]
    contradiction: str = ""
    unverified: str = ""
    """What the pictures are too few to show about their errors."""
    error_scale: float = 1.0
    """The scale of the poses' errors to the assumed ones, by which the ellipses are."""

    @property
    def doubts(self) -> list[str]:
        """What the sights say against the claim, and what they cannot show."""
        return [line for line in (self.contradiction, self.unverified) if line]


def answers_from(estimate: SightsEstimate, world: PictureWorld, geoid: Geoid, assumed: Sequence[str]) -> PlaceAnswers:
    """The answers in the order of the targets."""
    return PlaceAnswers(
        targets=[_answer(place, world, geoid) for place in estimate.places],
        shared=[shared_error(each) for each in estimate.shared],
        assumed=list(dict.fromkeys(assumed)),
        contradiction=estimate.contradiction,
        unverified=estimate.unverified,
        error_scale=estimate.error_scale,
    )


def answer_lines(answer: PlaceAnswer) -> list[str]:
    """The answer for people."""
    heights = []
    if answer.alt_amsl is not None:
        heights.append(f"{answer.alt_amsl:.1f} m above sea level (EGM96)")
    if answer.alt_hae is not None:
        heights.append(f"{answer.alt_hae:.1f} m above the ellipsoid")
    if answer.alt_takeoff is not None:
        above = round(answer.alt_takeoff, 1) + 0.0  # never -0.0
        heights.append(f"{above:+.1f} m from the take-off")
    lines = [
        f"{answer.label}: {answer.lat:.7f}, {answer.lon:.7f}",
        f"  altitude {', '.join(heights)}; within {answer.height95_m:.1f} m (95 %)",
    ]
    if answer.mgrs is not None:
        lines.append(f"  MGRS {answer.mgrs}   UTM {answer.utm}")
    lines.append(
        f"  95 % ellipse: semi-axes {answer.ellipse95_major_m:.2f} m and {answer.ellipse95_minor_m:.2f} m, the longer "
        f"one to {answer.ellipse95_bearing_deg:.0f} deg; circle {answer.radius95_m:.2f} m"
    )
    lines.append(f"  largest error: {CAUSES[answer.dominant]} ({answer.dominant_share:.0%} of the variance)")
    if len(answer.pictures) > 1:
        lines += [f"  {each.file}: {each.sigmas:.1f} sigma from the answer" for each in answer.pictures]
    return lines


def shared_error(each: SharedEstimate) -> SharedErrorObject:
    """One shared error in its unit."""
    return SharedErrorObject(
        error=each.error.name.lower(),
        group=each.group,
        unit=_unit(each.error),
        value=_in_unit(each.error, each.value),
        sigma=_in_unit(each.error, each.sigma),
        prior_sigma=_in_unit(each.error, each.prior),
    )


def shared_line(shared: SharedErrorObject) -> str:
    """What the sights say about one shared error."""
    return (
        f"shared by all pictures: {shared.error} {shared.value:+.2f} {shared.unit} "
        f"(sigma {shared.sigma:.2f}, before {shared.prior_sigma:.2f})"
    )


def _answer(place: Place, world: PictureWorld, geoid: Geoid) -> PlaceAnswer:
    geodetic = world.plane.geodetic_from_ned(place.ned)
    lat, lon = geodetic.lat_deg, geodetic.lon_deg
    scale, height = world.scale, geodetic.alt_amsl_m
    takeoff = scale.takeoff_alt_m
    on_takeoff = scale.level is AltDatum.TAKEOFF
    amsl = (None if takeoff is None else height + takeoff) if on_takeoff else height
    above = height if on_takeoff else (None if takeoff is None else height - takeoff)
    larger, smaller, bearing = semi_axes(place.cov)
    grid = utm_from_degrees(lat, lon)
    dominant, share = place.budget.dominant()
    vertical = hypot(sqrt(place.cov[2][2]), scale.takeoff_sigma_m if on_takeoff and amsl is not None else 0.0)
    return PlaceAnswer(
        label=place.label,
        lat=lat,
        lon=lon,
        alt_amsl=amsl,
        alt_takeoff=above,
        alt_hae=None if amsl is None else amsl + geoid.undulation_m(lat, lon),
        alt_datum=(AltDatum.TAKEOFF if amsl is None else AltDatum.EGM96).value,
        mgrs=None if grid is None else grid.mgrs(),
        utm=None if grid is None else grid.text(),
        ellipse95_major_m=SCALE_95 * larger,
        ellipse95_minor_m=SCALE_95 * smaller,
        ellipse95_bearing_deg=degrees(bearing) % 180.0,
        radius95_m=circle_radius(place.cov, SHARE),
        height95_m=NORMAL_95 * vertical,
        cov=place.cov,
        budget_m=msgspec.structs.asdict(place.budget),
        dominant=dominant,
        dominant_share=share,
        outline=_outline(place, world.plane),
        pictures=[
            Sighted(
                file=world.shots[each.shot].name,
                u=None if each.pixel is None else each.pixel[0],
                v=None if each.pixel is None else each.pixel[1],
                sigmas=each.sigmas,
            )
            for each in place.residuals
        ],
        expected=[
            ExpectedPixel(
                file=world.shots[each.shot].name,
                u=each.pixel[0],
                v=each.pixel[1],
                outline=_pixel_outline(each),
            )
            for each in place.predictions
        ],
    )


def _outline(place: Place, plane: TangentPlane) -> list[tuple[float, float]]:
    corners = []
    for north, east in ellipse_outline(place.ned[0], place.ned[1], place.cov, SHARE):
        corner = plane.geodetic_from_ned((north, east, place.ned[2]))
        corners.append((corner.lat_deg, corner.lon_deg))
    return corners


def _pixel_outline(prediction: PixelPrediction) -> list[tuple[float, float]]:
    (uu, uv), (_, vv) = prediction.cov
    return ellipse_outline(*prediction.pixel, ((uu, uv, 0.0), (uv, vv, 0.0), (0.0, 0.0, 0.0)), SHARE)


def _unit(error: SharedError) -> str:
    if error is SharedError.FOCAL:
        return "%"
    if error is SharedError.DELAY:
        return "s"
    return "deg" if error >= SharedError.MOUNT_X else "m"


def _in_unit(error: SharedError, value: float) -> float:
    return value * {"%": 100.0, "deg": degrees(1.0), "m": 1.0, "s": 1.0}[_unit(error)]
