"""Adoption of an autopilot and times of our heartbeats, with invented heartbeats and invented time."""

from collections import namedtuple

import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from pymavlink.dialects.v20 import ardupilotmega as mavlink

from fwav_companion.mavlink.client.identity import Identity
from fwav_companion.mavlink.client.identity_events import (
    Adopted,
    ArmedChanged,
    AutopilotBack,
    AutopilotLost,
    NeighbourHeard,
    SeveralHeard,
)
from fwav_companion.types import AutopilotKind, Destination, Message

S = 10**9
T0 = 5_000 * S
Heartbeat = namedtuple("Heartbeat", "type autopilot base_mode custom_mode system_status mavlink_version")


def heartbeat(system=1, component=1, mav_type=mavlink.MAV_TYPE_FLAPPING_WING, autopilot=3, base_mode=0, link="fc"):
    return Message("HEARTBEAT", system, component, link, Heartbeat(mav_type, autopilot, base_mode, 0, 4, 3))


def gcs(link="ground"):
    return heartbeat(255, 190, mavlink.MAV_TYPE_GCS, mavlink.MAV_AUTOPILOT_INVALID, link=link)


def adopted(identity, now=T0, **heartbeat_kwargs):
    identity.on_message(heartbeat(**heartbeat_kwargs), now)
    identity.on_wake(now + 3 * S)
    return identity


def test_the_one_autopilot_is_adopted_three_seconds_after_it_was_first_heard():
    identity = Identity(0)
    assert identity.on_message(heartbeat(system=7), T0) == ()
    assert identity.wake_at == T0 + 3 * S
    assert identity.on_wake(T0 + 3 * S - 1) == ()
    (event,) = identity.on_wake(T0 + 3 * S)
    assert isinstance(event, Adopted)
    assert (event.autopilot.system, event.autopilot.component, event.autopilot.link) == (7, 1, "fc")
    assert identity.system == 7


@pytest.mark.parametrize(
    ("autopilot", "kind"),
    [
        (mavlink.MAV_AUTOPILOT_ARDUPILOTMEGA, AutopilotKind.ARDUPILOT),
        (mavlink.MAV_AUTOPILOT_PX4, AutopilotKind.PX4),
        (mavlink.MAV_AUTOPILOT_GENERIC, AutopilotKind.OTHER),
    ],
)
def test_the_kind_follows_from_the_heartbeat(autopilot, kind):
    assert adopted(Identity(0), autopilot=autopilot).autopilot.kind is kind


@pytest.mark.parametrize(
    "nobody",
    [
        gcs(),
        heartbeat(1, 191, mavlink.MAV_TYPE_ONBOARD_CONTROLLER, mavlink.MAV_AUTOPILOT_INVALID),
        heartbeat(1, 154, mavlink.MAV_TYPE_GIMBAL, mavlink.MAV_AUTOPILOT_ARDUPILOTMEGA),
        heartbeat(2, 1, mavlink.MAV_TYPE_ANTENNA_TRACKER, mavlink.MAV_AUTOPILOT_ARDUPILOTMEGA),
    ],
)
def test_what_is_no_flight_controller_is_never_adopted(nobody):
    identity = Identity(0)
    for second in range(10):
        assert identity.on_message(nobody, T0 + second * S) == ()
        assert identity.on_wake(T0 + second * S) == ()
    assert identity.autopilot is None


def test_system_zero_is_adopted_where_it_is_the_one_heard_and_we_speak_as_system_one():
    """Betaflight: system 0, component 200."""
    identity = Identity(0)
    assert identity.on_message(heartbeat(0, 200), T0) == ()
    (event,) = identity.on_wake(T0 + 3 * S)
    assert (event.autopilot.system, event.autopilot.component) == (0, 200)
    assert (identity.system, identity.vehicle, identity.autopilot_component) == (1, 0, 200)


def test_system_zero_yields_to_a_vehicle_with_an_id_and_replaces_none():
    identity = Identity(0)
    identity.on_message(heartbeat(0, 200), T0)
    identity.on_message(heartbeat(7, 1), T0 + S)
    (event,) = identity.on_wake(T0 + 3 * S)
    assert event.autopilot.system == 7
    for second in range(4, 90):
        identity.on_message(heartbeat(0, 200), T0 + second * S)
    assert identity.autopilot.system == 7


def test_a_ground_station_heard_first_does_not_start_the_listening():
    identity = Identity(0)
    identity.on_message(gcs(), T0)
    identity.on_message(heartbeat(), T0 + 2 * S)
    assert identity.on_wake(T0 + 3 * S) == ()
    assert identity.on_wake(T0 + 5 * S) != ()


