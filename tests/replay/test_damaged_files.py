"""Files as cards and power cuts leave them: cut, flipped, zeroed, spliced. All readable parts are read, without a
crash.
"""

import random
import struct

import pytest
from autopilot_logs import DataFlash, ulog, usual
from flying import CAMERA, LINK
from mavlink_wire import Wire

from fwav_companion.camera import parse_calibration
from fwav_companion.config import parse
from fwav_companion.errors import InputFileError
from fwav_companion.recording.time_checks import timely
from fwav_companion.recording.tlog import SkippedBytes, tlog_record
from fwav_companion.replay import read_recording, read_telemetry, replay
from fwav_companion.replay.telemetry_files import load_telemetry

OWN = frozenset({191})
SECONDS, HZ = 3, 20
START_US = 1_790_000_000_000_000


def a_tlog():
    wire = Wire(1, 1)
    frames = (wire.frame("ATTITUDE", 1000 + 50 * step, 0.1, 0.2, 0.3, 0, 0, 0) for step in range(SECONDS * HZ))
    return b"".join(tlog_record(START_US + 50_000 * step, frame) for step, frame in enumerate(frames))


def a_bin():
    log = usual(DataFlash())
    for step in range(SECONDS * HZ):
        now = 1_000_000 + 50_000 * step
        log.put("IMU", now, 0, 0.1, 0.2, 0.3, 0, 0, 0)
        log.put("ATT", now, 0, 1.0, 0, 2.0, 0, 3.0, 0, 0)
        log.put("POS", now, 48.1, 11.5, 531.25, 12.5, 13.0)
    return bytes(log.data)


def a_ulg(seconds=SECONDS):
    times = [1_000_000 + 50_000 * step for step in range(seconds * HZ)]
    place = [("double", "lat"), ("double", "lon"), ("float", "alt")]
    return ulog(
        {
            "vehicle_attitude": ([("float[4]", "q")], [(t, 1.0, 0.0, 0.0, 0.0) for t in times]),
            "vehicle_global_position": (place, [(t, 48.1, 11.5, 531.25) for t in times]),
        }
    )


DAMAGED = "some of its messages are damaged and were left out"

WHOLE = {"tlog": a_tlog(), "bin": a_bin(), "ulg": a_ulg()}


def cut(data, draw):
    del data[draw.randrange(len(data)) :]


def flipped(data, draw):
    for _ in range(draw.choice((1, 3, 50))):
        data[draw.randrange(len(data))] ^= 1 << draw.randrange(8)


def spliced(data, draw):
    at = draw.randrange(len(data))
    data[at : at + draw.choice((0, 30, 900))] = draw.randbytes(draw.choice((1, 40, 1500)))


def zeroed(data, draw):
    """A sector, or everything to the end, as after a power cut on ext4."""
    at = draw.randrange(len(data))
    end = min(len(data), at + draw.choice((512, len(data))))
    data[at:end] = bytes(end - at)


def moved(data, draw):
    at = draw.randrange(len(data))
    piece = data[at : at + 1000]
    del data[at : at + 1000]
    to = draw.randrange(len(data) + 1)
    data[to:to] = piece


def claiming(data, draw):
    """Data with length fields beyond every limit."""
    for _ in range(10):
        at = draw.randrange(len(data))
        data[at : at + 2] = b"\xff" * len(data[at : at + 2])


@pytest.mark.parametrize("damage", [cut, flipped, spliced, zeroed, moved, claiming])
@pytest.mark.parametrize("kind", WHOLE)
def test_no_damage_breaks_a_reader(tmp_path, kind, damage):
    path, draw = tmp_path / f"flight.{kind}", random.Random(f"{kind} {damage.__name__}")
    path.write_bytes(WHOLE[kind])
    most = 2 * len(load_telemetry(path, OWN).messages)
    for _ in range(40):
        data = bytearray(WHOLE[kind])
        damage(data, draw)
        path.write_bytes(data)
        try:
            read = load_telemetry(path, OWN)
        except InputFileError:  # reported in one line, by name
            continue
        times = [unix_us for unix_us, _ in read.messages]
        assert times == sorted(times)
        assert len(times) <= most, "damage made messages"
        ends = [0, *(skipped.offset + skipped.length for skipped in read.skipped)]
        assert all(end <= skipped.offset for end, skipped in zip(ends, read.skipped, strict=False))
        assert ends[-1] <= len(data)


