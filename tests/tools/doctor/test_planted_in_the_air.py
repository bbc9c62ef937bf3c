"""Faults planted in the mock, on its wire and in its detector: `check` names each, and nothing in a healthy set-up.

In invented time.
"""

import random

import msgspec
import pytest
from draws import first_of
from hearing import TEXT, Hearing, codes, evidence_of, flown, found, heard, silent
from mavlink_wire import Wire

from fwav_companion.config import parse
from fwav_companion.localization import ElevationTile
from fwav_companion.tools.doctor.examination import examine
from fwav_companion.tools.doctor.finding import Level
from fwav_companion.tools.doctor.run_status import run_status
from sitl_mock import scenario, simulate
from sitl_mock.autopilots import AUTOPILOTS

HEALTHY = scenario("unbiased").but({"seed": 3})


def test_a_healthy_set_up_has_nothing_to_change():
    assert examine(heard(HEALTHY)) == []


@pytest.mark.parametrize("name", first_of("default", "px4", "figure_eight", "old_ardupilot", few=2))
def test_other_healthy_vehicles_have_nothing_to_change(name):
    assert found(heard(scenario(name))) == []


VEHICLES = {
    "several_autopilots": {"others.second_vehicle": True},
    "attitude_slow": {"autopilot.firmware": "px4", "autopilot.true_ceiling_hz": 20.0},
    "loop_rate": {"autopilot.loop_rate_hz": 50.0},
    "pitch_trim": {"autopilot.has_quaternion": False, "autopilot.pitch_trim_deg": 5.0},
    "timesync_unanswered": {"autopilot.answers_timesync": False},
    "clock_followed": {"autopilot.clock_rate": 0.985},
    "no_detections": {"camera.enabled": False},
    "stale_detections": {"camera.stops_at_s": 6.0},
    "loss": {"downlink.loss": 0.1},
    "no_position": {"autopilot.gps": False},
    "long_round_trip": {"downlink.delay_s": 0.06},
}


@pytest.mark.parametrize("code", VEHICLES)
def test_a_fault_of_the_vehicle_is_named(code):
    findings = examine(heard(HEALTHY.but(VEHICLES[code])))
    assert code in codes(findings)
    assert all(finding.problem and finding.fix for finding in findings)


@pytest.mark.parametrize(
    ("autopilot", "hz", "fix"),
    [("betaflight", 10, "mavlink_extra1_rate = 50"), ("mute", 4, "our TX on its RX")],
)
def test_a_vehicle_that_takes_no_rate_requests_is_named_with_what_it_cannot_show(autopilot, hz, fix):
    findings = examine(heard(HEALTHY.but({**AUTOPILOTS[autopilot][1], "seconds": 14.0})))
    (finding,) = [each for each in findings if each.code == "rates_not_taken"]
    assert f"ATTITUDE at {hz} Hz as it comes; enough for a camera that swings below {hz / 10:g} Hz" in finding.problem
    assert fix in finding.fix
    assert "attitude_slow" not in codes(findings)


def test_a_vehicle_that_states_no_rates_and_grants_them_has_no_finding_about_rates():
    named = codes(examine(heard(HEALTHY.but(AUTOPILOTS["ack-only"][1]))))
    assert set(named) <= {"attitude_gap"}, "attitudes were slow while they were measured"


def test_a_vehicle_of_system_zero_is_named_where_another_system_is_configured():
    findings = examine(heard(HEALTHY.but(AUTOPILOTS["betaflight"][1]), ["vehicle.system_id=1"]))
    (finding,) = [each for each in findings if each.code == "other_autopilot"]
    assert finding.problem == "autopilot 0 is heard, and 1 is configured"
    assert finding.fix == "set [vehicle] system_id = 0, which adopts the one that is heard"


def nanoseconds(frame):
    return frame | {"time_monotonic": frame["time_monotonic"] * 1e9}


DETECTORS = {
    "wrong_units": nanoseconds,
    "wrong_size": lambda frame: frame | {"size": [1920, 1080]},
    "no_time": lambda frame: frame | {"time_unix": 1.0},
    "malformed": lambda frame: frame | {"detections": "none"},
    "from_the_future": lambda frame: frame | {"time_monotonic": frame["time_monotonic"] + 0.2},
    "too_late": lambda frame: frame | {"time_monotonic": frame["time_monotonic"] - 1.0},
    "too_many_detections": lambda frame: frame | {"detections": [{"u": 1.0, "v": 1.0}] * 257},
}


@pytest.mark.parametrize("code", DETECTORS)
def test_a_fault_of_the_detector_is_an_error(code):
    findings = examine(heard(HEALTHY, frame=DETECTORS[code]))
    assert codes(findings) == [code]
    assert findings[0].level is Level.ERROR


def test_frames_that_come_again_are_named():
    """A detector that reads its clock three times a second, and does not number its frames."""
    stuck = lambda frame: frame | {"frame": 7, "time_monotonic": int(frame["time_monotonic"] * 3.0) / 3.0}  # noqa: E731
    (finding,) = examine(heard(HEALTHY, ["camera.readout_s=0"], frame=stuck))
    assert (finding.code, finding.level) == ("duplicate_frame", Level.ERROR)


