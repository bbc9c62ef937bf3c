"""Pictures with RTK: a barometer's error is one of the take-off below them, and not of what they see from two sides."""

from __future__ import annotations

from pathlib import Path

import pytest

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