@pytest.mark.parametrize("kind", WHOLE)
def test_the_part_before_a_zeroed_tail_is_read_and_the_tail_is_reported(tmp_path, kind):
    path, data = tmp_path / f"flight.{kind}", WHOLE[kind]
    path.write_bytes(data)
    whole = load_telemetry(path, OWN).messages
    at = 2 * len(data) // 3
    path.write_bytes(data[:at] + bytes(len(data) - at))
    read = load_telemetry(path, OWN)
    attitudes = [sum("ATTITUDE" in message.name for _, message in messages) for messages in (whole, read.messages)]
    assert attitudes[1] > 0.55 * attitudes[0]
    if kind == "ulg":  # pyulog does not give the place
        assert DAMAGED in read.notes
        return
    (tail,) = read.skipped
    assert at - 130 < tail.offset <= at
    assert tail.offset + tail.length == len(data)


def test_a_time_of_another_day_is_outvoted_and_fills_nothing(tmp_path):
    data = bytearray(WHOLE["bin"])
    third = [at for at in range(len(data)) if data.startswith(b"\xa3\x95\x46", at)][30]
    data[third + 3 + 4] ^= 0x10  # of TimeUS: 19 hours
    (tmp_path / "flight.bin").write_bytes(data)
    read = load_telemetry(tmp_path / "flight.bin", OWN)
    times = [unix_us for unix_us, _ in read.messages]
    assert times[-1] - times[0] < (SECONDS + 1) * 1_000_000
    assert sum(message.name == "ATTITUDE_QUATERNION" for _, message in read.messages) == SECONDS * HZ - 1


RECORD = len(a_tlog()) // (SECONDS * HZ)


def restamped(shift_us):
    """The tlog with ``shift_us(number)`` added to the stamp of each record."""
    data = bytearray(WHOLE["tlog"])
    for number, at in enumerate(range(0, len(data), RECORD)):
        stamp_us = int.from_bytes(data[at : at + 8], "big") + shift_us(number)
        data[at : at + 8] = stamp_us.to_bytes(8, "big")
    return bytes(data)


@pytest.mark.parametrize("bit", [26, 32, 45, 50])
def test_a_flipped_bit_in_a_stamp_moves_one_message_and_no_other(bit):
    """By a minute to decades: afterwards time must neither stop nor run through years of replay."""
    whole = read_telemetry(WHOLE["tlog"]).messages
    read = read_telemetry(restamped(lambda number: (1 << bit) * (number == 20)))
    assert read.notes == []
    assert len(read.messages) == len(whole)
    assert [unix_us for unix_us, _ in read.messages[:20]] == [unix_us for unix_us, _ in whole[:20]]
    assert [unix_us for unix_us, _ in read.messages[21:]] == [unix_us for unix_us, _ in whole[21:]]


