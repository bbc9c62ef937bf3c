"""Our reader of ArduPilot's logs against pymavlink's DFReader, and against damage."""

import math
import random

import pytest
from autopilot_logs import DataFlash, usual
from hypothesis import given, settings
from hypothesis import strategies as st
from pymavlink import DFReader

from fwav_companion.geometry.rotations import euler_from_quaternion
from fwav_companion.recording.ardupilot_log import GPS_EPOCH_UNIX_S, read_ardupilot_log
from fwav_companion.recording.dataflash import is_dataflash
from fwav_companion.recording.tlog import SkippedBytes

WEEK, MS = 2400, 345_600_000


def flight(seconds: float = 4.0, *, att_hz: float = 50.0, seed: int = 1) -> DataFlash:
    draw, log = random.Random(seed), usual(DataFlash())
    log.put("ORGN", 1_000_000, 0, 48.1, 11.5, 519.0)
    log.put("ORGN", 1_000_000, 1, 48.2, 11.6, 520.0)
    ticks = round(seconds * 400)
    for tick in range(ticks):
        now = 1_000_000 + tick * 2500
        if tick % round(400 / att_hz) == 0:
            log.put("IMU", now - 10, 0, *(draw.uniform(-1, 1) for _ in range(6)))
            log.put("IMU", now - 5, 1, 9, 9, 9, 9, 9, 9)
            log.put("ATT", now, 0, draw.uniform(-20, 20), 0, draw.uniform(-30, 30), 0, draw.uniform(0, 359), 0, 0)
        if tick % 16 == 0:
            log.put("XKF1", now - 3, 0, 1, 2, 3, *(draw.uniform(-5, 5) for _ in range(8)))
            log.put("XKF1", now - 2, 1, *(8,) * 11)
            log.put("POS", now, 48.1 + draw.uniform(0, 1e-3), 11.5, 531.25 + draw.random(), 12.5, 13.0)
            log.put("RFND", now, 0, draw.uniform(1, 30), 4, 25)
            log.put("RFND", now, 0, 99.0, 1, 25)
        if tick % 80 == 0:
            log.put("GPS", now + 900, 0, 3, MS + tick * 5 // 2, WEEK, 12, 0.8, 48.1, 11.5, 531.0)
            log.put("MSG", now, b"ArduCopter V4.5.7")
    return log


def theirs(data: bytes, path) -> dict[str, list]:
    path.write_bytes(data)
    reader = DFReader.DFReader_binary(str(path))
    messages: dict[str, list] = {}
    while (message := reader.recv_msg()) is not None:
        messages.setdefault(message.get_type(), []).append(message)
    reader.data_map.close()
    reader.filehandle.close()
    return messages


def test_it_reads_what_pymavlink_reads(tmp_path):
    data = bytes(flight().data)
    log, skipped = read_ardupilot_log(data)
    oracle = theirs(data, tmp_path / "flight.bin")
    assert is_dataflash(data)
    assert skipped == []
    assert log.attitude_source == "ATT"
    assert [a.boot_us for a in log.attitudes] == [m.TimeUS for m in oracle["ATT"]]
    for ours, message in zip(log.attitudes, oracle["ATT"], strict=True):
        roll, pitch, yaw = (math.degrees(angle) for angle in euler_from_quaternion(ours.ned_from_body))
        assert (roll, pitch, yaw % 360) == pytest.approx((message.Roll, message.Pitch, message.Yaw % 360), abs=1e-6)
    gyros = [m for m in oracle["IMU"] if m.I == 0]
    assert [a.rates for a in log.attitudes] == [pytest.approx((m.GyrX, m.GyrY, m.GyrZ)) for m in gyros]
    velocities = [m for m in oracle["XKF1"] if m.C == 0]
    for ours, message, velocity in zip(log.positions, oracle["POS"], velocities, strict=True):
        assert (ours.lat, ours.lon) == pytest.approx((message.Lat, message.Lng), abs=1e-9)
        assert (ours.alt_amsl_m, ours.height_above_home_m) == (message.Alt, message.RelHomeAlt)
        assert ours.velocity_ned == (velocity.VN, velocity.VE, velocity.VD)
    good = [m for m in oracle["RFND"] if m.Stat == 4]
    assert [r.distance_m for r in log.ranges] == pytest.approx([m.Dist for m in good])
    assert log.origin == (pytest.approx(48.1), pytest.approx(11.5), 519.0)
    assert log.gps[0].unix_us == (GPS_EPOCH_UNIX_S - 18 + WEEK * 604800) * 10**6 + MS * 1000


def test_a_faster_source_is_taken_where_att_is_slow():
    log = usual(DataFlash())
    for tick in range(400):
        now = 1_000_000 + tick * 20_000
        if tick % 5 == 0:
            log.put("ATT", now, 0, 1, 0, 2, 0, 3, 0, 0)
        log.put("AHR2", now, 10, 20, 30, 500.0, 48.1, 11.5, 1, 0, 0, 0)
    read, _ = read_ardupilot_log(bytes(log.data))
    assert read.attitude_source == "AHR2"
    assert len(read.attitudes) == 400


@pytest.mark.parametrize(("att_hz", "complains"), [(10.0, True), (100.0, False)])
def test_attitudes_too_slow_for_the_motion_are_reported(att_hz, complains):
    log = usual(DataFlash())
    for tick in range(round(20 * att_hz)):
        now_s = 1.0 + tick / att_hz
        pitch = 30.0 + 5.0 * math.sin(2 * math.pi * 5.3 * now_s)
        log.put("ATT", round(now_s * 1e6), 0, 0, 0, pitch, 0, 10, 0, 0)
    read, _ = read_ardupilot_log(bytes(log.data))
    reported = [complaint for complaint in read.complaints() if "too slow" in complaint]
    assert bool(reported) == complains
    assert not complains or "LOG_BITMASK" in reported[0]


def test_damage_is_skipped_and_reported_with_its_place():
    data = bytes(flight(1.0).data)
    whole, _ = read_ardupilot_log(data)
    at = data.index(b"\xa3\x95\x46", 5000)
    before = data.rindex(b"\xa3\x95\x4c", 0, at)  # the IMU's of the other instance, which is not read
    for garbage, start in ((b"\xa3\x95garbage\x00\xff", at), (b"garbage\xa3\x95\x00\xff", before)):
        log, skipped = read_ardupilot_log(data[:at] + garbage + data[at:])
        assert skipped == [SkippedBytes(start, at + 11 - start)], "what stands before damage may be half of it"
        assert log == whole


@pytest.mark.parametrize("cut", range(1, 60, 7))
def test_a_log_cut_off_is_read_to_its_last_whole_record(cut):
    data = bytes(flight(0.5).data)
    whole, _ = read_ardupilot_log(data)
    log, skipped = read_ardupilot_log(data[:-cut])
    assert whole.attitudes[: len(log.attitudes)] == log.attitudes
    assert sum(s.length for s in skipped) < 64 + 11


@settings(max_examples=60)
@given(st.binary(max_size=300), st.integers(0, 3000))
def test_no_bytes_break_the_reader(noise, at):
    data = bytearray(flight(0.05).data)
    at = min(at, len(data))
    data[at : at + len(noise)] = noise
    log, skipped = read_ardupilot_log(bytes(data))
    log.complaints()
    assert all(s.offset >= 0 and s.offset + s.length <= len(data) for s in skipped)
