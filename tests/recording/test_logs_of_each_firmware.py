"""ArduPilot's logs as each of its generations describes them, read and compared with pymavlink's reader.

The descriptions are those of libraries/AP_Logger/LogStructure.h and its neighbours in the releases named here.
"""

import math

import pytest
from autopilot_logs import DataFlash
from pymavlink import DFReader

from fwav_companion.geometry.rotations import euler_from_quaternion
from fwav_companion.recording.ardupilot_log import read_ardupilot_log
from fwav_companion.recording.log_messages import messages_of
from fwav_companion.recording.tlog import SkippedBytes

GYRO = "GyrX,GyrY,GyrZ,AccX,AccY,AccZ,EG,EA,T,GH,AH,GHz,AHz"
FILTER = "Roll,Pitch,Yaw,VN,VE,VD,dPD,PN,PE,PD,GX,GY,GZ,OH"
OLD = {
    "ATT": ("QccccCCCC", "TimeUS,DesRoll,Roll,DesPitch,Pitch,DesYaw,Yaw,ErrRP,ErrYaw"),
    "IMU": ("QffffffIIfBBHH", f"TimeUS,{GYRO}"),
    "NKF1": ("QccCfffffffccce", f"TimeUS,{FILTER}"),
    "POS": ("QLLfff", "TimeUS,Lat,Lng,Alt,RelHomeAlt,RelOriginAlt"),
    "GPS": ("QBIHBcLLefffB", "TimeUS,Status,GMS,GWk,NSats,HDop,Lat,Lng,Alt,Spd,GCrs,VZ,U"),
    "ORGN": ("QBLLe", "TimeUS,Type,Lat,Lng,Alt"),
}
FIRMWARES = {
    "Copter 3.6": OLD,
    "Copter 4.0": OLD | {"NKF1": ("QBccCfffffffccce", f"TimeUS,C,{FILTER}")},
    "Copter 4.3": OLD
    | {
        "ATT": ("QccccCCCCB", "TimeUS,DesRoll,Roll,DesPitch,Pitch,DesYaw,Yaw,ErrRP,ErrYaw,AEKF"),
        "IMU": ("QBffffffIIfBBHH", f"TimeUS,I,{GYRO}"),
        "XKF1": ("QBccCfffffffccce", f"TimeUS,C,{FILTER}"),
        "GPS": ("QBBIHBcLLeffffB", "TimeUS,I,Status,GMS,GWk,NSats,HDop,Lat,Lng,Alt,Spd,GCrs,VZ,Yaw,U"),
    },
}
FIRMWARES["Copter 4.6"] = FIRMWARES["Copter 4.3"] | {
    "ATT": ("QffffffB", "TimeUS,DesRoll,Roll,DesPitch,Pitch,DesYaw,Yaw,AEKF")
}
SEEN = {"Roll": 3.25, "Pitch": -11.5, "Yaw": 271.0, "VN": 4.0, "VE": -2.5, "VD": 0.25, "Lat": 48.1, "Lng": 11.5}
SEEN |= {"Alt": 531.25, "RelHomeAlt": 12.5, "GyrX": 0.125, "GyrY": -0.5, "GyrZ": 2.0, "GMS": 345_600_000, "GWk": 2400}
SEEN |= {"Status": 3}


def described(formats):
    log = DataFlash()
    for number, (name, (form, columns)) in enumerate(formats.items(), start=64):
        log.describe(name, number, form, columns)
    return log


def put(log, formats, name, time_us, **more):
    seen = {"TimeUS": time_us} | SEEN | more
    log.put(name, *(seen.get(column, 0) for column in formats[name][1].split(",")))


def flown(firmware):
    formats = FIRMWARES[firmware]
    log = described(formats)
    for step in range(50):
        for name in formats:
            put(log, formats, name, 1_000_000 + 20_000 * step)
    return log.data


