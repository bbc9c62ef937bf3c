"""ROI and FOLLOW_TARGET by hand: when they are due, and what is never sent."""

import pytest
from acting_world import AUTOPILOT, ORIGIN, ROI, ROI_NONE, T0, S, a_track, message, options, situation, state

from fwav_companion.acting.follow import Follow
from fwav_companion.acting.roi import Roi

ACCEPTED = message("COMMAND_ACK", command=ROI, result=0)


def test_roi_is_sent_again_only_where_the_target_moved_by_more_than_its_sigma():
    roi, sent = Roi(191), []
    for k in range(40):
        now = T0 + k * S // 2
        north = 20.0 if k < 20 else 21.0
        sent += [(k, each) for each in roi.due(a_track(now, (north, 0.0, 0.0)), situation(now), AUTOPILOT)]
        roi.on_message(ACCEPTED, AUTOPILOT)
    assert [k for k, _ in sent] == [0, 20]


def test_roi_of_a_moving_target_is_sent_once_a_second():
    roi, sent = Roi(191), []
    for k in range(100):
        now = T0 + k * S // 10
        sent += roi.due(a_track(now, (20.0 + 0.5 * k, 0.0, 0.0)), situation(now), AUTOPILOT)
        roi.on_message(ACCEPTED, AUTOPILOT)
    assert len(sent) == 10


@pytest.mark.parametrize(
    ("place", "vehicle", "why"),
    [
        ((20.0, 0.0, -30.0), (0.0, 0.0, -20.0), "the target is above the vehicle"),
        ((5100.0, 0.0, 0.0), (0.0, 0.0, -20.0), "the target is beyond 5 km"),
        ((20.0, 0.0, 0.0), None, "the vehicle's place is unknown"),
        ((4900.0, 0.0, 0.0), (0.0, 0.0, -20.0), None),
    ],
)
def test_roi_of_an_impossible_place_is_not_sent(place, vehicle, why):
    roi = Roi(191)
    sent = roi.due(a_track(T0, place), situation(T0, state(T0, vehicle)), AUTOPILOT)
    assert roi.withheld == why
    assert bool(sent) is (why is None)


def test_roi_is_an_integer_place_above_sea_level():
    (sent,) = Roi(191).due(a_track(T0, (0.0, 0.0, -3.0)), situation(), AUTOPILOT)
    assert (sent.name, sent.fields["frame"], sent.fields["command"]) == ("COMMAND_INT", 0, ROI)
    assert (sent.fields["x"], sent.fields["y"]) == (round(ORIGIN.lat_deg * 1e7), round(ORIGIN.lon_deg * 1e7))
    assert sent.fields["z"] == pytest.approx(ORIGIN.alt_amsl_m + 3.0)


def test_roi_without_an_answer_is_given_up_and_cleared_only_where_it_was_sent():
    roi = Roi(191)
    assert roi.clear(AUTOPILOT) == []
    sent = [roi.due(a_track(T0 + k * S), situation(T0 + k * S), AUTOPILOT) for k in range(9)]
    assert sum(map(bool, sent)) == 5
    assert roi.refusal == "the autopilot does not answer"
    assert [each.fields["command"] for each in roi.clear(AUTOPILOT)] == [ROI_NONE]


def test_refused_roi_has_the_autopilots_reason():
    roi = Roi(191)
    roi.due(a_track(), situation(), AUTOPILOT)
    roi.on_message(message("COMMAND_ACK", command=ROI, result=3), AUTOPILOT)
    assert roi.refusal == "the autopilot answers: unsupported"


@pytest.mark.parametrize(
    ("track", "why"),
    [
        (a_track(sigma_m=2.9), None),
        (a_track(sigma_m=3.1), "the target is too uncertain"),
        (a_track(last_seen=T0 - 2 * S - 1), "the target is out of sight"),
        (a_track(last_seen=T0 - 2 * S), None),
    ],
)
def test_follow_target_rests_beyond_its_claim_and_its_age(track, why):
    follow = Follow(options())
    assert bool(follow.due(track, situation())) is (why is None)
    assert follow.withheld == why


@pytest.mark.parametrize(("velocity", "capabilities"), [(None, 1), ((1.0, -0.5, 0.0), 3)])
def test_follow_target_has_the_velocity_that_the_track_has(velocity, capabilities):
    (sent,) = Follow(options(follow_system_id=17)).due(a_track(velocity=velocity), situation())
    assert (sent.system, sent.component, sent.fields["est_capabilities"]) == (17, 191, capabilities)
    assert sent.fields["vel"] == list(velocity or (0.0, 0.0, 0.0))
    assert sent.fields["alt"] == pytest.approx(ORIGIN.alt_amsl_m, abs=1e-3)
    assert sent.fields["position_cov"][:2] == pytest.approx([0.5, 0.1])


def test_follow_target_is_sent_five_times_a_second():
    follow, count = Follow(options()), 0
    for k in range(100):
        now = T0 + k * S // 20
        count += len(follow.due(a_track(now), situation(now)))
    assert count == 25


def test_selections_again_and_again_send_no_more_often():
    roi, follow, sent = Roi(191), Follow(options(follow_target=True)), {"COMMAND_INT": 0, "FOLLOW_TARGET": 0}
    for k in range(100):
        now = T0 + k * S // 50
        roi.begin()
        follow.begin()
        track = a_track(now, (20.0 + k, 0.0, 0.0))
        for each in [*roi.due(track, situation(now), AUTOPILOT), *follow.due(track, situation(now))]:
            sent[each.name] += 1
    assert sent == {"COMMAND_INT": 2, "FOLLOW_TARGET": 10}


def test_stop_clears_the_place_of_an_earlier_selection():
    roi = Roi(191)
    assert roi.due(a_track(T0), situation(T0), AUTOPILOT)
    roi.begin()
    assert [each.fields["command"] for each in roi.clear(AUTOPILOT)] == [ROI_NONE]
    assert roi.clear(AUTOPILOT) == []
