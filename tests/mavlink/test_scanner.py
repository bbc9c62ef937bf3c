"""Good frames are found complete, once and in order, with any bytes around them and any cuts."""

from __future__ import annotations

import random
from itertools import pairwise
from pathlib import Path

import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from mavlink_wire import Wire, unknown_frame

from fwav_companion.mavlink.wire.scanner import BURST, MAX_FLOWS, TRIALS_PER_KIB, Scanner
from tests.benchmarks.adversary import CHUNK, patterns, scan

CORPUS = sorted((Path(__file__).parent / "corpus").glob("*.bin"))
LONGEST = 280


def scanned(data: bytes, cuts: list[int] | None = None) -> list[bytes]:
    """The frames of a stream that is then quiet, divided at the given places."""
    scanner = Scanner()
    edges = [0, *sorted(cut % (len(data) + 1) for cut in cuts or []), len(data)]
    frames = [frame for start, end in pairwise(edges) for frame in scanner.feed(data[start:end])]
    return [frame.data for frame in frames + scanner.settle()]


def good_frames(count: int = 40) -> list[bytes]:
    one, two, old = Wire(1, 1), Wire(255, 190), Wire(3, 1, version=1)
    makers = (one.attitude, one.heartbeat, two.heartbeat, old.attitude, lambda: two.command(1, 1))
    return [makers[i % len(makers)]() for i in range(count)]


def is_subsequence(wanted: list[bytes], found: list[bytes]) -> bool:
    rest = iter(found)
    return all(any(frame == other for other in rest) for frame in wanted)


@pytest.mark.parametrize("path", CORPUS, ids=lambda path: path.stem)
@pytest.mark.parametrize("size", [1, 7, 256, 100_000])
def test_corpus(path, size) -> None:
    data = path.read_bytes()
    wanted = [bytes.fromhex(line) for line in path.with_suffix(".frames").read_text().split()]
    assert is_subsequence(wanted, scanned(data, list(range(0, len(data), size))))


def test_the_corpus_is_there() -> None:
    assert len(CORPUS) >= 12


def test_what_is_read_of_a_header() -> None:
    wire = Wire(7, 42)
    wire.heartbeat()
    (frame,) = Scanner().feed(wire.command(9, 11))
    assert (frame.msgid, frame.system, frame.component, frame.seq, frame.version) == (76, 7, 42, 1, 2)
    assert (frame.target_system, frame.target_component, frame.known, frame.signed) == (9, 11, True, False)


def test_truncated_target_bytes_are_zero() -> None:
    frame = Wire().frame("PARAM_REQUEST_LIST", 0, 0)
    assert frame[1] == 1
    (found,) = Scanner().feed(frame)
    assert (found.target_system, found.target_component) == (0, 0)
    (found,) = Scanner().feed(Wire().frame("PARAM_REQUEST_LIST", 5, 0))
    assert (found.target_system, found.target_component) == (5, 0)


def test_signed_frames_keep_their_signature() -> None:
    wire = Wire()
    wire.mav.signing.secret_key = b"k" * 32
    wire.mav.signing.sign_outgoing = True
    stream = [wire.attitude(), wire.heartbeat(), wire.attitude(2)]
    scanner = Scanner()
    frames = scanner.feed(b"".join(stream))
    assert [frame.data for frame in frames] == stream
    assert all(frame.signed for frame in frames)


pieces = st.one_of(
    st.sampled_from(good_frames(20)).map(lambda frame: (frame, True)),
    st.binary(max_size=40).map(lambda noise: (noise.replace(b"\xfd", b"\0").replace(b"\xfe", b"\0"), False)),
)


@given(st.lists(pieces, max_size=30), st.lists(st.integers(0, 5000), max_size=20))
def test_noise_without_start_bytes_costs_nothing(parts, cuts) -> None:
    wanted = [piece for piece, is_frame in parts if is_frame]
    assert scanned(b"".join(piece for piece, _ in parts), cuts) == wanted


hard = [
    b"\xfd\x20\0\0\0\1\1\xaa\xbb\xcc",
    b"\xfe\x0e\xfe\x0e\xfe\x0e",
    b"\xfd\x50\1\0\0\1\1\xaa\xbb\xcc",
    b"\xfd",
    b"\xfe\xfe",
]


@settings(max_examples=300)
@given(st.lists(st.sampled_from([*good_frames(6), *hard, unknown_frame(), b"noise"]), max_size=20),
       st.lists(st.integers(0, 5000), max_size=20))  # fmt: skip
def test_the_cuts_change_nothing_in_hard_streams(parts, cuts) -> None:
    data = b"".join(parts)
    assert scanned(data, cuts) == scanned(data) == scanned(data, list(range(len(data))))


