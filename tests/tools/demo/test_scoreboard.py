"""Scores of chosen lines: found, missed, beyond the claim, ghosts; and what `demo --json` makes of them."""

import json

import pytest
import report_lines

from fwav_companion.__main__ import main
from fwav_companion.geometry.earth import Geodetic, TangentPlane
from fwav_companion.tools.demo.flight import Demonstration, DemoResult, time_before_flight_s, troubles_of
from fwav_companion.tools.demo.scoreboard import Scoreboard

ORIGIN = {"lat": 48.0, "lon": 11.0, "alt_amsl": 500.0}
PLANE = TangentPlane(Geodetic.from_degrees(48.0, 11.0, 500.0))


def truth(**places):
    targets = []
    for label, (north, east) in places.items():
        place = PLANE.geodetic_from_ned((north, east, 0.0))
        where = {"lat": place.lat_deg, "lon": place.lon_deg, "alt_amsl": place.alt_amsl_m}
        targets.append({"label": f"tag36h11:{label[1:]}", **where})
    return [{"type": "header", "targets": targets}]


def target(number: int, north: float, east: float, state: str = "confirmed", track: int = 1):
    return report_lines.target(0.0, north, east, label=f"tag36h11:{number}", state=state, track=track)


def pictures(number: int, count: int, *, delivered: bool = True, usable: bool = True):
    return [{"delivered": delivered, "tags": [{"tag_id": number, "usable": usable}]}] * count


@pytest.fixture
def board() -> Scoreboard:
    board = Scoreboard()
    board.take_truth(truth(t7=(10.0, 5.0), t3=(0.0, 0.0)))
    board.take_targets([report_lines.header(origin=ORIGIN)])
    return board


def test_a_target_is_scored_against_its_own_truth(board: Scoreboard):
    board.take_targets([target(7, 10.3, 5.4), target(7, 11.0, 5.0, "dropped")])
    missing, score = board.scores()
    assert (missing.id, missing.found, missing.error_m) == (3, False, None)
    assert score.id == 7
    assert score.found
    assert score.state == "dropped"
    assert score.error_m == pytest.approx(0.5, abs=1e-6)  # of the last confirmed line, not of the end of the track
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


def test_seen_but_never_confirmed_is_not_found(board: Scoreboard):
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


def test_of_two_tracks_of_one_tag_one_is_a_ghost(board: Scoreboard):
    board.take_targets([target(3, 0.4, 0.0, track=1), target(3, 7.0, 0.0, track=2)])
    score = board.scores()[0]
    assert (score.found, score.ghosts) == (True, 1)
    assert score.error_m == pytest.approx(0.4, abs=1e-6)
    board.take_targets([target(3, 7.0, 0.0, "dropped", track=2)])
    assert board.scores()[0].ghosts == 0


def test_a_tag_that_was_lost_and_found_again_is_no_ghost(board: Scoreboard):
    board.take_targets([target(3, 0.4, 0.0, track=1), target(3, 0.4, 0.0, "dropped", track=1)])
    board.take_targets([target(3, 1.0, 0.0, track=2)])
    score = board.scores()[0]
    assert (score.found, score.ghosts, score.error_m) == (True, 0, pytest.approx(1.0, abs=1e-6))


def run_demo(monkeypatch, capsys, board, out):
    """(exit status, JSON object) of the command, whose flight gives these scores."""
    scores = board.scores()
    result = DemoResult(scores, troubles_of(scores, board.pictures), None, {}, [])
    monkeypatch.setattr(Demonstration, "fly", lambda *_: result)
    status = main(["demo", "--json", "--out", str(out)])
    return status, json.loads(capsys.readouterr().out.splitlines()[-1])


def test_json_of_a_success(board, monkeypatch, capsys, tmp_path):
    board.take_targets([target(7, 10.3, 5.4)])
    status, printed = run_demo(monkeypatch, capsys, board, tmp_path)
    assert (status, printed["ok"], printed["troubles"], printed["ghosts"]) == (0, True, [], 0)
    (only,) = printed["targets"]  # tag 3 was never readable
    assert only == {"id": 7, "found": True, "error_m": 0.5, "claimed95_m": 2.448, "usable_frames": 0}


def test_a_target_that_was_not_found_ends_with_status_1(board, monkeypatch, capsys, tmp_path):
    board.take_targets([target(7, 10.3, 5.4)])
    board.take_pictures(pictures(3, 10))
    status, printed = run_demo(monkeypatch, capsys, board, tmp_path)
    assert (status, printed["ok"]) == (1, False)
    assert printed["targets"][0] == {
        "id": 3, "found": False, "error_m": None, "claimed95_m": None, "usable_frames": 10
    }  # fmt: skip


@pytest.mark.parametrize(("error_m", "status"), [(3.6, 0), (3.8, 1)])
def test_an_error_beyond_the_claimed_999_promille_ends_with_status_1(
    error_m, status, board, monkeypatch, capsys, tmp_path
):
    """The 99.9 % radius of one metre of sigma is 3.717 m; 3.6 m is beyond the 95 % radius only."""
    board.take_targets([target(3, error_m, 0.0)])
    assert run_demo(monkeypatch, capsys, board, tmp_path)[0] == status


def test_a_flight_without_a_readable_tag_ends_with_status_1(board, monkeypatch, capsys, tmp_path):
    status, printed = run_demo(monkeypatch, capsys, board, tmp_path)
    assert (status, printed["ok"], printed["targets"]) == (1, False, [])


@pytest.mark.parametrize(("skipped", "named"), [(2, False), (9, True)])
def test_a_busy_machine_is_named_where_a_target_was_missed(board, skipped, named):
    board.take_pictures(pictures(3, 20) + pictures(3, skipped, delivered=False))
    first, *more = troubles_of(board.scores(), board.pictures)
    assert "tag 3 was readable in 20 pictures and was not found" in first
    expected = f"a busy machine skipped {skipped} of {20 + skipped} pictures: try again when it has less to do"
    assert more == [expected] * named
    board.take_targets([target(3, 0.0, 0.0)])
    assert troubles_of(board.scores(), board.pictures) == []


@pytest.mark.parametrize("delivered", [0, 16])
def test_where_no_tag_could_be_seen_the_busy_machine_alone_is_named(board, delivered):
    """Flying longer would not help: the tags were never looked for."""
    board.take_pictures(pictures(3, 216 - delivered, delivered=False) + pictures(3, delivered, usable=False))
    assert troubles_of(board.scores(), board.pictures) == [
        f"a busy machine skipped {216 - delivered} of 216 pictures: try again when it has less to do"
    ]


@pytest.mark.parametrize(("start_up_s", "before_s"), [(0.4, 3.0), (4.0, 12.0), (29.0, 30.0)])
def test_the_camera_gets_time_in_proportion_to_the_services_start(start_up_s, before_s):
    assert time_before_flight_s(start_up_s) == before_s
