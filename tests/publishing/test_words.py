"""What people read: texts in chunks, found and lost, ready or not."""

from math import nan

import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from fwav_companion.publishing.announcer import Announcer
from fwav_companion.publishing.options import PublishOptions
from fwav_companion.publishing.readiness import Readiness, ready_notice
from fwav_companion.publishing.statustext import statustexts
from fwav_companion.types import Destination, Notice, Reason, Severity, TrackState


def joined(received):
    """As a ground station joins chunks: a text that fills its 50 bytes goes on, one with a zero byte ends it."""
    texts, open_chunks = [], {}
    for one in received:
        if one["id"] == 0:
            texts.append(one["text"])
            continue
        chunks = open_chunks.setdefault(one["id"], [])
        assert one["chunk_seq"] == len(chunks)
        chunks.append(one["text"])
        if len(one["text"].encode()) < 50:
            texts.append("".join(open_chunks.pop(one["id"])))
    assert not open_chunks, "a ground station would wait for more"
    return texts


@pytest.mark.parametrize("length", [0, 1, 49, 50, 51, 99, 100, 101, 199])
def test_texts_of_every_length_arrive_whole(world, length):
    text = ("0123456789" * 20)[:length]
    assert joined([world.packed(one) for one in statustexts(text, 5, component=191, number=7)]) == [text]


@settings(derandomize=True, max_examples=300)
@given(st.text(max_size=120))
def test_any_text_arrives_readable(world, text):
    received = [world.packed(one) for one in statustexts(text, 5, component=191)]
    (whole,) = joined(received)
    printable = "".join(one if one.isprintable() else " " for one in text).encode(errors="replace").decode()
    kept = whole.replace(" ", "")
    assert printable.replace(" ", "").startswith(kept)
    assert len(printable.encode()) > 190 or kept == printable.replace(" ", "")


def test_two_long_texts_are_not_joined_with_each_other():
    first, second = (statustexts("x" * 60, 5, component=191, number=number)[0].fields["id"] for number in (1, 2))
    assert len({first, second, 0}) == 3


def words(out):
    return [one.fields["text"] for one in out]


@pytest.fixture
def announcer():
    return Announcer(PublishOptions())


def test_found_once_with_place_and_accuracy(world, announcer):
    out = announcer.on_tracks((world.track(3, "person", position_ned=(0.0, 0.0, 0.0)),), world.situation())
    assert words(out) == ["found person 3: 47.397742, 8.545594 +-1.0 m"]
    assert (out[0].to, out[0].component) == (Destination.GROUND, 191)
    assert announcer.on_tracks((world.track(3, "person"),), world.situation()) == []


def test_lost_with_its_reason(world, announcer):
    announcer.on_tracks((world.track(3, "person"),), world.situation())
    coasting = world.track(3, "person", state=TrackState.COASTING)
    assert announcer.on_tracks((coasting,), world.situation()) == []
    dropped = world.track(3, "person", state=TrackState.DROPPED, reason=Reason.NOT_SEEN, position_ned=(0, 0, 0))
    (text,) = joined([world.packed(one) for one in announcer.on_tracks((dropped,), world.situation())])
    assert text == "lost person 3: 47.397742, 8.545594 +-1.0 m (not_seen)"
    assert announcer.on_tracks((dropped,), world.situation()) == []


def test_a_track_that_vanishes_without_a_word_is_lost_too(world, announcer):
    announcer.on_tracks((world.track(3),), world.situation())
    (text,) = words(announcer.on_tracks((), world.situation()))
    assert text.startswith("lost pad 3")


@pytest.mark.parametrize("told", [True, False])
def test_what_turned_out_to_be_another_is_not_lost(world, announcer, told):
    """Nor said to be new; also where a late frame swallowed the frame that told of its end."""
    announcer.on_tracks((world.track(2, "pad"), world.track(3, "pad")), world.situation())
    replaced = world.track(3, "pad", state=TrackState.DROPPED, reason=Reason.REPLACED, replaced_by=2)
    tracks = (world.track(2, "pad", position_ned=(0.0, 0.0, 0.0), replaces=(3,)), *([replaced] if told else []))
    (text,) = words(announcer.on_tracks(tracks, world.situation()))
    assert text == "pad 3 is pad 2: 47.397742, 8.545594 +-1.0 m"