@given(st.lists(st.one_of(st.binary(max_size=60), st.sampled_from(good_frames(20))), max_size=20),
       st.lists(st.integers(0, 5000), max_size=20))  # fmt: skip
def test_the_cuts_change_nothing(parts, cuts) -> None:
    data = b"".join(parts)
    assert scanned(data, cuts) == scanned(data) == scanned(data, list(range(len(data))))


@given(st.lists(st.one_of(st.binary(max_size=60), st.sampled_from([*good_frames(5), unknown_frame()])), max_size=20),
       st.lists(st.integers(0, 5000), max_size=20))  # fmt: skip
def test_every_byte_is_either_in_a_frame_or_counted_or_kept(parts, cuts) -> None:
    data = b"".join(parts)
    scanner = Scanner()
    edges = [0, *sorted(cut % (len(data) + 1) for cut in cuts), len(data)]
    frames = [frame for start, end in pairwise(edges) for frame in scanner.feed(data[start:end])]
    kept = len(scanner._pending)
    assert kept <= 2 * LONGEST
    assert sum(len(frame.data) for frame in frames) + scanner.skipped_bytes + kept == len(data)


def test_no_good_frame_is_lost_beside_a_corrupted_one() -> None:
    """10 200 good frames next to corrupted ones: a byte altered, lost or added anywhere in every seventh frame."""
    rng = random.Random(7)
    frames = [unknown_frame(seq=i % 256) if i % 50 == 25 else frame for i, frame in enumerate(good_frames(11_900))]
    stream, wanted = [], []
    for i, frame in enumerate(frames):
        if i % 7 == 3:
            stream.append(_corrupted(frame, rng))
        else:
            stream.append(frame)
            wanted.append(frame)
    assert len(wanted) == 10_200
    data = b"".join(stream)
    found = scanned(data, list(range(0, len(data), 256)))
    known = [frame for frame in wanted if frame[7:10] != b"\xef\xcd\xab"]
    assert is_subsequence(known, found)
    assert len(found) < 10_200 * 1.05


@pytest.mark.parametrize("datagrams", [False, True])
@pytest.mark.parametrize("name", patterns())
def test_the_trials_are_bounded_for_any_bytes(monkeypatch: pytest.MonkeyPatch, name: str, datagrams: bool) -> None:
    """Counted, not timed: headers that are examined one by one."""
    trials = 0
    examine = Scanner._frame_at

    def counted(scanner: Scanner, buffer: bytes, position: int) -> object:
        nonlocal trials
        trials += 1
        return examine(scanner, buffer, position)

    monkeypatch.setattr(Scanner, "_frame_at", counted)
    data = patterns()[name]
    scanner = scan(data, datagrams=datagrams)
    chunks = len(data) / CHUNK
    earned = BURST + TRIALS_PER_KIB * len(data) / 1024
    assert trials <= 1.1 * earned + 4 * chunks, "and a few where a chunk ends"
    assert scanner.skipped_bytes <= len(data)
    assert 0 <= scanner.shed_bytes <= scanner.skipped_bytes


def test_what_is_shed_costs_no_frame_of_a_known_sender() -> None:
    wire = Wire(1, 1)
    scanner = Scanner(datagrams=True)
    assert len(scanner.feed(wire.attitude())) == 1
    for number in range(2000):
        assert scanner.feed(b"\xfe" * 500) == []
        assert len(scanner.feed(wire.attitude(number))) == 1
    assert scanner.shed_bytes > 900_000


def test_noise_and_a_stream_of_which_half_is_corrupted_shed_nothing() -> None:
    rng = random.Random(4)
    noise = Scanner()
    for _ in range(2000):
        noise.feed(rng.randbytes(512))
    assert noise.shed_bytes == 0
    frames = [Wire(1, 1).attitude(i) for i in range(4000)]
    data = b"".join(_corrupted(frame, rng) if i % 2 else frame for i, frame in enumerate(frames))
    scanner = Scanner()
    found = [frame.data for at in range(0, len(data), 256) for frame in scanner.feed(data[at : at + 256])]
    assert is_subsequence(frames[:-2:2], found)
    assert scanner.shed_bytes == 0


def test_senders_beyond_the_table_forget_the_unused_ones_alone() -> None:
    wire, scanner = Wire(1, 1), Scanner(max_flows=64)
    for number in range(500):
        assert scanner.feed(wire.attitude(number) + Wire(2 + number % 250, number % 7).heartbeat())
        assert len(scanner._flows) <= 64
    assert scanner.shed_bytes == 0


