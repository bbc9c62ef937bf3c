"""Landmarks and the shift of an elevation model, in the report and on the terminal."""

import re
from io import StringIO

import pytest
from report_lines import Markup, header, summary, target

from fwav_companion.cli.replay import _print_summary
from fwav_companion.tools.report import flight_data, page
from fwav_companion.tools.report.map_drawing import flight_map

NORTH_DEG = 1.0 / 111_195.0
"""About a metre of latitude, degrees."""
SHOWN = (
    {"label": "tag36h11:0", "state": "used", "used": 90, "refused": 2, "off_m": 0.0},
    {"label": "pad", "state": "left_out", "used": 20, "refused": 9, "off_m": 1.84},
    {"label": "post", "state": "unseen", "used": 0, "refused": 0, "off_m": 0.0},
)


def flight():
    places = [
        {"label": each["label"], "lat": north * NORTH_DEG, "lon": 0.0, "alt_amsl": 0.0, "sigma_m": 0.05}
        for each, north in zip(SHOWN, (3.0, -4.0, 5.0), strict=True)
    ]
    origin = {"lat": 0.0, "lon": 0.0, "alt_amsl": 0.0}
    lines = [
        header(origin=origin, config={"landmark": places}), target(0.0, -8.0, -8.0), target(1.0, 8.0, 8.0, track=2),
        summary(landmarks=list(SHOWN), dropped_frames={}, dropped_detections={}),
    ]  # fmt: skip
    return flight_data(lines, title="")


def test_each_landmark_has_a_row_with_its_place_and_result():
    text = Markup(page(flight())).text
    for words in ("tag 0", "90", "used", "left out: it appears 1.8 m from its place", "not seen", "0.098 m"):
        assert words in text
    assert [round(each.north, 1) for each in flight().landmarks] == pytest.approx([3.0, -4.0, 5.0], abs=0.05)


def test_each_landmark_is_a_ring_on_the_map():
    drawn = flight_map(flight())
    rings = re.findall(r'class="landmark"', drawn)
    assert len(rings) == len(SHOWN)


def test_a_flight_without_landmarks_shows_no_table_of_them():
    shown = page(flight_data([header(), target(0.0, 1.0, 1.0), summary()], title=""))
    assert "landmark" not in shown[shown.index("<body>") :]


def test_the_terminal_has_a_line_for_each_landmark():
    out = StringIO()
    _print_summary(summary(landmarks=list(SHOWN), dropped_frames={}, dropped_detections={}), out)
    assert [line.strip() for line in out.getvalue().splitlines() if "landmark" in line] == [
        "landmark tag36h11:0: used (90 sights, 2 refused)",
        "landmark pad: left out: it appears 1.8 m from its place (20 sights, 9 refused)",
        "landmark post: not seen (0 sights)",
    ]


@pytest.mark.parametrize(
    ("shift", "text"),
    [
        (
            {"shift_m": 0.0, "sigma_m": 5.0, "source": "assumed"},
            "the model's own heights, since the take-off height is not known; a sigma of 5.0 m is in every claim",
        ),
        (
            {"shift_m": 2.0, "sigma_m": 2.0, "source": "standing"},
            "the model is shifted by +2.0 m, by standing; a sigma of 2.0 m is in every claim",
        ),
        ({"shift_m": -3.1, "sigma_m": 0.0, "source": "landing"}, "the model is shifted by -3.1 m, by landing"),
        (
            {"shift_m": 1.5, "sigma_m": 0.4, "source": "landmark"},
            "the model is shifted by +1.5 m, by landmark; its sigma of 0.4 m is in every claim since",
        ),
    ],
)
def test_the_shift_of_an_elevation_model_is_named(shift, text):
    out = StringIO()
    _print_summary(summary(terrain=shift, dropped_frames={}, dropped_detections={}), out)
    assert f"terrain: {text}" in out.getvalue()
    lines = [header(), target(0.0, 1.0, 1.0), summary(terrain=shift)]
    assert text in Markup(page(flight_data(lines, title=""))).text
