"""A .tlog of a stranger, replayed: damaged bytes, and whole frames with values that no autopilot has.

The command answers, or says in one line what is wrong; what it writes has only finite numbers.
"""

from __future__ import annotations

import json
import math
import random
from collections.abc import Callable
from pathlib import Path

import pytest
from commands import run_command
from flying import CAMERA, LINK
from pymavlink.dialects.v20 import ardupilotmega as dialect
from pymavlink.generator.mavcrc import x25crc

from fwav_companion.recording.tlog import TlogRecord, read_tlog, tlog_record
from sitl_mock import scenario
from sitl_mock.service import flown_files

SECONDS = 8.0
MUTATIONS = 12
WORDS = [bytes.fromhex(word) for word in ("ffffffff", "00000000", "0000c07f", "0000807f", "ffff7f7f", "00000080")]
"""The largest and no unsigned number, NaN, infinity, the largest float, the least integer; little-endian."""
REPLAY = ("replay", "--telemetry", "m.tlog", "--detections", "d.jsonl", "--config", "c.toml", "--out", "t.jsonl")


@pytest.fixture(scope="module")
def flown() -> tuple[bytes, bytes]:
    """Telemetry and detections of a flight that finds its target."""
    _, (telemetry, detections, _) = flown_files(scenario("unbiased").but({"seconds": SECONDS}), {})
    return telemetry, detections


@pytest.fixture
def folder(flown: tuple[bytes, bytes], tmp_path: Path) -> Path:
    (tmp_path / "camera.yaml").write_text(CAMERA)
    (tmp_path / "c.toml").write_text(LINK + '[camera]\ncalibration = "camera.yaml"\n')
    (tmp_path / "d.jsonl").write_bytes(flown[1])
    return tmp_path


def damaged(data: bytes, rng: random.Random) -> bytes:
    """Many bytes replaced, some removed, sometimes the end cut off."""
    changed = bytearray(data)
    for _ in range(rng.choice((1, 20, 400))):
        changed[rng.randrange(len(changed))] = rng.randrange(256)
    at = rng.randrange(len(changed))
    del changed[at : at + rng.choice((0, 1, 7, 300))]
    return bytes(changed[: rng.randrange(1, len(changed))] if rng.random() < 0.2 else changed)


def forged(data: bytes, rng: random.Random) -> bytes:
    """Some messages with a word of nonsense in a share of their frames, under a right checksum."""
    records = [record for record in read_tlog(data) if isinstance(record, TlogRecord)]
    ids = sorted({record.frame[7] for record in records})
    chosen, share = set(rng.sample(ids, rng.randint(1, len(ids)))), rng.choice((0.02, 0.3, 1.0))
    return b"".join(
        tlog_record(
            record.unix_us, with_word(record.frame, rng) if of_chosen(record, chosen, share, rng) else record.frame
        )
        for record in records
    )


def of_chosen(record: TlogRecord, chosen: set[int], share: float, rng: random.Random) -> bool:
    return record.frame[0] == 0xFD and record.frame[7] in chosen and rng.random() < share


def with_word(frame: bytes, rng: random.Random) -> bytes:
    """The frame with four bytes of its payload replaced."""
    length, msgid = frame[1], int.from_bytes(frame[7:10], "little")
    at = 10 + 4 * rng.randrange(max(1, length // 4))
    changed = (frame[:at] + rng.choice(WORDS) + frame[at + 4 : 10 + length])[: 10 + length]
    extra = bytes([dialect.mavlink_map[msgid].crc_extra])
    return changed + int(x25crc(changed[1:] + extra).crc).to_bytes(2, "little")


def replayed(folder: Path, telemetry: bytes) -> int:
    """Exit status of the command, whose words and numbers are judged here."""
    (folder / "m.tlog").write_bytes(telemetry)
    (folder / "t.jsonl").unlink(missing_ok=True)
    done = run_command(*REPLAY, folder=folder)
    assert done.returncode in (0, 2)
    assert "Traceback" not in done.stderr
    assert "internal" not in done.stderr
    if done.returncode == 2:
        assert len(done.stderr.splitlines()) == 1, done.stderr
        return 2
    for line in (folder / "t.jsonl").read_text().splitlines():
        json.loads(line, parse_constant=pytest.fail)
    return 0


def test_frame_is_forged_under_a_right_checksum(flown: tuple[bytes, bytes]) -> None:
    """Else the scanner would drop it, and nothing behind it would be tried."""
    parser = dialect.MAVLink(None)
    data = b"".join(forged(flown[0], random.Random(seed)) for seed in range(4))
    frames = [record.frame for record in read_tlog(data) if isinstance(record, TlogRecord)]
    values = [value for frame in frames for value in parser.decode(bytearray(frame)).to_dict().values()]
    assert not all(math.isfinite(value) for value in values if isinstance(value, float))


@pytest.mark.parametrize("mutate", [damaged, forged])
def test_replay_of_a_mutated_tlog_gives_an_answer_or_one_line(
    mutate: Callable[[bytes, random.Random], bytes], flown: tuple[bytes, bytes], folder: Path
) -> None:
    assert replayed(folder, flown[0]) == 0
    assert '"label":' in (folder / "t.jsonl").read_text()
    for number in range(MUTATIONS):
        replayed(folder, mutate(flown[0], random.Random(f"{mutate.__name__} {number}")))
