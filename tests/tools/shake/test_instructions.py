"""The instructions to the person, second by second."""

from math import cos, degrees, pi, sin

import pytest

from fwav_companion.tools.shake.instructions import Instructor, ShakeInputs, ShakePhase

READY = {"autopilot": True, "attitude_hz": 100.0, "clock_known": True, "frames": 9}


class Session:
    """Some seconds of a session with a person who moves as chosen."""

    def __init__(self, wait_s=10.0):
        self.guide, self.now_s, self.tags = Instructor(wait_s), 0.0, 0

    def seconds(self, seconds, *, tag=True, heading=0.5, swing=0.3, **what):
        for _ in range(round(seconds * 5)):
            self.now_s += 0.2
            self.tags += 6 * tag
            attitude = (swing * sin(6.0 * self.now_s), swing * cos(5.0 * self.now_s), heading)
            moment = ShakeInputs(now_s=self.now_s, tags=self.tags, attitude=attitude, **{**READY, **what})
            advice = self.guide.instruct(moment)
        return advice


MISSING = {
    "link": ({"closed": "link autopilot: Address already in use"}, "already in use"),
    "autopilot": ({"autopilot": False}, "no autopilot"),
    "attitude": ({"attitude_hz": 0.0}, "no attitude comes"),
    "slow": ({"attitude_hz": 4.0}, "attitudes come 4 times a second"),
    "clock": ({"clock_known": False}, "clock is not known"),
    "frames": ({"frames": 0, "tag": False}, "no pictures and no detections"),
    "tag": ({"tag": False}, "no tag with its four corners"),
}


@pytest.mark.parametrize("missing", MISSING)
def test_what_is_missing_is_named_and_waited_for_and_then_given_up(missing):
    what, words = MISSING[missing]
    session = Session()
    for seconds, phase in ((5.0, ShakePhase.WAITING), (6.0, ShakePhase.FAILED)):
        advice = session.seconds(seconds, **what)
        assert advice.phase is phase
        assert words in advice.text
    assert not session.guide.begun


def test_shake_turn_shake_done():
    session = Session()
    assert "shake it" in session.seconds(0.2).text
    advice = session.seconds(9.0)
    assert "shake it" in advice.text
    assert 0.0 < advice.left_s < 2.0
    assert "turn it by 90 deg" in session.seconds(2.0).text
    assert session.seconds(1.0, heading=0.5 + pi / 2).text == "go on shaking"
    assert session.seconds(7.0, heading=0.5 + pi / 2).phase is ShakePhase.SHAKING
    assert session.seconds(1.4, heading=0.5 + pi / 2).phase is ShakePhase.DONE


def test_corners_and_swings_are_counted_from_the_beginning():
    session = Session()
    session.seconds(3.0, attitude_hz=0.0)
    advice = session.seconds(5.0)
    assert advice.corners == 4 * 6 * 24
    assert [degrees(swing) for swing in advice.swung] == pytest.approx([17.2, 17.2], abs=1.5)


def test_who_hardly_shakes_is_asked_for_more():
    assert "wider" not in Session().seconds(3.0, swing=0.03).text
    assert "wider" in Session().seconds(6.0, swing=0.03).text


def test_a_turn_through_south_is_a_turn_by_what_it_was():
    session = Session()
    session.seconds(11.0, heading=pi - 0.1)
    assert "turn it" in session.seconds(0.2, heading=-pi + 0.3).text
    assert session.seconds(0.2, heading=-pi + 1.4).text == "go on shaking"


def test_who_turns_late_is_waited_for_and_goes_on_long_enough():
    session = Session()
    assert "turn it" in session.seconds(25.0).text
    assert session.seconds(3.0, heading=-1.2).phase is ShakePhase.SHAKING
    assert session.seconds(1.6, heading=-1.2).phase is ShakePhase.DONE


def test_who_never_turns_is_not_waited_for_for_ever():
    session = Session()
    assert session.seconds(39.0).phase is ShakePhase.SHAKING
    assert session.seconds(2.0).phase is ShakePhase.DONE


def test_a_tag_that_is_lost_is_said():
    session = Session()
    session.seconds(3.0)
    assert "out of sight" in session.seconds(3.0, tag=False).text
    assert "shake it" in session.seconds(0.4).text