def _corrupted(frame: bytes, rng: random.Random) -> bytes:
    at = rng.randrange(len(frame))
    kind = rng.choice(("altered", "lost", "added", "burst"))
    if kind == "lost":
        return frame[:at] + frame[at + 1 :]
    if kind == "added":
        return frame[:at] + bytes((rng.randrange(256),)) + frame[at:]
    width = 1 if kind == "altered" else 6
    noise = bytes(byte ^ rng.randrange(1, 256) for byte in frame[at : at + width])
    return frame[:at] + noise + frame[at + width :]


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


def unknown_header(length: int) -> bytes:
    return b"\xfd" + bytes((length, 0, 0, 0, 1, 1)) + b"\xaa\xbb\xcc"


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


def test_a_datagram_that_was_cut_off_does_not_hold_up_the_next() -> None:
    scanner = Scanner(datagrams=True)
    wire = Wire()
    assert scanner.feed(wire.attitude()[:15]) == []
    (frame,) = scanner.feed(wire.heartbeat())  # together they are shorter than what the first began
    assert frame.msgid == 0
    assert scanner.skipped_bytes == 15


def test_a_frame_split_over_two_datagrams_is_joined() -> None:
    scanner = Scanner(datagrams=True)
    data = Wire().attitude()
    assert scanner.feed(data[:20]) == []
    assert [frame.data for frame in scanner.feed(data[20:])] == [data]


def test_what_is_counted() -> None:
    scanner = Scanner()
    wire = Wire()
    bad = bytearray(wire.attitude())
    bad[20] ^= 1
    strange = bytearray(wire.attitude())
    strange[2] = 0x40
    scanner.feed(wire.heartbeat() + bytes(bad) + wire.heartbeat() + bytes(strange) + wire.heartbeat() + b"junk")
    scanner.feed(wire.heartbeat())
    assert (scanner.bad_checksums, scanner.not_understood) == (1, 1)
    assert scanner.skipped_bytes == len(bad) + len(strange) + 4


def test_a_reset_forgets_what_was_begun() -> None:
    scanner = Scanner()
    wire = Wire()
    scanner.feed(wire.attitude()[:30])
    scanner.reset()
    assert len(scanner.feed(wire.heartbeat())) == 1


RUN = b"\xfe\xe0" * 112 + Wire().attitude()
"""Unknown frames of MAVLink 1, each beginning inside the one before, and a known one that refutes them all."""


@pytest.mark.parametrize(
    "pattern", [b"\xfd", b"\xfe", b"\xfd\x00", b"\xfe\x0d", b"\xfd\x01\x00", b"\xfe\xff\xfd\x00\x00", RUN]
)
def test_hostile_patterns_cost_linear_time(pattern) -> None:
    """Counted, not timed: the number of checksums that are computed for a megabyte of the worst pattern."""
    scanner = Scanner()
    calls = 0
    plain = scanner._frame_at

    def counted(buffer, position):
        nonlocal calls
        calls += 1
        return plain(buffer, position)

    scanner._frame_at = counted
    for _ in range(20):
        scanner.feed(pattern * (5000 // len(pattern)))
    assert calls <= 3 * 100_000


def test_strangers_do_not_fill_the_table_of_flows() -> None:
    scanner = Scanner()
    for system in range(1, 101):
        for component in range(1, 101):
            scanner.feed(Wire(system, component).heartbeat())
    assert len(scanner._flows) <= MAX_FLOWS


@settings(max_examples=300)
@given(st.binary(max_size=2000), st.booleans())
def test_any_bytes(data, datagrams) -> None:
    scanner = Scanner(datagrams=datagrams)
    for start in range(0, len(data), 97):
        scanner.feed(data[start : start + 97])
    scanner.settle()
    assert len(scanner._pending) <= 2 * LONGEST


def test_datagrams_that_were_cut_off_cost_no_other_however_they_are_read_together() -> None:
    """Several datagrams may arrive in one read: a complete one after a truncated one is not discarded with it."""
    rng = random.Random(7)
    for _ in range(200):
        wire = Wire()
        scanner, whole, found = Scanner(datagrams=True), [], []
        datagrams = []
        for index in range(40):
            frame = wire.attitude(index) if index % 3 else wire.frame("FILE_TRANSFER_PROTOCOL", 0, 1, 1, bytes(251))
            cut = rng.random() < 0.3 and index < 36
            datagrams.append(frame[: rng.randrange(1, len(frame))] if cut else frame)
            whole += [] if cut else [frame]
        while datagrams:
            together = rng.choice((1, 1, 2, 3))
            found += scanner.feed(b"".join(datagrams[:together]))
            del datagrams[:together]
        # Two pieces may look like a frame of an unknown id, whose checksum cannot be verified.
        assert [frame.data for frame in found if frame.known] == whole
