"""Messages of a fleet: their form, their bounds, and what is refused."""

from __future__ import annotations

import json

import msgspec
import pytest
from fleet_messages import COV, NOW, shared, tracks_message
from hypothesis import given
from hypothesis import strategies as st

from fwav_companion.fleet.payloads import (
    MAX_BYTES,
    MAX_TRACKS,
    StateMessage,
    TracksMessage,
    VehicleBias,
    decoded,
    encoded,
    triangle,
)
from fwav_companion.ground.fleet_intake import CLOCK_OFF_S, LONGEST_DELAY_S, MAX_VEHICLES, FleetIntake

STRONG = VehicleBias(sigma=(1.0,) * 4)
"""With a derivative of 1e5 it moves a position by 100 km."""


def test_a_message_has_the_names_of_the_contract():
    (data,) = encoded(tracks_message(shared(vel=(1.0, 0.0, 0.0), vel_cov=COV)))
    content = json.loads(data)
    assert {"schema", "vehicle", "time_unix", "seq", "part", "parts", "bias", "tracks"} <= content.keys()
    assert content["bias"].keys() == {"names", "sigma", "time_constant_s"}
    assert content["tracks"][0].keys() == {
        "track", "label", "state", "lat", "lon", "alt_amsl", "cov", "cov_shared", "bias_jacobian", "vel", "vel_cov",
        "last_seen_s",
    }  # fmt: skip
    assert content["schema"] == 1


def test_covariances_have_three_significant_digits():
    matrix = ((1.23456, 0.001239, 0.0), (0.001239, 98765.0, 0.0), (0.0, 0.0, 2.0))
    assert triangle(matrix) == (1.23, 0.00124, 0.0, 98800.0, 0.0, 2.0)


def test_many_tracks_go_in_parts_of_64_kb_and_are_joined_again():
    message = tracks_message(*(shared(number, label="x" * 64) for number in range(256)))
    parts = encoded(message)
    assert len(parts) > 1
    assert all(len(part) <= MAX_BYTES for part in parts)
    intake = FleetIntake()
    reports = [intake.on_tracks("1", part, NOW) for part in reversed(parts)]
    assert reports[:-1] == [None] * (len(parts) - 1)
    assert [track.track for track in reports[-1].tracks] == list(range(256))


@pytest.mark.parametrize(
    ("data", "reason"),
    [
        (b"x" * (MAX_BYTES + 1), "oversized"),
        (b"{", "malformed"),
        (b"[" * 50_000, "malformed"),
        (msgspec.json.encode(tracks_message(schema=2)), "another schema"),
        (msgspec.json.encode(tracks_message(part=3, parts=2)), "malformed"),
        (msgspec.json.encode(tracks_message(shared(lat=91.0))), "malformed"),
        (msgspec.json.encode(tracks_message(shared(cov=(-1.0, 0.0, 0.0, 1.0, 0.0, 1.0)))), "malformed"),
        (msgspec.json.encode(tracks_message(shared(cov=(1.0, 5.0, 0.0, 1.0, 0.0, 1.0)))), "malformed"),
        (msgspec.json.encode(tracks_message(shared(bias_jacobian=((1.0,),) * 3))), "malformed"),
        (msgspec.json.encode(tracks_message(shared(), time_unix=None)), "malformed"),
        (msgspec.json.encode(tracks_message(shared(), time_unix=1e300)), "malformed"),
        (msgspec.json.encode(tracks_message(shared(), seq=10**30)), "malformed"),
        (msgspec.json.encode(tracks_message(shared(track=10**30))), "malformed"),
        (msgspec.json.encode(tracks_message(shared(alt_amsl=1e300))), "malformed"),
        (msgspec.json.encode(tracks_message(shared(vel=(1e300, 0.0, 0.0)))), "malformed"),
        (msgspec.json.encode(tracks_message(shared(last_seen_s=-1e300))), "malformed"),
        (msgspec.json.encode(tracks_message(shared(cov=(1.0, 0.0, 5.0, 1.0, 0.0, 1.0)))), "malformed"),
        (msgspec.json.encode(tracks_message(shared(bias_jacobian=((1e300,) * 4,) * 3))), "malformed"),
        (msgspec.json.encode(tracks_message(shared(), bias=VehicleBias(sigma=(1e300,) * 4))), "malformed"),
        (msgspec.json.encode(tracks_message(shared(bias_jacobian=((1e5,) * 4,) * 3), bias=STRONG)), "malformed"),
    ],
)
def test_what_cannot_be_used_is_refused_by_name(data, reason):
    assert decoded(data, TracksMessage) == reason


@given(st.binary(max_size=300))
def test_no_bytes_raise(data):
    assert isinstance(decoded(data, TracksMessage), TracksMessage | str)
    assert isinstance(decoded(data, StateMessage), StateMessage | str)


