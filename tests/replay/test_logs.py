"""A mock flight as the autopilot's own log would have it, .bin and .ulg, replayed with detections made afterwards."""

import json

import pytest
from autopilot_logs import DataFlash, ulog, usual
from logged_flights import Flown, bin_log, final_error_m, on_boot, on_unix, px4_log, replayed

from fwav_companion.recording.tlog import tlog_record


@pytest.fixture(scope="module")
def flown():
    return Flown()


def recorded(boot_ns):
    """As the service records a frame with a boot time: it arrived by a wall clock that is 400 s off."""
    return on_boot(boot_ns) | {"received_unix": 1_790_000_400.0 + boot_ns / 1e9}


@pytest.mark.parametrize("stamp", [recorded, on_unix])
@pytest.mark.parametrize(("name", "make"), [("flight.bin", bin_log), ("flight.ulg", px4_log)])
def test_a_flight_that_people_already_have(tmp_path, flown, name, make, stamp):
    """From its first frame on: a log has one vehicle and a clock of its own, for which nothing waits."""
    (tmp_path / name).write_bytes(make(flown))
    ends = [json.dumps({"event": "end", "received_unix": 1.0})] if stamp is recorded else []
    text = "\n".join([*ends, flown.detections(stamp)])
    done, lines = replayed(tmp_path, tmp_path / name, text, "--set", "vehicle.system_id=7")
    summary = lines[-1]
    assert summary["dropped_frames"] == {}
    assert summary["fixes"] > 0.8 * summary["detections"]
    assert final_error_m(flown, lines) < 0.5
    assert "too slow" not in done.stderr


def test_a_log_whose_attitudes_are_too_slow_says_so(tmp_path, flown):
    (tmp_path / "flight.bin").write_bytes(bin_log(flown, att_hz=10.0))
    done, _ = replayed(tmp_path, tmp_path / "flight.bin", flown.detections(on_boot))
    assert "ATT comes at 10 Hz, which is too slow for this motion" in done.stderr


def test_damage_in_a_log_is_reported_with_its_offset(tmp_path, flown):
    data = bin_log(flown)
    at = data.index(b"\xa3\x95\x46", len(data) // 3)
    (tmp_path / "flight.bin").write_bytes(data[:at] + b"\0" * 7 + data[at:])
    done, _ = replayed(tmp_path, tmp_path / "flight.bin", flown.detections(on_boot))
    doubtful = data.rindex(b"\xa3\x95", 0, at)  # the record before may be half damage
    assert f"skipped {at + 7 - doubtful} damaged bytes at offset {doubtful}" in done.stderr


def test_frames_after_the_end_of_a_log_lack_an_attitude(tmp_path, flown):
    """Of a log that was cut: more frames than the reorder window takes."""
    (tmp_path / "flight.bin").write_bytes(bin_log(flown, att_hz=25.0))
    _, lines = replayed(tmp_path, tmp_path / "flight.bin", flown.detections(lambda boot_ns: on_boot(boot_ns + 10**11)))
    assert lines[-1]["dropped"] == {"stale_attitude": lines[-1]["detections"]}


def of_2014():
    log = usual(DataFlash())
    log.describe("ATT", 70, "IccccCC", "TimeMS,DesRoll,Roll,DesPitch,Pitch,DesYaw,Yaw")
    log.put("ATT", 95891, 0.0, -0.25, 0.0, 0.26, 189.54, 189.54)
    return bytes(log.data)


@pytest.mark.parametrize(
    ("name", "content", "said"),
    [
        ("empty.bin", bytes(usual(DataFlash()).data), "it has no readable attitude"),
        ("empty.ulg", ulog({}), "it has no readable attitude"),
        ("2014.bin", of_2014(), "times are TimeMS"),
        ("headless.bin", tlog_record(1, b"\xfd" + bytes(11)) * 2, "no readable MAVLink message in its 40 bytes"),
        ("text.log", b"ArduCopter V3.1\n\nFMT, 128, 89, FMT, BBnNZ, Type,Length,Name,Format\n", "as text"),
    ],
)
def test_a_log_without_a_flight_is_one_line_and_exit_2(tmp_path, name, content, said):
    (tmp_path / name).write_bytes(content)
    with pytest.raises(AssertionError, match=rf"{name}: .*{said}"):
        replayed(tmp_path, tmp_path / name, "")