def test_a_wrong_baud_rate_is_named():
    noise = random.Random(1)
    assert found(heard(HEALTHY, on_the_way_in=lambda data: noise.randbytes(len(data))))[0] == "garbage"


def test_silence_is_named():
    assert found(silent()) == ["nothing_heard", "no_detections"]


def test_an_echo_of_our_own_bytes_is_named():
    assert found(heard(HEALTHY, crossed=True)) == ["echo"]


def test_frames_that_speak_as_the_autopilot_or_as_us_on_a_ground_link_are_named():
    hearing = flown(HEALTHY)
    later_ns = 10**13
    for second in range(15):
        hearing.hear("autopilot", Wire(1, 1).heartbeat(), later_ns + second * 10**9)
        hearing.hear("ground", Wire(1, 1).heartbeat() + Wire(1, 191).command(1, 1), later_ns + second * 10**9)
    assert {"own_ids_on_gcs", "id_conflict"} <= set(found(evidence_of(hearing)))


@pytest.mark.parametrize(("system", "expected"), [(0, ["neighbour"]), (1, [])], ids=["any", "configured"])
def test_a_second_vehicle_on_the_link_is_named_where_the_first_heard_is_used(system, expected):
    hearing = flown(HEALTHY, [f"vehicle.system_id={system}"])
    for second in range(15):
        for vehicle in (1, 2):
            hearing.hear("autopilot", Wire(vehicle, 1).heartbeat(), 10**13 + second * 10**9)
    assert [code for code in found(evidence_of(hearing)) if code == "neighbour"] == expected


def test_a_vehicle_that_is_not_the_configured_one_is_named():
    assert "other_autopilot" in found(heard(HEALTHY, ["vehicle.system_id=7"]))


def test_an_unsigned_autopilot_is_named_where_there_is_a_key():
    text = TEXT + '[signing]\nkey_file = "signing.key"\n[state]\ndirectory = "/var/lib/x"\n'
    assert "unsigned" in found(heard(HEALTHY, text=text, key=bytes(32)))


def test_a_link_with_a_ground_station_alone_is_named():
    hearing = Hearing()
    for second in range(10):
        hearing.hear("autopilot", Wire(255, 190).heartbeat(kind=6, autopilot=8), 10**9 * (second + 1))
    assert "no_autopilot" in found(evidence_of(hearing))


def test_the_station_that_takes_the_rates_away_is_named():
    """A ground station on our own link requests 2 Hz each second, as MAVProxy and Mission Planner do."""
    text = TEXT.replace('role = "gcs"', 'role = "gcs"\nforward_rate_requests = true')
    hearing, station = Hearing(text=text), Wire(255, 190)
    mock = simulate(HEALTHY.but({"seconds": 13.0}))
    asked_s = 0
    for now_ns, _ in mock.drive(hearing):
        if mock.flight_s(now_ns) > asked_s + 1:
            asked_s += 1
            frames = hearing.hear("ground", station.frame("REQUEST_DATA_STREAM", 1, 1, 0, 2, 1), now_ns)
            for frame in frames:
                mock.on_bytes(frame, now_ns)
    findings = {finding.code: finding for finding in examine(evidence_of(hearing))}
    assert "255/190 on ground" in findings["rates_undone"].problem


@pytest.mark.parametrize(("north_deg", "covered"), [(49.0, True), (48.0, False)])
def test_a_place_that_no_elevation_file_reaches_is_named(north_deg, covered):
    evidence = heard(HEALTHY)
    ground = '[ground]\nmodel = "terrain"\nterrain = ["N48E011.hgt"]\nterrain_datum = "egm96"\n'
    tile = ElevationTile(north_deg, 11.0, 0.1, 0.1, 11, 11, lambda row, column: 500.0, "N48E011.hgt")
    files = msgspec.structs.replace(evidence.files, elevation=(tile,))
    evidence = msgspec.structs.replace(evidence, config=parse(TEXT + ground, "flight.toml"), files=files)
    assert found(evidence) == ([] if covered else ["terrain_coverage"])
    assert covered or "N48E011.hgt" in examine(evidence)[0].fix


def test_errors_come_first():
    findings = examine(heard(HEALTHY.but({"autopilot.loop_rate_hz": 50.0, "camera.enabled": False})))
    levels = [finding.level for finding in findings]
    assert levels[0] is Level.ERROR
    assert levels == sorted(levels, key=list(Level).index)
    assert {Level.ERROR, Level.WARNING} <= set(levels)


def test_a_status_that_lacks_any_part_breaks_nothing():
    written = flown(HEALTHY).status()
    evidence = heard(HEALTHY)
    for key in list(written):
        without = {name: value for name, value in written.items() if name != key}
        examine(msgspec.structs.replace(evidence, status=run_status(without)))
    for status in (run_status(dict.fromkeys(written)), run_status({}), None):
        examine(msgspec.structs.replace(evidence, status=status))
