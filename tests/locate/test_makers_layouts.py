"""A picture of each maker's layout is located where the truth is, to the claim: no more and no less."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path

import numpy as np
import pymap3d
import pytest
from scipy.spatial.transform import Rotation
from scipy.stats import binom, chi2

from fwav_companion.photographs.picture_pose import AltDatum
from fwav_companion.tools.locate.answers import PlaceAnswer, PlaceAnswers
from fwav_companion.tools.locate.clicks import PictureClick
from fwav_companion.tools.locate.heights import VerticalOptions
from fwav_companion.tools.locate.photographs import CameraOptions, read_photographs
from fwav_companion.tools.locate.session import LocateOptions, LocateSession
from sitl_mock.maker_tags import LAYOUTS, TruePicture
from tests.support.maker_pictures import (
    FORWARD_CAMERA,
    HEIGHT,
    WIDTH,
    ned_from_camera,
    pixel_of,
    place_below,
    true_picture,
    write_picture,
)

GROUND_M = 400.0
"""Altitude of the ground of all draws."""
BY_GROUND = ("parrot", "skydio", "teal", "sensefly", "wingtra")
"""Layouts without a height above the take-off."""


def ask(path: Path, pixel: tuple[float, float], layout: str) -> PlaceAnswer:
    given = VerticalOptions(ground_alt_m=GROUND_M) if layout in BY_GROUND else VerticalOptions()
    if layout == "wingtra":  # the tags do not state the datum
        given = VerticalOptions(ground_alt_m=GROUND_M, alt_datum=AltDatum.ELLIPSOID)
    photographs = read_photographs([path], CameraOptions(), as_stated=True)
    answers = LocateSession(photographs, LocateOptions(vertical=given)).located(
        [PictureClick(path.name, pixel, "t")], 1.0
    )
    assert isinstance(answers, PlaceAnswers), answers
    return answers.targets[0]


def error_ned(answer: PlaceAnswer, lat: float, lon: float, above_takeoff: float) -> np.ndarray:
    north, east, _ = pymap3d.geodetic2ned(answer.lat, answer.lon, GROUND_M, lat, lon, GROUND_M)
    height = answer.alt_takeoff if answer.alt_datum == "takeoff" else answer.alt_amsl - GROUND_M
    return np.array([north, east, above_takeoff - height])


@pytest.mark.parametrize("layout", LAYOUTS)
def test_locate_exact_tags_gives_the_true_place(layout: str, tmp_path: Path) -> None:
    rng = np.random.default_rng(7)
    for number in range(8):
        picture = true_picture(rng)
        pixel = (float(rng.uniform(0, WIDTH - 1)), float(rng.uniform(0.3 * HEIGHT, HEIGHT - 1)))
        lat, lon, _ = place_below(picture, *pixel)
        path = write_picture(tmp_path / f"{number}.jpg", layout, picture)
        answer = ask(path, pixel, layout)
        assert np.linalg.norm(error_ned(answer, lat, lon, 0.0)) < 0.05  # the tags have 0.001 degrees
        assert answer.ellipse95_major_m > 1.0
        if layout in (*BY_GROUND, "dji_rtk"):  # a wrong sign of the undulation is wrong by twice the undulation
            assert answer.alt_amsl == pytest.approx(GROUND_M, abs=0.05)
            assert answer.alt_hae == pytest.approx(GROUND_M + picture.undulation, abs=0.05)
        else:
            assert (answer.alt_amsl, answer.alt_hae) == (None, None)


SIGMAS = {  # own position, shared position, own height, shared height, heading, focal; own tilt, mount
    "dji_consumer": (1.0, 2.0, 1.0, 3.0, 3.0, 0.04, 0.3, 0.5),
    "dji_consumer_old": (1.0, 2.0, 1.0, 3.0, 3.0, 0.01, 0.3, 0.5),
    "dji_rtk": (0.01314, 0.03, 1.0, 3.0, 1.0, 0.003, 0.3, 0.5),
    "autel_new": (1.0, 3.0, 1.0, 3.0, 3.0, 0.01, 0.5, 1.0),
    "autel_old": (1.0, 3.0, 1.0, 3.0, 3.0, 0.04, 0.5, 1.0),
    "parrot": (1.0, 2.0, 1.0, 5.0, 1.5, 0.04, 0.3, 0.5),
    "skydio": (1.0, 2.0, 1.0, 5.0, 1.5, 0.01, 0.3, 0.5),
    "teal": (1.0, 2.0, 1.0, 5.0, 3.0, 0.04, 0.3, 0.5),
    "sensefly": (1.0, 2.0, 2.0, 2.0, 3.0, 0.04, 0.3, 0.5),
    "wingtra": (1.0, 2.0, 1.0, 5.0, 3.0, 0.04, 0.3, 0.5),
}
"""The errors that the documentation states for each source, in metres, degrees and parts."""


def as_measured(rng: np.random.Generator, truth: TruePicture, layout: str) -> TruePicture:
    """The pose that the drone believes: the truth with errors drawn from the stated ones."""
    own, shared, own_h, shared_h, heading, _, tilt, mount = SIGMAS[layout]
    north, east = rng.normal(size=2) * np.hypot(own, shared)
    up = rng.normal() * np.hypot(own_h, shared_h)
    lat, lon, _ = pymap3d.ned2geodetic(north, east, 0.0, truth.lat, truth.lon, truth.ellipsoid)
    turn = Rotation.from_rotvec(np.radians(rng.normal(size=3) * np.hypot(tilt, mount)))
    about_down = Rotation.from_euler("z", rng.normal() * heading, degrees=True)
    gimbal = about_down * Rotation.from_matrix(ned_from_camera(truth)) * turn * Rotation.from_matrix(FORWARD_CAMERA.T)
    yaw, pitch, roll = gimbal.as_euler("ZYX", degrees=True)
    return replace(
        truth, lat=float(lat), lon=float(lon), alt_amsl=truth.alt_amsl + up, roll=roll, pitch=pitch, yaw=yaw,
        above_takeoff=truth.above_takeoff + up,
    )  # fmt: skip


@pytest.mark.slow
@pytest.mark.parametrize("layout", LAYOUTS)
def test_locate_drawn_errors_are_within_the_claim(layout: str, tmp_path: Path) -> None:
    """300 drawn poses: normalised squares and coverage within their 99.9 % bounds."""
    rng = np.random.default_rng(20)
    squares = []
    path = tmp_path / "a.jpg"
    while len(squares) < 300:
        truth = true_picture(rng, pitch=float(rng.uniform(-89, -45)))
        truth = replace(truth, focal_px=truth.focal_px * (1.0 + SIGMAS[layout][5] * rng.normal()))
        relief = rng.normal() * max(4.0, 0.05 * truth.above_takeoff)
        lat, lon, alt = place_below(
            truth, float(rng.uniform(0, WIDTH)), float(rng.uniform(0.2 * HEIGHT, HEIGHT)), above_takeoff=relief
        )
        pixel = tuple(np.array(pixel_of(truth, lat, lon, alt)) + rng.normal(size=2))
        if not (0 <= pixel[0] < WIDTH - 1 and 0 <= pixel[1] < HEIGHT - 1):
            continue
        measured = replace(as_measured(rng, truth, layout), focal_px=4000 * 24 / 36)
        answer = ask(write_picture(path, layout, measured), pixel, layout)
        error = error_ned(answer, lat, lon, relief)
        cov = np.array(answer.cov)[:2, :2]
        squares.append(float(error[:2] @ np.linalg.inv(cov) @ error[:2]))
    total, inside = sum(squares), sum(square < chi2.ppf(0.9, 2) for square in squares)
    assert chi2.ppf(0.0005, 600) < total < chi2.ppf(0.9995, 600)
    assert binom.ppf(0.0005, 300, 0.9) <= inside <= binom.ppf(0.9995, 300, 0.9)