def test_what_was_never_believed_is_neither_found_nor_lost(world, announcer):
    for state in (TrackState.TENTATIVE, TrackState.DROPPED):
        assert announcer.on_tracks((world.track(state=state),), world.situation()) == []


def test_without_a_global_position_the_place_is_told_from_the_vehicle(world, announcer):
    near = world.track(label="", position_ned=(4.0, -3.0, 0.0))
    (text,) = words(announcer.on_tracks((near,), world.situation(plane=None)))
    assert text == "found target 1: 4.0 m N 3.0 m W of vehicle +-1.0 m"[:50]


def test_a_field_of_targets_does_not_fill_the_radio(world, announcer):
    crowd = tuple(world.track(number) for number in range(1, 41))
    assert len(announcer.on_tracks(crowd, world.situation())) == 4
    later = world.situation(now=world.NOW + 2 * world.S)
    out = announcer.on_tracks((*crowd, world.track(99)), later)
    assert "(+36 more)" in "".join(words(out))


def test_notices_for_the_ground_are_said_once_in_ten_seconds(world, announcer):
    notice = Notice(Severity.WARNING, "camera lost", to_ground=True)
    (out,) = announcer.on_notice(notice, world.NOW)
    assert (out.fields["severity"], out.fields["text"]) == (4, "camera lost")
    assert announcer.on_notice(notice, world.NOW + 9 * world.S) == []
    assert announcer.on_notice(notice, world.NOW + 11 * world.S) != []
    assert announcer.on_notice(Notice(Severity.INFO, "for the log"), world.NOW) == []


def test_an_error_is_said_even_when_the_words_are_used_up(world, announcer):
    announcer.on_tracks(tuple(world.track(number) for number in range(1, 9)), world.situation())
    assert announcer.on_notice(Notice(Severity.INFO, "hello", to_ground=True), world.NOW) == []
    (out,) = announcer.on_notice(Notice(Severity.ERROR, "disk full", to_ground=True), world.NOW)
    assert out.fields["severity"] == 3


def test_statustext_off_is_silence(world):
    announcer = Announcer(PublishOptions(statustext=False))
    assert announcer.on_tracks((world.track(),), world.situation()) == []
    assert announcer.on_notice(Notice(Severity.ERROR, "x", to_ground=True), world.NOW) == []


READY = {
    "attitude_hz": 98.2,
    "wanted_attitude_hz": 100.0,
    "clock_sigma_s": 0.0006,
    "frames_hz": 30.1,
    "expected_m": 0.41,
    "height_m": 10.0,
}


def test_ready_in_one_line():
    notice = ready_notice(Readiness(**READY))
    assert notice.text == (
        "ready: attitude 98 Hz, clock 0.6 ms, camera 30/s, expect 0.4 m at 10 m (relative to the vehicle)"
    )
    assert notice.to_ground


@pytest.mark.parametrize(
    ("changes", "text"),
    [
        ({"attitude_hz": None}, "not ready: no attitude from the autopilot"),
        ({"attitude_hz": 0.0}, "not ready: no attitude from the autopilot"),
        ({"clock_sigma_s": nan}, "not ready: the autopilot's clock is not known yet"),
        ({"frames_hz": None}, "not ready: no pictures from the camera"),
        ({"attitude_hz": 18.4}, "not ready: attitude 18 Hz, wanted 100 Hz"),
        ({"trouble": "two autopilots", "attitude_hz": None}, "not ready: two autopilots"),
    ],
)
def test_or_the_one_reason_why_not(changes, text):
    notice = ready_notice(Readiness(**READY | changes))
    assert (notice.text, notice.severity) == (text, Severity.WARNING)
