"""Texts for people: chunks of 50 bytes; targets found, lost, merged; rate limits."""

import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from fwav_companion.publishing.announcer import Announcer, TargetNotices, statustexts
from fwav_companion.publishing.options import PublishOptions
from fwav_companion.types import Destination, Notice, NoticeCode, Reason, Severity, TrackState

CODE = NoticeCode.READY
FOUND, LOST, MERGED = NoticeCode.TARGET_FOUND, NoticeCode.TARGET_LOST, NoticeCode.TARGET_MERGED


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
    assert joined([world.packed(one) for one in statustexts(text, 5, code=CODE, component=191, number=7)]) == [text]


@settings(derandomize=True, max_examples=300)
@given(st.text(max_size=120))
def test_any_text_arrives_readable(world, text):
    received = [world.packed(one) for one in statustexts(text, 5, code=CODE, component=191)]
    (whole,) = joined(received)
    printable = "".join(one if one.isprintable() else " " for one in text).encode(errors="replace").decode()
    kept = whole.replace(" ", "")
    assert printable.replace(" ", "").startswith(kept)
    assert len(printable.encode()) > 190 or kept == printable.replace(" ", "")


def test_two_long_texts_are_not_joined_with_each_other():
    first, second = (
        statustexts("x" * 60, 5, code=CODE, component=191, number=number)[0].fields["id"] for number in (1, 2)
    )
    assert len({first, second, 0}) == 3


@pytest.fixture
def news():
    return TargetNotices()


@pytest.fixture
def announcer():
    return Announcer(PublishOptions())


def codes(notices):
    return [notice.code for notice in notices]


def for_ground(text="camera lost", severity=Severity.WARNING):
    return Notice(CODE, severity, text, to_ground=True)


def test_a_target_is_found_once_with_its_place_and_the_radius_that_holds_it_with_95_percent(world, news):
    here = world.track(3, "person", position_ned=(0.0, 0.0, 0.0), cov=world.diagonal(1.0, 1.0, 0.5))
    (notice,) = news.on_tracks((here,), world.situation())
    assert (notice.code, notice.severity, notice.to_ground) == (FOUND, Severity.NOTICE, True)
    assert notice.text == "found person 3: 47.397742, 8.545594, 95 % within 2.4 m"
    assert news.on_tracks((world.track(3, "person"),), world.situation()) == []


def test_a_target_is_lost_once_with_its_reason_and_last_place(world, news):
    news.on_tracks((world.track(3, "person"),), world.situation())
    coasting = world.track(3, "person", state=TrackState.COASTING)
    assert news.on_tracks((coasting,), world.situation()) == []
    gone = {"state": TrackState.DROPPED, "reason": Reason.NOT_SEEN, "cov": world.diagonal(1.0, 1.0, 0.5)}
    dropped = world.track(3, "person", position_ned=(0, 0, 0), **gone)
    (notice,) = news.on_tracks((dropped,), world.situation())
    assert notice.code is LOST
    assert notice.text == "lost person 3 (not seen): last at 47.397742, 8.545594, 95 % within 2.4 m"
    assert news.on_tracks((dropped,), world.situation()) == []


def test_a_track_that_vanishes_without_a_word_is_lost_too(world, news):
    news.on_tracks((world.track(3),), world.situation())
    (notice,) = news.on_tracks((), world.situation())
    assert notice.code is LOST
    assert "pad 3" in notice.text


@pytest.mark.parametrize("shown", [True, False])
def test_what_turned_out_to_be_another_is_not_lost(world, news, shown):
    """Nor is it found again; also where a late frame replaced the frame that showed its end."""
    news.on_tracks((world.track(2, "pad"), world.track(3, "pad")), world.situation())
    replaced = world.track(3, "pad", state=TrackState.DROPPED, reason=Reason.REPLACED, replaced_by=2)
    tracks = (world.track(2, "pad", replaces=(3,)), *([replaced] if shown else []))
    (notice,) = news.on_tracks(tracks, world.situation())
    assert notice.code is MERGED
    assert notice.text.startswith("pad 3 is pad 2: ")


def test_what_was_never_believed_is_neither_found_nor_lost(world, news):
    for state in (TrackState.TENTATIVE, TrackState.DROPPED):
        assert news.on_tracks((world.track(state=state),), world.situation()) == []


def test_without_a_global_position_the_place_is_given_from_the_vehicle(world, news):
    near = world.track(label="", position_ned=(4.0, -3.0, 0.0))
    (notice,) = news.on_tracks((near,), world.situation(plane=None))
    assert notice.text.startswith("found target 1: 4.0 m N 3.0 m W of vehicle, 95 % within ")


def test_every_target_is_in_the_log_but_a_field_of_them_does_not_fill_the_radio(world, news, announcer):
    crowd = tuple(world.track(number) for number in range(1, 41))
    notices = news.on_tracks(crowd, world.situation())
    assert codes(notices) == [FOUND] * 40
    sent = [out for notice in notices for out in announcer.on_notice(notice, world.NOW)]
    assert sum(out.fields["chunk_seq"] == 0 for out in sent) == 4
    (later,) = news.on_tracks((*crowd, world.track(99)), world.situation())
    out = announcer.on_notice(later, world.NOW + 2 * world.S)
    assert "(+36 more)" in "".join(one.fields["text"] for one in out)


def test_a_notice_for_the_ground_goes_to_the_ground_once_in_ten_seconds(world, announcer):
    notice = for_ground()
    (out,) = announcer.on_notice(notice, world.NOW)
    assert (out.fields["severity"], out.fields["text"], out.notice) == (4, notice.text, notice.code)
    assert (out.to, out.component) == (Destination.GROUND, 191)
    assert announcer.on_notice(notice, world.NOW + 9 * world.S) == []
    assert announcer.on_notice(notice, world.NOW + 11 * world.S) != []
    assert announcer.on_notice(Notice(CODE, Severity.INFO, "for the log"), world.NOW) == []


def test_an_error_is_sent_even_when_the_texts_are_used_up(world, announcer):
    for number in range(8):
        announcer.on_notice(for_ground(f"text {number}"), world.NOW)
    assert announcer.on_notice(for_ground("hello", Severity.INFO), world.NOW) == []
    (out,) = announcer.on_notice(for_ground("disk full", Severity.ERROR), world.NOW)
    assert out.fields["severity"] == 3


def test_statustext_off_is_silence(world):
    announcer = Announcer(PublishOptions(statustext=False))
    assert announcer.on_notice(for_ground(severity=Severity.ERROR), world.NOW) == []