@pytest.mark.parametrize("firmware", FIRMWARES)
def test_a_log_of_that_firmware_is_read_as_pymavlink_reads_it(tmp_path, firmware):
    data = bytes(flown(firmware))
    (tmp_path / "flight.bin").write_bytes(data)
    log, skipped = read_ardupilot_log(data)
    reader = DFReader.DFReader_binary(str(tmp_path / "flight.bin"))
    theirs = [m for m in iter(reader.recv_msg, None) if m.get_type() in ("ATT", "POS", "IMU", "GPS")]
    reader.data_map.close()
    reader.filehandle.close()
    assert skipped == []
    assert len(log.attitudes) + len(log.positions) + len(log.gps) == sum(m.get_type() != "IMU" for m in theirs)
    attitudes = [m for m in theirs if m.get_type() == "ATT"]
    for ours, message in zip(log.attitudes, attitudes, strict=True):
        angles = (math.degrees(angle) for angle in euler_from_quaternion(ours.ned_from_body))
        assert tuple(angles) == pytest.approx((message.Roll, message.Pitch, message.Yaw - 360.0))
        assert ours.rates == (SEEN["GyrX"], SEEN["GyrY"], SEEN["GyrZ"])
    assert [p.velocity_ned for p in log.positions] == [(SEEN["VN"], SEEN["VE"], SEEN["VD"])] * 50
    assert log.origin == pytest.approx((48.1, 11.5, 531.25))


def test_records_of_a_form_that_is_not_known_yet_are_passed_over():
    formats = OLD | {"NEW": ("Q?f", "TimeUS,What,Value")}
    log = described(OLD)
    body = b"\x80" + bytes((99, 3 + 13)) + b"NEW\0" + b"Q?f".ljust(16, b"\0") + b"TimeUS,What,Value".ljust(64, b"\0")
    log.data += b"\xa3\x95" + body
    for step in range(20):
        put(log, formats, "ATT", 1_000_000 + 20_000 * step)
        log.data += b"\xa3\x95\x63" + bytes(13)
    read, skipped = read_ardupilot_log(bytes(log.data))
    assert len(read.attitudes) == 20
    assert skipped == []


def test_half_a_record_before_zeros_is_not_believed():
    """A power cut leaves this on a card: the file has its length, its last sectors are missing."""
    log = described(OLD)
    for step in range(20):
        put(log, OLD, "ATT", 1_000_000 + 20_000 * step)
    whole, _ = read_ardupilot_log(bytes(log.data))
    start = len(log.data)
    put(log, OLD, "ATT", 1_400_000)
    read, skipped = read_ardupilot_log(bytes(log.data[: start + 14]) + bytes(500))
    assert read == whole
    assert skipped == [SkippedBytes(start, 514)]


def test_a_damaged_description_does_not_undo_a_good_one():
    log = described(OLD)
    put(log, OLD, "ATT", 1_000_000)
    log.data += bytes(described({"ATT": OLD["ATT"]}).data).replace(b"QccccCCCC", b"QccccCC\x03C")
    for step in range(20):
        put(log, OLD, "ATT", 1_020_000 + 20_000 * step)
    read, skipped = read_ardupilot_log(bytes(log.data))
    assert len(read.attitudes) == 21
    assert skipped == []


def test_velocities_come_from_positions_where_no_filter_reports_them():
    log = described(OLD)
    put(log, OLD, "ATT", 1_000_000)
    for step in range(20):
        put(log, OLD, "POS", 1_000_000 + 100_000 * step, Lat=48.1 + 9e-6 * step, Alt=531.0 + 0.5 * step)
    read, _ = read_ardupilot_log(bytes(log.data))
    reported = [fields for _, name, fields in messages_of(read) if name == "GLOBAL_POSITION_INT"]
    assert len(reported) == 20
    assert all(each["vx"] == pytest.approx(1000, abs=2) for each in reported), "9e-6 deg in 0.1 s are 10 m/s"
    assert all((each["vy"], each["vz"]) == (0, -500) for each in reported)
