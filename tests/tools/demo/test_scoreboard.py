"""Judgements on lines that are made up: found, missed, beyond the claim."""

import pytest

from fwav_companion.geometry.earth import Geodetic, TangentPlane
from fwav_companion.tools.demo.scoreboard import Scoreboard

ORIGIN = {"lat": 48.0, "lon": 11.0, "alt_amsl": 500.0}
PLANE = TangentPlane(Geodetic.from_degrees(48.0, 11.0, 500.0))


def truth(**places):
    targets = []
    for label, (north, east) in places.items():
        place = PLANE.geodetic_from_ned((north, east, 0.0))
        told = {"lat": place.lat_deg, "lon": place.lon_deg, "alt_amsl": place.alt_amsl_m}
        targets.append({"label": f"tag36h11:{label[1:]}", **told})
    return [{"type": "header", "targets": targets}]


def target(number: int, north: float, east: float, state: str = "confirmed", sigma: float = 1.0):
    cov = [[sigma**2, 0, 0], [0, sigma**2, 0], [0, 0, 1]]
    return {"type": "target", "label": f"tag36h11:{number}", "state": state, "north": north, "east": east, "cov": cov}


def pictures(number: int, count: int, *, delivered: bool = True, usable: bool = True):
    return [{"delivered": delivered, "tags": [{"tag_id": number, "usable": usable}]}] * count


@pytest.fixture
def board() -> Scoreboard:
    board = Scoreboard()
    board.take_truth(truth(t7=(10.0, 5.0), t3=(0.0, 0.0)))
    board.take_targets([{"type": "header", "origin": ORIGIN}])
    return board


def test_a_target_is_scored_against_its_own_truth(board: Scoreboard):
    board.take_targets([target(7, 10.3, 5.4), target(7, 11.0, 5.0, "dropped")])
    missing, score = board.scores()
    assert (missing.id, missing.found, missing.error_m) == (3, False, None)
    assert score.id == 7
    assert score.found
    assert score.state == "dropped"
    assert score.error_m == pytest.approx(0.5, abs=1e-6)  # of what was believed last, not of the farewell
    assert score.claimed95_m == pytest.approx(2.4477, abs=1e-3)
    assert score.trouble is None


def test_only_what_was_readable_in_ten_delivered_pictures_has_to_be_found(board: Scoreboard):
    board.take_pictures(pictures(3, 9) + pictures(3, 50, delivered=False) + pictures(3, 50, usable=False))
    assert not board.scores()[0].due
    assert board.scores()[0].trouble is None
    board.take_pictures(pictures(3, 1))
    assert board.scores()[0].due
    assert "not found" in board.scores()[0].trouble
    assert board.pictures == {True: 60, False: 50}


def test_seen_but_never_believed_is_not_found(board: Scoreboard):
    board.take_pictures(pictures(3, 10))
    board.take_targets([target(3, 0.0, 0.0, "tentative")])
    score = board.scores()[0]
    assert (score.state, score.found) == ("tentative", False)
    assert score.trouble


def test_an_error_beyond_its_own_claim_is_trouble(board: Scoreboard):
    board.take_targets([target(3, 3.6, 0.0)])
    assert board.scores()[0].trouble is None  # beyond 95 %, which happens
    board.take_targets([target(3, 3.8, 0.0)])
    assert "3.80 m" in board.scores()[0].trouble
