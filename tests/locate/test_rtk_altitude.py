"""Pictures with RTK: a barometer's error is one of the take-off below them, and not of what they see from two sides."""

from __future__ import annotations

import struct
from pathlib import Path

import numpy as np
import pytest

from fwav_companion.geoid import egm96
from fwav_companion.geometry.geoid_file import GtxGeoid
from fwav_companion.tools.locate.answers import PlaceAnswers
from fwav_companion.tools.locate.clicks import PictureClick
from fwav_companion.tools.locate.photographs import CameraOptions, read_photographs
from fwav_companion.tools.locate.session import LocateOptions, LocateSession
from tests.support.clicked_pictures import write_set


def test_altitude_of_a_target_seen_from_four_sides_has_no_barometer_in_it(tmp_path: Path) -> None:
    pictures = write_set(tmp_path)
    session = LocateSession(read_photographs([path for path, _ in pictures], CameraOptions()), LocateOptions())
    clicks = [PictureClick(path.name, seen["car"], "car") for path, seen in pictures]
    answers, one = session.located(clicks, 0.5), session.located(clicks[:1], 0.5)
    assert isinstance(answers, PlaceAnswers)
    assert isinstance(one, PlaceAnswers)
    assert answers.targets[0].alt_amsl == pytest.approx(400.0, abs=0.2)
    assert answers.targets[0].height95_m < 2.0
    assert one.targets[0].height95_m > 1.96 * 4.9  # relief of 4 m and the barometer's 3 m


def test_elevation_model_above_egm2008_with_its_geoid_is_brought_to_egm96(tmp_path: Path) -> None:
    """A model that counts from a geoid 1.5 m above EGM96's: its ground is 1.5 m higher above EGM96."""
    (path, seen), *_ = write_set(tmp_path)
    names = ("N46E010", "N46E011", "N47E010", "N47E011")
    for name in names:
        np.full((5, 5), 400, dtype=">i2").tofile(tmp_path / f"{name}.hgt")
    n96 = egm96().undulation_m(47.0, 11.0)
    grid = struct.pack(">ddddii", 40.0, 5.0, 10.0, 10.0, 2, 2) + np.full(4, n96 + 1.5, ">f4").tobytes()
    tiles = tuple(tmp_path / f"{name}.hgt" for name in names)
    answers = {}
    for geoid in (None, GtxGeoid(grid)):
        options = LocateOptions(terrain=tiles, terrain_datum="egm2008", egm2008=geoid)
        found = LocateSession(read_photographs([path], CameraOptions()), options).located(
            [PictureClick(path.name, seen["car"], "car")], 0.5
        )
        assert isinstance(found, PlaceAnswers), found
        answers[geoid is not None] = found.targets[0]
    assert answers[False].alt_amsl == pytest.approx(400.0, abs=0.1)
    assert answers[True].alt_amsl == pytest.approx(401.5, abs=0.1)
    assert answers[True].height95_m < answers[False].height95_m  # without 0.6 m between two geoids
