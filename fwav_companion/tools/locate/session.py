"""SHELL: pictures and options to a world of cameras, and clicks in it to answers.

:class:`LocateSession` is opened once and asked many times: by the command once, by the page after every click.
"""

from __future__ import annotations

from collections.abc import Sequence
from math import isnan
from pathlib import Path

import msgspec

from fwav_companion.errors import InputFileError
from fwav_companion.geoid import egm96
from fwav_companion.geometry.geoid_file import GtxGeoid
from fwav_companion.localization import ElevationModel
from fwav_companion.service.elevation_files import read_elevation
from fwav_companion.tools.locate.answers import PlaceAnswer, PlaceAnswers, answers_from
from fwav_companion.tools.locate.clicks import PictureClick, by_file, require_inside
from fwav_companion.tools.locate.estimate import SightError, locate
from fwav_companion.tools.locate.heights import VerticalOptions, vertical_scale
from fwav_companion.tools.locate.photographs import Photograph
from fwav_companion.tools.locate.shots import Sight
from fwav_companion.tools.locate.world import Configured, PictureWorld, PosedPicture, make_world
from fwav_companion.types import Pixel

CLICK_SIGMA_PX = 2.0
"""One sigma of a click on the same point of a thing, each axis, pixels."""
REASONS = {
    "outside_lens": "the lens has no ray there",
    "above_horizon": "it is above the horizon",
    "near_horizon": "it is too near the horizon: within three sigmas of the camera's tilt",
    "too_low": "the camera would be below the ground; check the altitudes and their datums",
    "beyond_terrain": "the elevation model ends before the ray meets the ground; give the neighbouring files, too",
    "two_grounds": "an edge of the elevation model lies within the error: it may be before or behind it",
    "no_terrain": "the ray meets a void of the elevation model that is too wide to be filled",
}


class LocateOptions(msgspec.Struct, frozen=True, kw_only=True):
    """What the user says about ground and altitudes."""

    terrain: tuple[Path, ...] = ()
    terrain_datum: str = "egm96"
    egm2008: GtxGeoid | None = None
    """Undulations of EGM2008, for elevation models above it; None: 0.6 m between both geoids."""
    takeoff: tuple[float, float] | None = None
    """Latitude and longitude of the take-off, for its altitude by the elevation model."""
    vertical: VerticalOptions = VerticalOptions()
    configured: Configured = Configured()


class NoAnswer(msgspec.Struct, frozen=True):
    """The reason why a click has no place on the map."""

    file: str
    pixel: tuple[float, float]
    reason: str
    """A key of REASONS."""

    @property
    def line(self) -> str:
        """One line for the user."""
        return f"{self.file}: pixel {self.pixel[0]:g}, {self.pixel[1]:g}: {self.reason}: {REASONS[self.reason]}"


class LocateSession:
    """Pictures with their ground: asks for the places of clicks."""

    def __init__(self, photographs: Sequence[Photograph], options: LocateOptions) -> None:
        """InputFileError where the pictures' altitudes do not fit the ground, with what to give."""
        self.photographs = tuple(photographs)
        self._index = by_file([photograph.path.name for photograph in photographs])
        geoid = egm96()
        tiles = read_elevation(options.terrain)
        model = ElevationModel(tiles) if tiles else None
        vertical = msgspec.structs.replace(options.vertical, has_terrain=model is not None)
        if options.takeoff is not None:
            vertical = _with_takeoff(vertical, options.takeoff, model)
        names = [photograph.path.name for photograph in photographs]
        scale = vertical_scale(names, [photograph.pose for photograph in photographs], geoid, vertical)
        pictures = [
            PosedPicture(photograph.path.name, photograph.pose, photograph.lens, photograph.focal_sigma)
            for photograph in photographs
        ]
        self.world: PictureWorld = make_world(
            pictures,
            scale,
            geoid,
            elevation=model,
            terrain_datum=next((tile.datum for tile in tiles if tile.datum), options.terrain_datum),
            configured=options.configured,
            egm2008=options.egm2008,
        )
        self._geoid = geoid
        notes = [f"pose by {photograph.pose.layout} tags" for photograph in photographs]
        notes += [note for photograph in photographs for note in photograph.notes]
        self.assumed = list(dict.fromkeys([*notes, *scale.notes, self.world.ground_claim]))

    def located(
        self, clicks: Sequence[PictureClick], sigma_px: float = CLICK_SIGMA_PX, *, expected: bool = False
    ) -> PlaceAnswers | NoAnswer:
        """The places of all labels. InputFileError for a click in no picture, or outside of its picture.

        ``expected``: also where each target should be in the pictures without a click of it.
        """
        sights = []
        for click in clicks:
            index = self._index.get(click.file)
            if index is None:
                raise InputFileError(
                    f"{click.file}: not among the pictures; accepted: {', '.join(list(self._index)[:5])}"
                )
            photograph = self.photographs[index]
            require_inside(click, photograph.viewed_size)
            sights.append(Sight(index, photograph.stored_pixel(click.pixel), click.label, sigma_px))
        estimate = locate(self.world.shots, sights, self.world.surface, self.world.shared_sigmas, predicted=expected)
        if isinstance(estimate, SightError):
            photograph = self.photographs[estimate.sight.shot]
            pixel = photograph.viewed_pixel(estimate.sight.pixel)
            return NoAnswer(photograph.path.name, pixel, estimate.reason)
        answers = answers_from(estimate, self.world, self._geoid, self.assumed)
        return msgspec.structs.replace(answers, targets=[self._viewed(answer) for answer in answers.targets])

    def _viewed(self, answer: PlaceAnswer) -> PlaceAnswer:
        pictures = [
            each
            if each.u is None or each.v is None
            else msgspec.structs.replace(each, **self._turned(each.file, [(each.u, each.v)])[0])
            for each in answer.pictures
        ]
        expected = []
        for other in answer.expected:
            width, height = self._photograph(other.file).viewed_size
            place, *outline = self._turned(other.file, [(other.u, other.v), *other.outline])
            if -0.5 <= place["u"] <= width - 0.5 and -0.5 <= place["v"] <= height - 0.5:
                corners = [(corner["u"], corner["v"]) for corner in outline]
                expected.append(msgspec.structs.replace(other, **place, outline=corners))
        return msgspec.structs.replace(answer, pictures=pictures, expected=expected)

    def _photograph(self, file: str) -> Photograph:
        return self.photographs[self._index[file]]

    def _turned(self, file: str, pixels: Sequence[Pixel]) -> list[dict[str, float]]:
        viewed = map(self._photograph(file).viewed_pixel, pixels)
        return [{"u": u, "v": v} for u, v in viewed]


def _with_takeoff(
    vertical: VerticalOptions, takeoff: tuple[float, float], model: ElevationModel | None
) -> VerticalOptions:
    if model is None:
        raise InputFileError("--takeoff: it needs --terrain FILE; accepted without: --takeoff-alt M")
    height = model.height_m(*takeoff)
    if isnan(height):
        raise InputFileError(f"--takeoff {takeoff[0]:g},{takeoff[1]:g}: outside the elevation model, or a void")
    return msgspec.structs.replace(vertical, takeoff_alt_m=height, takeoff_sigma_m=0.0)
