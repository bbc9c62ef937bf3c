"""`demo --fleet`: the score against a known truth, and a whole flight."""

from __future__ import annotations

import json
from math import cos, radians

import pytest
from processes import process

from fwav_companion.__main__ import main
from fwav_companion.tools.demo.fleet_score import fleet_scores

LAT, LON = 48.1372, 11.5756
M_A_DEGREE = 111_194.0
TRUTH = {
    "origin": {"lat": LAT, "lon": LON, "alt_amsl": 519.0},
    "targets": [{"label": "person", "north": 10.0, "east": 0.0}, {"label": "person", "north": -10.0, "east": 5.0}],
}


def fused(north: float, east: float, **changes: object) -> dict[str, object]:
    """A fused target at this place, with an ellipse of 3 by 1 metres whose long axis points east."""
    return {
        "label": "person", "lat": LAT + north / M_A_DEGREE, "lon": LON + east / (M_A_DEGREE * cos(radians(LAT))),
        "ellipse": {"major_m": 3.0, "minor_m": 1.0, "bearing_deg": 90.0}, "vehicles": {"1": "3", "2": "1"}, **changes,
    }  # fmt: skip


def test_a_right_picture_has_no_trouble():
    scores, ghosts = fleet_scores(TRUTH, [fused(10.0, 1.5), fused(-10.0, 5.0)])
    assert [score.trouble for score in scores] == [None, None]
    assert ghosts == 0
    assert scores[0].error_m == pytest.approx(1.5, rel=0.01)
    assert scores[0].nis == pytest.approx((2.4477 * 1.5 / 3.0) ** 2, rel=0.02)  # along the long axis


@pytest.mark.parametrize(
    ("picture", "word"),
    [
        ([], "0 fused"),
        ([fused(10.0, 0.0), fused(11.0, 0.0)], "2 fused"),
        ([fused(12.5, 0.0)], "beyond its claimed"),  # across the ellipse
        ([fused(10.0, 0.0, vehicles={"1": "3"})], "seen by 1"),
    ],
)
def test_each_fault_is_named(picture, word):
    scores, _ = fleet_scores(TRUTH, picture)
    assert word in scores[0].trouble


def test_what_is_near_no_target_is_a_ghost():
    assert fleet_scores(TRUTH, [fused(40.0, 40.0), fused(10.0, 0.0, label="car")])[1] == 2


@pytest.mark.parametrize("number", ["1", "7", "-1"])
def test_a_fleet_of_another_size_is_one_line(number, capsys):
    assert main(["demo", "--fleet", number]) == 2
    assert "accepted: 2 to 6" in capsys.readouterr().err


@pytest.mark.slow
def test_three_vehicles_fly_and_every_target_is_fused_once(tmp_path):
    pytest.importorskip("zenoh")
    pytest.importorskip("aiohttp")
    with process("fwav_companion", "demo", "--fleet", "3", "--seconds", "30", "--json", folder=tmp_path) as demo:
        demo.wait_for("ground picture: http")
        status = demo.end(200.0)
    result = json.loads(demo.said.strip().splitlines()[-1])
    assert (status, result["ok"]) == (0, True), demo.said
    assert len(result["targets"]) == 5
    assert {len(target["vehicles"]) for target in result["targets"]} == {3}
