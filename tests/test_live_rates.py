"""Message rates between the autopilot, the daemon and a ground station that wants others."""

import os
import re
import select
import threading
import time
import tty
from pathlib import Path

import pytest
from processes import GroundStation
from pymavlink.dialects.v20 import ardupilotmega as dialect
from sites import Site

from sitl_mock.codec import Listener, Speaker

ALL_STREAMS = 0
SHOWN = ("SYS_STATUS", "VFR_HUD", "BATTERY_STATUS", "RC_CHANNELS", "EKF_STATUS_REPORT")


@pytest.fixture
def site(tmp_path: Path):
    site = Site(tmp_path)
    yield site
    site.close()


def attitude_hz(ground: GroundStation, seconds: float = 2.0) -> float:
    """Rate of the quaternion at the ground station, Hz."""
    ground.listen_during(0.2)
    names = [message.get_type() for message in ground.listen_during(seconds)]
    return names.count("ATTITUDE_QUATERNION") / seconds


def ask_for_four_hz(site: Site) -> None:
    site.ground.beat()
    site.ground.send(dialect.MAVLink_request_data_stream_message(1, 1, ALL_STREAMS, 4, 1))


def hear_until_measured(site: Site, name: str, hz: float, within_s: float = 60.0) -> None:
    """Wait until the daemon measures the rate that it requested."""
    deadline = time.monotonic() + within_s
    measured = None
    while time.monotonic() < deadline:
        site.ground.listen_during(0.5)
        measured = (site.status()["rates"].get(name) or {}).get("measured_hz")
        if measured is not None and measured > 0.85 * hz:
            return
    pytest.fail(f"{name} came at {measured} of {hz} Hz")


FIRST_OFF = ("--first-timesync-off", "0.115")
TWO_TERMINALS = {
    "inav": (
        ("--autopilot", "inav"),
        r"not ready: attitude at ((9|1\d) Hz, wanted 100 Hz; the .* answers no|(4[5-9]|5\d) Hz, wanted 100 Hz: )",
    ),
    "betaflight": (
        ("--autopilot", "betaflight"),
        r"not ready: attitude at (9|1\d) Hz, wanted 100 Hz; the autopilot takes no rate requests",
    ),
    "mute": (
        ("--autopilot", "mute"),
        r"not ready: attitude at [345] Hz, wanted 100 Hz; the autopilot answers no rate request",
    ),
    "ack-only": (("--autopilot", "ack-only"), r"\bready: attitude (8|9|10)\d Hz"),
    "first-timesync-off": (FIRST_OFF, r"\bready: attitude (8|9|10)\d Hz"),
}
"""Arguments of the mock, and how readiness is reported, by name."""


@pytest.mark.slow
@pytest.mark.timeout(120)
@pytest.mark.parametrize("name", TWO_TERMINALS)
def test_two_terminals_bring_a_target_and_attitude_and_say_nothing_false(site: Site, name: str):
    """As the README starts them. A note about the load of this machine may be true."""
    words, readiness = TWO_TERMINALS[name]
    with site.service() as service, site.mock(*words):
        heard = site.ground.listen(until="CAMERA_TRACKING_GEO_STATUS", count=3)
        service.wait_for(r"ready: attitude .*\n", within_s=60.0)
        assert service.stop() == 0
    assert [m for m in heard if m.get_type() == "ATTITUDE" and m.get_srcComponent() in {1, 200}]
    assert "found target 1: " in service.said
    judged = [line for line in service.said.splitlines() if "ready: " in line]
    assert [line for line in judged if re.search(readiness, line)] == judged, judged
    said = [line for line in service.said.splitlines() if re.match("WARNING|ERROR", line)]
    assert [line for line in said if "ready: " not in line and "frames come faster" not in line] == []


@pytest.mark.slow
@pytest.mark.timeout(180)
def test_a_ground_stations_request_is_merged_with_ours(site: Site):
    """Before requests were merged it stopped here, and the station got 100 quaternions a second and no status."""
    with site.service() as service, site.mock("--scenario", "arducopter", seconds=120.0):
        site.ground.listen(until="CAMERA_TRACKING_GEO_STATUS")
        hear_until_measured(site, "ATTITUDE_QUATERNION", 100.0)
        ask_for_four_hz(site)
        heard = []
        for name in SHOWN:
            heard += site.ground.listen(until=name, count=5)
        service.wait_for("255/190 on ground asks the autopilot for message rates: merged with ours")
        assert "ATTITUDE_QUATERNION" not in {message.get_type() for message in heard}
        hear_until_measured(site, "ATTITUDE_QUATERNION", 100.0)
        traffic = {link["name"]: link for link in site.status()["traffic"]}
        assert traffic["ground"]["stopped"] == 0
        rows = {row["message"]: row["why"] for row in traffic["ground"]["thinning"]["messages"]}
        assert rows["ATTITUDE_QUATERNION"] == "only_ours"
        assert "asks the autopilot for other message rates" not in service.said
        assert service.stop() == 0


@pytest.mark.timeout(120)
def test_a_ground_stations_request_for_other_rates_stops_where_the_file_says_so(site: Site):
    site.replace('# forward_rate_requests = "merge"', "forward_rate_requests = false")
    with site.service() as service, site.mock("--scenario", "unbiased", seconds=60.0):
        site.ground.listen(until="CAMERA_TRACKING_GEO_STATUS")
        ask_for_four_hz(site)
        assert attitude_hz(site.ground) == pytest.approx(100.0, abs=12.0)
        time.sleep(1.1)
        traffic = {link["name"]: link for link in site.status()["traffic"]}
        assert traffic["ground"]["stopped"] == 1
        assert service.stop() == 0


