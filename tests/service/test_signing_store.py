"""The signing time over many restarts, clean and not: it never goes back, and it does not run away from UTC."""

from __future__ import annotations

import json
import random
from collections.abc import Callable
from pathlib import Path

import pytest
from pymavlink.dialects.v20 import ardupilotmega as dialect

from fwav_companion.config import Config, parse
from fwav_companion.geometry.stamps import NS_PER_S, HostNs
from fwav_companion.mavlink.wire.signing import SigningClock, timestamp_from_unix_ns
from fwav_companion.service.signing_store import SigningStore
from fwav_companion.types import Message, NoticeCode

START_UNIX_NS = 1_800_000_000 * NS_PER_S
UNITS_PER_S = 100_000
LINK = '[[link]]\nname = "a"\nurl = "udpin://127.0.0.1:14540"\nrole = "autopilot"\n'


class Board:
    """A board with its clocks and its disk: runs of the service one after the other."""

    def __init__(self, folder: Path, *, synchronised: bool) -> None:
        text = f'{LINK}[detections]\nurl = ""\n[signing]\n[state]\ndirectory = "{folder}"\n'
        self.config: Config = parse(text, str(folder / "f.toml"))
        self.file = folder / "signing.json"
        self.synchronised = synchronised
        self.now_ns = 100 * NS_PER_S
        self.used: list[int] = []
        self.notices: list[NoticeCode] = []

    @property
    def unix_ns(self) -> int:
        return START_UNIX_NS + self.now_ns

    def run(self, seconds: float, *, clean: bool, during: Callable[[SigningClock], None] | None = None) -> None:
        store = SigningStore(self.config, print, lambda: self.synchronised)
        writes: list[bytes] = []
        store._file.write = writes.append  # the disk, without its thread
        clock = SigningClock(store.starting_timestamp(self.unix_ns))
        store.begin(clock, HostNs(self.now_ns))
        if during is not None:
            during(clock)
        for step in range(round(seconds * 10)):
            self.used.append(clock.next(HostNs(self.now_ns)))
            if step % 10 == 0:
                self.notices += [each.code for each in store.tick(HostNs(self.now_ns), self.unix_ns)]
            self.now_ns += NS_PER_S // 10
        if clean:
            store._file.close = lambda _timeout_s: None
            store.close(0.0)
        self.file.write_bytes(writes[-1])

    def ahead_s(self) -> float:
        """How far the last used timestamp is ahead of UTC."""
        return (self.used[-1] - timestamp_from_unix_ns(self.unix_ns)) / UNITS_PER_S


@pytest.mark.parametrize("synchronised", [True, False])
def test_every_timestamp_is_greater_than_the_last_one_over_any_restarts(tmp_path: Path, synchronised: bool) -> None:
    board, rng = Board(tmp_path, synchronised=synchronised), random.Random(1)
    for _ in range(60):
        board.run(rng.choice((0.2, 1.0, 5.0, 90.0)), clean=rng.random() < 0.5)
        board.now_ns += rng.randrange(3 * NS_PER_S)
    assert all(a < b for a, b in zip(board.used, board.used[1:], strict=False))


@pytest.mark.parametrize("lives_s", [0.3, 2.0, 30.0])
def test_a_crash_loop_stays_within_a_minute_of_a_synchronised_clock(tmp_path: Path, lives_s: float) -> None:
    board = Board(tmp_path, synchronised=True)
    for _ in range(200):
        board.run(lives_s, clean=False)
        board.now_ns += NS_PER_S
        assert board.ahead_s() < 60.0
    assert NoticeCode.SIGNING_AHEAD not in board.notices


def test_without_a_synchronised_clock_a_crash_loop_runs_ahead_by_an_eighth_at_most(tmp_path: Path) -> None:
    board = Board(tmp_path, synchronised=False)
    began_ns = board.now_ns
    for _ in range(100):
        board.run(30.0, clean=False)
        board.now_ns += NS_PER_S
    assert board.ahead_s() < 0.13 * (board.now_ns - began_ns) / NS_PER_S


def test_clean_restarts_do_not_run_ahead(tmp_path: Path) -> None:
    board = Board(tmp_path, synchronised=False)
    for _ in range(12):
        board.run(5.0, clean=True)
        board.now_ns += NS_PER_S
    assert board.ahead_s() < 0.5


def test_a_stored_time_far_ahead_is_reported_once_and_never_stepped_back(tmp_path: Path) -> None:
    board = Board(tmp_path, synchronised=True)
    ahead = timestamp_from_unix_ns(board.unix_ns) + 1304 * UNITS_PER_S
    board.file.write_text(json.dumps(ahead))
    board.run(90.0, clean=True)
    assert board.notices == [NoticeCode.SIGNING_AHEAD]
    assert board.used[0] > ahead
    assert board.ahead_s() == pytest.approx(1304 - 90, abs=1.0), "it waits for UTC"


def test_a_clock_that_is_synchronised_later_is_followed(tmp_path: Path) -> None:
    board = Board(tmp_path, synchronised=False)
    board.file.write_text(json.dumps(1000))
    board.run(1.0, clean=True)
    assert board.ahead_s() < -1e6
    board.synchronised = True
    board.run(30.0, clean=True)
    assert board.ahead_s() == pytest.approx(0.0, abs=1.0)


def test_the_autopilots_signed_time_is_utc(tmp_path: Path) -> None:
    board = Board(tmp_path, synchronised=False)
    store = SigningStore(board.config, print, lambda: False)
    clock = SigningClock(0)
    store.begin(clock, HostNs(board.now_ns))
    fields = dialect.MAVLink_system_time_message(START_UNIX_NS // 1000, 5000)

    def signed_at(system: int, *, signed: bool) -> int:
        message = Message("SYSTEM_TIME", system, 1, "a", fields, signed)
        store.on_message(message, (1, 1), HostNs(board.now_ns))
        clock.limit = 1 << 48
        return clock.tick(HostNs(board.now_ns))

    assert signed_at(1, signed=False) < 1000
    assert signed_at(255, signed=True) < 1000
    assert signed_at(1, signed=True) == timestamp_from_unix_ns(START_UNIX_NS)