def test_of_several_none_is_adopted_and_it_is_said_once():
    identity = Identity(0)
    identity.on_message(heartbeat(system=2), T0)
    identity.on_message(heartbeat(system=9), T0 + S)
    assert identity.on_wake(T0 + 3 * S) == (SeveralHeard((2, 9)),)
    for second in range(4, 60):  # only one of them goes on: still no adoption
        assert identity.on_message(heartbeat(system=2), T0 + second * S) == ()
        assert identity.on_wake(T0 + second * S) == ()
    assert identity.autopilot is None
    assert identity.system == 1


def test_after_all_of_several_fell_silent_none_of_them_is_adopted_but_a_new_one_is():
    identity = Identity(0)
    identity.on_message(heartbeat(system=2), T0)
    identity.on_message(heartbeat(system=9), T0)
    identity.on_wake(T0 + 3 * S)
    identity.on_wake(identity.wake_at)
    for second in range(20, 30):
        assert identity.on_message(heartbeat(system=2), T0 + second * S) == ()
    identity.on_wake(T0 + 40 * S)
    identity.on_message(heartbeat(system=5), T0 + 50 * S)
    (event,) = identity.on_wake(T0 + 53 * S)
    assert event.autopilot.system == 5


def later(identity, *, system=2, start=5, seconds=60, **kwargs):
    """Adoptions while another vehicle is heard once a second."""
    events = []
    for second in range(start, start + seconds):
        events += identity.on_wake(T0 + second * S)
        events += identity.on_message(heartbeat(system=system, **kwargs), T0 + second * S)
    return [event for event in events if isinstance(event, Adopted)]


def test_another_one_replaces_a_disarmed_one_after_thirty_seconds_of_silence():
    identity = adopted(Identity(0), system=1)
    identity.on_message(heartbeat(system=1), T0 + 4 * S)
    assert later(identity, seconds=29) == []
    (event,) = later(identity, start=34, seconds=1)
    assert (event.autopilot.system, event.before.system) == (2, 1)
    assert not identity.autopilot_lost
    assert identity.system == 2


