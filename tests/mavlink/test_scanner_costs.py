"""What hostile bytes cost the scanner: counted checksums and bounded tables."""

from __future__ import annotations

import random

import pytest
from mavlink_wire import Wire
from scanned_streams import corrupted, is_subsequence

from fwav_companion.mavlink.wire import scanner as scanner_module
from fwav_companion.mavlink.wire.flow_table import MAX_FLOWS, FlowTable
from fwav_companion.mavlink.wire.frame_reader import read_frame
from fwav_companion.mavlink.wire.scanner import BURST, RESERVE, TRIALS_PER_KIB, Scanner
from tests.benchmarks.adversary import CHUNK, patterns, scan


@pytest.fixture
def trials(monkeypatch: pytest.MonkeyPatch) -> list[int]:
    """Positions whose headers are examined one by one: counted, not timed."""
    positions: list[int] = []

    def counted(buffer: bytes, position: int, flows: FlowTable) -> object:
        positions.append(position)
        return read_frame(buffer, position, flows)

    monkeypatch.setattr(scanner_module, "read_frame", counted)
    return positions


@pytest.mark.parametrize("datagrams", [False, True])
@pytest.mark.parametrize("name", patterns())
def test_the_trials_are_bounded_for_any_bytes(trials: list[int], name: str, datagrams: bool) -> None:
    data = patterns()[name]
    scanner = scan(data, datagrams=datagrams)
    chunks = len(data) / CHUNK
    earned = BURST + RESERVE + TRIALS_PER_KIB * len(data) / 1024
    assert len(trials) <= 1.1 * earned + 4 * chunks, "and a few where a chunk ends"
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


FALSE_HEADERS = {
    "start bytes": lambda rng: [rng.choice((0xFD, 0xFE))],
    "MAVLink 2": lambda rng: [0xFD, rng.randrange(256), rng.choice((0, 1, 7)), 0, 5, 1, 1, rng.randrange(256), 0, 0],
    "MAVLink 1": lambda rng: [0xFE, rng.randrange(256), 5, 1, 1, rng.randrange(256)],
    "of the vehicle's own message": lambda rng: [0xFD, rng.randrange(256), 0, 0, 5, 1, 1, 30, 0, 0],
}


@pytest.mark.parametrize("name", FALSE_HEADERS)
def test_a_vehicles_frames_are_found_between_floods_of_false_headers_on_its_own_line(trials, name) -> None:
    """On a serial line all bytes have one source: what is shed holds the vehicle's frames, too."""
    rng, wire, scanner = random.Random(7), Wire(1, 1), Scanner()
    sent = [wire.attitude(number) for number in range(300)]
    assert scanner.feed(sent[0]) != []
    stream = bytearray()
    for frame in sent[1:]:
        flood = bytearray()
        while len(flood) < 300:
            flood += bytes(FALSE_HEADERS[name](rng))
        stream += flood + frame
    found = []
    for at in range(0, len(stream), 64):
        found += [frame.data for frame in scanner.feed(bytes(stream[at : at + 64]))]
        assert len(scanner._pending) <= 2 * 280
    assert is_subsequence([frame for frame in found if frame in sent], sent)
    forged = name == "of the vehicle's own message"  # each of these takes a trial that a frame would need
    assert len(set(found) & set(sent)) >= (0.2 if forged else 0.95) * len(sent)
    assert scanner.shed_bytes > 0.5 * len(stream), "the flood exceeds what its bytes earn"
    assert len(trials) <= BURST + RESERVE + (TRIALS_PER_KIB / 1024 + 2 / 64) * len(stream), "two more a chunk"


def test_a_new_sender_is_heard_through_a_flood() -> None:
    """An autopilot that is switched on while something else sends start bytes to its port."""
    scanner = Scanner(datagrams=True)
    for _ in range(200):
        assert scanner.feed(b"\xfd" * 300) == []
    for component in range(1, 20):
        scanner.feed(b"\xfd" * 300)
        assert len(scanner.feed(Wire(1, component).heartbeat())) == 1


def test_noise_and_a_stream_of_which_half_is_corrupted_shed_nothing() -> None:
    rng = random.Random(4)
    noise = Scanner()
    for _ in range(2000):
        noise.feed(rng.randbytes(512))
    assert noise.shed_bytes == 0
    frames = [Wire(1, 1).attitude(i) for i in range(4000)]
    data = b"".join(corrupted(frame, rng) if i % 2 else frame for i, frame in enumerate(frames))
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


RUN = b"\xfe\xe0" * 112 + Wire().attitude()
"""Unknown frames of MAVLink 1, each beginning inside the one before, and a known one that refutes them all."""


@pytest.mark.parametrize(
    "pattern", [b"\xfd", b"\xfe", b"\xfd\x00", b"\xfe\x0d", b"\xfd\x01\x00", b"\xfe\xff\xfd\x00\x00", RUN]
)
def test_hostile_patterns_cost_linear_time(trials: list[int], pattern: bytes) -> None:
    scanner = Scanner()
    for _ in range(20):
        scanner.feed(pattern * (5000 // len(pattern)))
    assert 0 < len(trials) <= 3 * 100_000


def test_strangers_do_not_fill_the_table_of_flows() -> None:
    scanner = Scanner()
    for system in range(1, 101):
        for component in range(1, 101):
            scanner.feed(Wire(system, component).heartbeat())
    assert len(scanner._flows) <= MAX_FLOWS
