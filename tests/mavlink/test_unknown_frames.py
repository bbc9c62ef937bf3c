"""Frames of unknown ids, whose checksum cannot be verified: taken where nothing speaks against them."""

from __future__ import annotations

from mavlink_wire import Wire, unknown_frame
from scanned_streams import scanned

from fwav_companion.mavlink.wire.scanner import Scanner


def unknown_header(length: int) -> bytes:
    return b"\xfd" + bytes((length, 0, 0, 0, 1, 1)) + b"\xaa\xbb\xcc"


def test_an_unknown_frame_of_a_stream_waits_for_what_follows() -> None:
    scanner = Scanner()
    wire = Wire()
    assert len(scanner.feed(wire.heartbeat())) == 1
    assert scanner.feed(unknown_frame()) == []
    assert scanner.undecided
    (unknown, known) = scanner.feed(wire.heartbeat())
    assert (unknown.known, known.known, scanner.undecided) == (False, True, False)
    assert unknown.data == unknown_frame()


def test_an_unknown_frame_before_a_pause_is_taken_when_the_line_is_quiet() -> None:
    scanner = Scanner()
    scanner.feed(Wire().heartbeat() + unknown_frame())
    (unknown,) = scanner.settle()
    assert unknown.data == unknown_frame()
    assert scanner.settle() == []


def test_an_unknown_frame_that_no_frame_follows_is_noise() -> None:
    wire = Wire()
    first, second = wire.heartbeat(), wire.heartbeat()
    assert scanned(first + unknown_frame() + b"x" + second) == [first, second]


def test_noise_like_an_unknown_frame_that_ends_where_another_begins_swallows_none() -> None:
    wire = Wire()
    inside, after = wire.attitude(), wire.heartbeat()
    assert scanned(b"noise" + unknown_header(len(inside) - 2) + inside + after) == [inside, after]


def test_noise_like_an_unknown_frame_that_ends_inside_a_known_one_swallows_none() -> None:
    """Judged when the known one has only come in part."""
    known = Wire().attitude(0xFDFDFDFD)
    noise = b"noise" + unknown_header(9)  # with two bytes of checksum it ends at the second byte of known's payload
    for cut in range(1, len(noise + known)):
        assert scanned(noise + known, [cut]) == [known]


def test_noise_in_an_unknown_frame_after_noise_holds_nothing_up_unless_its_id_is_known() -> None:
    wire = Wire()
    start_of_unknown = b"\xfd\xff\x00\x00\x00\x01\x01\xaa\xbb\xcc"
    assert len(Scanner().feed(b"noise" + unknown_frame(payload=start_of_unknown) + wire.heartbeat())) == 2
    start_of_known = b"\xfd\xff\x00\x00\x00\x01\x01\x00\x00\x00"
    scanner = Scanner()
    assert scanner.feed(b"noise" + unknown_frame(payload=start_of_known) + wire.heartbeat()) == []
    assert len(scanner.feed(wire.attitude() * 7)) == 9


def test_what_was_found_clear_in_bytes_that_are_gone_is_not_clear_in_those_that_follow() -> None:
    wire = Wire()
    scanner = Scanner()
    assert len(scanner.feed(b"noise" + unknown_frame(payload=b"\xfd\x00\x09" * 15) + wire.heartbeat())) == 2
    inside, after = wire.attitude(), wire.heartbeat()
    found = scanner.feed(b"noise" + unknown_header(len(inside) - 2) + inside + after)
    assert [frame.data for frame in found] == [inside, after]


def test_an_unknown_frame_after_noise_is_taken_where_nothing_known_is_inside() -> None:
    wire = Wire()
    before, after = wire.heartbeat(), wire.heartbeat()
    unknown = unknown_frame(payload=b"\xfd\xfe\xfd\x00\x00" * 9)
    assert scanned(before + b"noise" + unknown + after) == [before, unknown, after]


def test_an_unknown_frame_in_a_datagram_is_taken_at_its_end() -> None:
    (unknown,) = Scanner(datagrams=True).feed(unknown_frame())
    assert unknown.data == unknown_frame()