@pytest.mark.timeout(120)
def test_where_it_may_pass_our_own_rates_are_asked_for_again_at_once(site: Site):
    site.replace('# forward_rate_requests = "merge"', "forward_rate_requests = true")
    with site.service() as service, site.mock("--scenario", "unbiased", seconds=60.0):
        site.ground.listen(until="CAMERA_TRACKING_GEO_STATUS")
        ask_for_four_hz(site)
        service.wait_for("255/190 on ground asks the autopilot for other message rates")
        assert attitude_hz(site.ground) == pytest.approx(100.0, abs=12.0)
        assert service.stop() == 0


def reaches_hz(site: Site, name: str, hz: float) -> bool:
    """Whether the service receives a message at this rate in one of twenty seconds: a busy machine starves the mock."""
    for _ in range(20):
        if site.status()["telemetry"]["rates_hz"][name] > hz:
            return True
        time.sleep(1.0)
    return False


@pytest.mark.timeout(120)
def test_a_slow_link_is_spared_what_it_names_and_nothing_else(site: Site):
    limits = "max_rate_hz = { ATTITUDE_QUATERNION = 5 }\nforward_rate_requests = true"
    site.replace('role = "gcs"', f'role = "gcs"\n{limits}')
    with site.service() as service, site.mock("--scenario", "unbiased", seconds=60.0):
        site.ground.listen(until="CAMERA_TRACKING_GEO_STATUS")
        heard = site.ground.listen_during(3.0)
        hz = {
            name: sum(m.get_type() == name for m in heard) / 3.0 for name in ("ATTITUDE_QUATERNION", "DISTANCE_SENSOR")
        }
        assert hz["ATTITUDE_QUATERNION"] == pytest.approx(5.0, abs=1.0)
        assert hz["DISTANCE_SENSOR"] == pytest.approx(10.0, abs=2.0)
        assert reaches_hz(site, "ATTITUDE_QUATERNION", 85.0)
        assert service.stop() == 0


def test_a_rate_for_a_message_that_does_not_exist_is_one_line_and_exit_2(site: Site):
    site.replace('role = "gcs"', 'role = "gcs"\nmax_rate_hz = { ATITUDE = 4 }')
    with site.service() as service:
        assert service.end() == 2
    assert service.said.count("\n") == 1
    assert 'fwav-companion.toml: [[link]] 2 "ground" max_rate_hz: no MAVLink message is called ATITUDE' in service.said
    assert 'did you mean "ATTITUDE"?' in service.said


class Radio:
    """The far end of a 57 600 baud line: reads at once, and keeps the bytes with their times."""

    def __init__(self) -> None:
        self._near, far = os.openpty()
        tty.setraw(far)
        self._far = far
        self.path = os.ttyname(far)
        self.heard: list = []
        self._listener, self._speaker = Listener(), Speaker(255, 190)
        self._stop = threading.Event()
        self._thread = threading.Thread(target=self._read)
        self._thread.start()

    def say(self, name: str, **fields: object) -> None:
        os.write(self._near, self._speaker.frame(name, fields))

    def wait_for(self, name: str, count: int, within_s: float = 60.0) -> None:
        deadline = time.monotonic() + within_s
        while sum(each.name == name for each in list(self.heard)) < count:
            assert time.monotonic() < deadline, f"{name}: not {count} within {within_s} s"
            time.sleep(0.05)

    def close(self) -> None:
        self._stop.set()
        self._thread.join()
        os.close(self._near)
        os.close(self._far)

    def _read(self) -> None:
        while not self._stop.is_set():
            if select.select([self._near], [], [], 0.1)[0]:
                self.heard += self._listener.feed(os.read(self._near, 4096))


@pytest.mark.slow
@pytest.mark.timeout(300)
def test_a_serial_radio_is_not_filled_and_its_commands_and_parameters_arrive(site: Site):
    """PX4 streams 26 kB/s; 57 600 baud carry 5.76."""
    radio = Radio()
    site.replace(f"udpout://127.0.0.1:{site.ground.port}", f"serial://{radio.path}:57600")
    more = ("--set", "autopilot.more_parameters=300", "--set", "autopilot.parameter_interval_s=0.002")
    try:
        with site.service() as service, site.mock("--scenario", "px4_onboard", *more, seconds=200.0):
            radio.wait_for("VFR_HUD", 10)
            dropped = site.status()["links"]["ground"]["dropped"]  # while the port was being opened
            for _ in range(10):
                radio.say(
                    "COMMAND_LONG", target_system=1, target_component=1, command=400, confirmation=0,
                    **{f"param{i}": 0.0 for i in range(1, 8)},
                )  # fmt: skip
            radio.say("PARAM_REQUEST_LIST", target_system=1, target_component=1)
            radio.wait_for("COMMAND_ACK", 10)
            radio.wait_for("PARAM_VALUE", 303)
            began, before = time.monotonic(), site.status()["links"]["ground"]["bytes_out"]
            radio.wait_for("VFR_HUD", 60)
            (ground,) = [link for link in site.status()["traffic"] if link["name"] == "ground"]
            assert ground["thinning"]["max_bytes_per_s"] == pytest.approx(0.7 * 5760)
            assert ground["thinning"]["why"] == "max_bytes_per_s"
            after = site.status()["links"]["ground"]
            elapsed_s = time.monotonic() - began
            assert after["dropped"] == dropped
            assert after["bytes_out"] - before <= 0.7 * 5760 * (elapsed_s + 3.0), "the status is up to a second old"
            assert service.stop() == 0
    finally:
        radio.close()