def report(intake: FleetIntake, seq: int, now: float, **changes):
    (data,) = encoded(tracks_message(shared(), seq=seq, **changes))
    return intake.on_tracks("1", data, now)


def test_late_and_repeated_messages_are_dropped():
    intake = FleetIntake()
    assert report(intake, 5, NOW) is not None
    assert report(intake, 4, NOW) is None
    assert report(intake, 5, NOW) is None
    assert report(intake, 6, NOW) is not None
    assert intake.refused["late"] == 2


def test_a_clock_that_is_an_hour_off_is_reported_and_does_no_harm():
    intake = FleetIntake()
    found = [report(intake, seq, NOW + seq, time_unix=NOW + seq - 3600.0 - (0.3 if seq == 7 else 0.0))
             for seq in range(1, 9)]  # fmt: skip
    assert [each.at_unix for each in found if each] == pytest.approx(
        [NOW + seq - (seq == 7) * 0.3 for seq in range(1, 9)]
    )
    (text,) = intake.take_texts()
    assert "off by -3600 s" in text[1]
    assert CLOCK_OFF_S < 3600.0


def test_a_clock_that_steps_forward_delays_nothing_for_long():
    intake = FleetIntake()
    report(intake, 1, NOW)
    stepped = report(intake, 2, NOW + 1.0, time_unix=NOW - 3600.0)
    assert stepped.at_unix >= NOW + 1.0 - LONGEST_DELAY_S


def test_of_two_senders_with_one_name_the_first_counts_until_it_is_silent():
    intake = FleetIntake()
    assert report(intake, 1, NOW, session="a") is not None
    assert report(intake, 900, NOW + 1.0, session="b") is None
    assert "two senders" in intake.take_texts()[0][1]
    assert report(intake, 2, NOW + 2.0, session="a") is not None
    assert report(intake, 901, NOW + 20.0, session="b") is not None


def test_a_number_far_ahead_outdates_a_vehicle_for_five_seconds_at_most():
    intake = FleetIntake()
    report(intake, 2**53, NOW)
    assert report(intake, 8, NOW + 1.0) is None
    assert report(intake, 9, NOW + 6.0) is not None
    assert report(intake, 10, NOW + 6.5) is not None


def test_a_name_that_is_silent_for_a_minute_yields_its_place():
    intake = FleetIntake()
    for number in range(MAX_VEHICLES):
        intake.on_tracks(str(number), encoded(tracks_message(shared(), vehicle=str(number)))[0], NOW)
    newcomer = encoded(tracks_message(shared(), vehicle="new"))[0]
    assert intake.on_tracks("new", newcomer, NOW + 50.0) is None
    intake.on_tracks("0", encoded(tracks_message(shared(), vehicle="0", seq=3))[0], NOW + 55.0)
    assert intake.on_tracks("new", newcomer, NOW + 70.0) is not None
    assert "0" in intake._senders
    assert len(intake._senders) == MAX_VEHICLES


def test_refusals_are_reported_once_a_minute_and_nothing_grows():
    intake = FleetIntake()
    for second in range(50):
        intake.on_tracks("1", b"{", NOW + second)
    assert len(intake.take_texts()) == 1
    assert intake.refused["malformed"] == 50
    for number in range(5000):
        intake.on_tracks(str(number), b"{", NOW)
    assert len(intake._said) <= 1000
    for number in range(500):
        (data,) = encoded(tracks_message(shared(), vehicle=str(number)))
        intake.on_tracks(str(number), data, NOW)
    assert len(intake._senders) == 200


@pytest.mark.parametrize("name", ["v" * 65, "v" * 60_000, "a\nb", "<b>", "\u202ea", "", "fleet"])
def test_a_name_that_no_vehicle_can_have_is_refused_and_said_once_for_all(name):
    """A long one was copied into each update of the page; tracks of "fleet" hid the fused targets."""
    intake = FleetIntake()
    assert intake.on_tracks(name, encoded(tracks_message(shared()))[0], NOW) is None
    assert intake.on_state(name, b"{}", NOW) is None
    assert intake.on_state(name + "!", b"{}", NOW) is None
    ((shown, text),) = intake.take_texts()
    assert "a name that no vehicle can have" in text
    assert len(shown) < 700
    assert shown.isprintable()
    assert not intake.knows(name)


def test_the_parts_of_a_message_hold_no_more_tracks_than_a_vehicle_may_have():
    intake, whole = FleetIntake(), None
    many = tuple(map(shared, range(MAX_TRACKS)))
    for part in range(1, 17):
        message = msgspec.structs.replace(tracks_message(), tracks=many, part=part, parts=16)
        data = msgspec.json.encode(message)
        if len(data) > MAX_BYTES:
            data = msgspec.json.encode(msgspec.structs.replace(message, tracks=many[:100]))
        whole = intake.on_tracks("1", data, NOW) or whole
    assert len(whole.tracks) == MAX_TRACKS