def test_what_keeps_another_one_from_replacing_ours():
    assert later(adopted(Identity(1), system=1)) == [], "a configured system"
    armed = adopted(Identity(0), system=1)
    armed.on_message(heartbeat(system=1, base_mode=128), T0 + 4 * S)
    assert later(armed) == [], "armed when last heard"
    assert later(adopted(Identity(0), system=1), link="other") == [], "on another link"
    assert later(adopted(Identity(0), system=1), start=200, seconds=2) == [], "heard for less than the listening"
    two = adopted(Identity(0), system=1)
    for second in range(5, 100):
        two.on_message(heartbeat(system=2), T0 + second * S)
        two.on_message(heartbeat(system=3), T0 + second * S + S // 2)
    assert two.autopilot.system == 1, "two others are heard"


def test_a_neighbour_is_never_ours_also_after_a_brown_out():
    identity = adopted(Identity(0), system=1)
    identity.on_message(heartbeat(system=42), T0 + 3 * S)
    assert identity.on_message(heartbeat(system=1), T0 + 4 * S) == (NeighbourHeard(42, 1),)
    assert later(identity, system=42, start=6, seconds=300) == []
    (back,) = identity.on_message(heartbeat(system=1), T0 + 400 * S)
    assert isinstance(back, AutopilotBack)
    assert identity.autopilot.system == 1


def test_a_neighbour_that_appears_during_a_brown_out_is_a_neighbour_when_ours_is_back():
    identity = adopted(Identity(0), system=1)
    assert later(identity, system=42, start=10, seconds=15) == []
    identity.on_message(heartbeat(system=1), T0 + 25 * S)
    assert later(identity, system=42, start=26, seconds=300) == []


def test_a_system_id_that_the_user_changed_is_followed():
    """ArduPilot changes its id at once: the last heartbeat of the old one comes before the first of the new one."""
    identity = adopted(Identity(0), system=1)
    identity.on_message(heartbeat(system=1), T0 + 4 * S)
    (event,) = later(identity, system=7, start=5, seconds=40)
    assert event.autopilot.system == 7


def test_two_autopilot_components_of_one_vehicle_are_one_vehicle_and_component_1_speaks_for_it():
    identity = Identity(0)
    for component in (42, 1, 17):
        identity.on_message(heartbeat(component=component), T0)
    (event,) = identity.on_wake(T0 + 3 * S)
    assert event.autopilot.component == 1


def test_a_configured_system_is_adopted_at_once_and_no_other():
    identity = Identity(9)
    assert identity.system == 9
    assert identity.on_message(heartbeat(system=2), T0) == ()
    (event,) = identity.on_message(heartbeat(system=9), T0)
    assert isinstance(event, Adopted)


def test_a_second_vehicle_after_the_adoption_changes_nothing():
    identity = adopted(Identity(0), system=3)
    assert identity.on_message(heartbeat(system=4, base_mode=128), T0 + 4 * S) == ()
    identity.on_message(heartbeat(system=3), T0 + 5 * S)
    assert identity.autopilot.system == 3


def test_lost_after_five_missed_heartbeats_and_back_with_the_next_one():
    identity = adopted(Identity(0))
    identity.on_message(heartbeat(), T0 + 4 * S)
    assert identity.wake_at == T0 + 9 * S
    (lost,) = identity.on_wake(T0 + 9 * S)
    assert isinstance(lost, AutopilotLost)
    assert identity.autopilot_lost
    assert identity.on_wake(T0 + 20 * S) == ()
    back = identity.on_message(heartbeat(link="other"), T0 + 21 * S)
    assert [type(event) for event in back] == [AutopilotBack]
    assert identity.autopilot.link == "other"
    assert not identity.autopilot_lost


def test_arming_is_reported():
    identity = adopted(Identity(0))
    assert identity.on_message(heartbeat(base_mode=128 | 64), T0 + 4 * S) == (ArmedChanged(True),)
    assert identity.on_message(heartbeat(base_mode=128), T0 + 5 * S) == ()
    assert identity.on_message(heartbeat(base_mode=1), T0 + 6 * S) == (ArmedChanged(False),)


def test_until_an_autopilot_is_adopted_only_the_companion_beats():
    identity = Identity(0)
    (beat,) = identity.heartbeats(T0, healthy=False)
    assert (beat.name, beat.component, beat.to) == ("HEARTBEAT", 191, Destination.EVERYONE)
    assert mavlink.MAVLink_heartbeat_message(**beat.fields).to_dict() == {
        "mavpackettype": "HEARTBEAT",
        "type": mavlink.MAV_TYPE_ONBOARD_CONTROLLER,
        "autopilot": mavlink.MAV_AUTOPILOT_INVALID,
        "base_mode": 0,
        "custom_mode": 0,
        "system_status": mavlink.MAV_STATE_CRITICAL,
        "mavlink_version": 3,
    }


def test_then_the_camera_beats_too_unless_there_is_none():
    identity = adopted(Identity(0))
    beats = {beat.component: beat.fields for beat in identity.heartbeats(T0 + 4 * S, healthy=True)}
    assert beats.keys() == {191, 100}
    assert beats[100]["type"] == mavlink.MAV_TYPE_CAMERA
    assert {fields["system_status"] for fields in beats.values()} == {mavlink.MAV_STATE_ACTIVE}
    without = adopted(Identity(0, camera_component=None))
    assert [beat.component for beat in without.heartbeats(T0 + 4 * S, healthy=True)] == [191]


def test_one_a_second_without_drift_even_if_every_wake_is_late():
    identity, now, sent = Identity(0), T0, 0
    for _ in range(100):
        sent += len(identity.heartbeats(now, healthy=True))
        assert identity.heartbeats(now, healthy=True) == []
        now = identity.wake_at + 3_000_000
    assert sent == 100
    assert now - T0 == 100 * S + 3_000_000


def test_a_pause_is_not_made_up_for():
    identity = Identity(0)
    identity.heartbeats(T0, healthy=True)
    assert len(identity.heartbeats(T0 + 60 * S, healthy=True)) == 1
    assert identity.heartbeats(T0 + 60 * S + 1, healthy=True) == []


def test_a_fault_silences_and_does_not_spin():
    identity = adopted(Identity(0))
    identity.heartbeats(T0 + 3 * S, healthy=True)
    identity.beats.fault()
    assert identity.heartbeats(T0 + 9 * S, healthy=True) == []
    assert identity.wake_at > T0 + 4 * S  # only the autopilot's silence is waited for
    identity.beats.fault_over()
    assert len(identity.heartbeats(T0 + 9 * S, healthy=True)) == 2


@settings(derandomize=True, max_examples=60)
@given(
    st.lists(
        st.tuples(
            st.integers(0, 255), st.integers(0, 255), st.integers(0, 255), st.integers(0, 255), st.integers(0, 4 * S)
        ),
        max_size=60,
    )
)
def test_whatever_is_heard_ours_is_replaced_only_after_its_silence(heard):
    identity, now, heard_ns = Identity(0), T0, T0
    for system, component, mav_type, autopilot, pause in heard:
        now += pause
        events = identity.on_wake(now) + identity.on_message(heartbeat(system, component, mav_type, autopilot), now)
        for event in events:
            if isinstance(event, Adopted) and event.before is not None:
                assert not event.before.armed
                assert now - heard_ns >= 30 * S
        ours = identity.autopilot
        if ours is not None and (system, component) == (ours.system, ours.component):
            heard_ns = now
        assert identity.wake_at is None or identity.wake_at > now