@pytest.mark.parametrize(("by_s", "at"), [(3 * 86_400, 20), (-86_400, 20), (56 * 365 * 86_400 - 10**9, 40)])
def test_a_recorder_whose_clock_was_set_gives_its_longest_part_and_says_where(by_s, at):
    """A board without a battery-backed clock does this when it finds the network."""
    shift_us = by_s * 1_000_000
    read = read_telemetry(restamped(lambda number: shift_us * (number >= at)))
    times = [unix_us for unix_us, _ in read.messages]
    count = max(at, SECONDS * HZ - at)
    assert count - 4 <= len(times) <= count + 4
    assert times[-1] - times[0] < (SECONDS + 1) * 1_000_000
    (note,) = read.notes
    offset = int(note.split("at offset ")[1].split(":")[0])
    assert abs(offset - at * RECORD) <= 4 * RECORD
    assert ("before" in note) == (at < SECONDS * HZ // 2)


@pytest.mark.parametrize("received", ["0", "1690000000", "99999999999"])
def test_an_arrival_of_another_year_does_not_make_a_replay_run_through_it(received):
    detections = f'{{"time_unix": 1790000001.0, "received_unix": {received}, "detections": []}}\n' * 3
    recording = read_recording(WHOLE["tlog"], detections.encode(), OWN)
    config = parse(LINK + '[camera]\ncalibration = "camera.yaml"\n', "flight.toml")
    lines = list(replay(recording, config, parse_calibration(CAMERA, "camera.yaml")))
    assert lines[-1].frames == 3
    assert len(lines) < 300


def test_times_that_their_neighbours_contradict_are_left_out():
    steady = list(range(0, 200_000_000, 10_000_000))  # rare messages, ten seconds apart, are equally valid
    assert timely(steady) == list(range(20))
    assert timely([*steady[:7], 9 * 10**11, *steady[7:]]) == [*range(7), *range(8, 21)]
    assert timely([5, 1, 3]) == [1, 2, 0], "a logger's queues put samples into the file late"
    assert timely([-300, -5, 149, 305]) == [2, 3], "before boot"
    assert timely([]) == []


FILLERS = {"zeros": bytes(300), "ones": b"\xff" * 300, "noise": random.Random(4).randbytes(300)}


@pytest.mark.parametrize("filler", FILLERS.values(), ids=FILLERS.keys())
def test_damage_inside_a_px4_log_costs_about_a_second_and_is_reported(tmp_path, filler):
    """By its SYNC messages, two a second."""
    data, path = bytearray(a_ulg(seconds=120)), tmp_path / "flight.ulg"
    path.write_bytes(data)
    whole = load_telemetry(path, OWN)
    assert DAMAGED not in whole.notes
    at = len(data) // 3
    data[at : at + len(filler)] = filler
    path.write_bytes(data)
    read = load_telemetry(path, OWN)
    assert DAMAGED in read.notes
    attitudes = [sum("ATTITUDE" in message.name for _, message in each.messages) for each in (whole, read)]
    assert attitudes[0] - 1.2 * HZ < attitudes[1] < attitudes[0]


def test_a_px4_log_that_ends_within_a_message_says_where(tmp_path):
    data = WHOLE["ulg"]
    (tmp_path / "flight.ulg").write_bytes(data[:-20])
    read = load_telemetry(tmp_path / "flight.ulg", OWN)
    assert read.skipped == [SkippedBytes(len(data) - 33, 13)]
    assert DAMAGED not in read.notes


def test_a_px4_log_whose_definitions_are_damaged_is_refused_in_one_line(tmp_path):
    """A definition that claims more bytes than the file has, where pyulog alone goes in circles."""
    data = bytearray(WHOLE["ulg"])
    first = 16 + 3 + 40
    data[first : first + 3] = b"\xff\xff\0"
    (tmp_path / "flight.ulg").write_bytes(data)
    with pytest.raises(
        InputFileError, match=r"flight\.ulg: its definitions are damaged near byte \d+; accepted: a PX4"
    ):
        load_telemetry(tmp_path / "flight.ulg", OWN)


def test_what_a_crash_appended_does_not_hide_the_flight(tmp_path):
    """PX4 appends its fault report to a log and writes into the flags where it begins."""
    data = WHOLE["ulg"]
    key = b"char[3] hardfault_plain"
    report = bytes([1, len(key)]) + key + b"bad"
    appended = struct.pack("<Hc", len(report), b"M") + report
    at = len(data) // 2
    for damage in (b"", bytes(200)):
        flagged = bytearray(data[:at] + damage + data[at:] + appended)
        flagged[16 + 3 + 8] = 1  # incompatible flag: data is appended
        flagged[16 + 3 + 16 : 16 + 3 + 24] = (len(flagged) - len(appended)).to_bytes(8, "little")
        (tmp_path / "flight.ulg").write_bytes(flagged)
        read = load_telemetry(tmp_path / "flight.ulg", OWN)
        assert (DAMAGED in read.notes) == bool(damage)
        assert read.skipped == []
        lost = 0.6 * HZ if damage else 0
        assert sum("ATTITUDE" in message.name for _, message in read.messages) >= SECONDS * HZ - lost


@pytest.mark.parametrize("filler", [b"\0", b"\xa3\x95", b"\xfd", b"D"])
@pytest.mark.parametrize("size", [1 << 17, pytest.param(1 << 20, marks=pytest.mark.slow)])
@pytest.mark.parametrize("kind", WHOLE)
def test_a_mebibyte_of_nothing_makes_nothing(tmp_path, kind, size, filler):
    """The test's own time limit applies."""
    path, data = tmp_path / f"flight.{kind}", WHOLE[kind]
    path.write_bytes(data)
    whole = load_telemetry(path, OWN).messages
    path.write_bytes(data + filler * (size // len(filler)))
    assert len(whole) - 1 <= len(load_telemetry(path, OWN).messages) <= len(whole)
