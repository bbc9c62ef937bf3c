"""MAVSDK as the ground station: a decoder that shares no line with pymavlink, nor with us."""

import json
import re
import sys
import time
from collections import defaultdict
from math import cos, radians
from pathlib import Path
from typing import Any

import pytest
from processes import Process, process
from sites import Site

STATION = Path(__file__).with_name("mavsdk_station.py")
SECONDS_S = 60.0


@pytest.fixture
def site(tmp_path: Path):
    site = Site(tmp_path)
    site.close()  # its port is MAVSDK's
    return site


def station(site: Site) -> Process:
    url = f"udpin://127.0.0.1:{site.ground.port}"
    return process(url, folder=site.folder, program=(sys.executable, str(STATION)))


def command(component: int, number: int, *params: float) -> str:
    padded = [*params, *[0.0] * (7 - len(params))]
    named = {f"param{index}": value for index, value in enumerate(padded, start=1)}
    return json.dumps({"target_system": 1, "target_component": component, "command": number, "confirmation": 0} | named)


def heard(said: str) -> dict[tuple[str, int], list[dict[str, Any]]]:
    """The fields of every message, by name and component."""
    messages = defaultdict(list)
    for line in said.splitlines():
        if line.startswith('{"name"'):
            reported = json.loads(line)
            messages[reported["name"], reported["component"]].append(reported["fields"])
    return messages


@pytest.mark.timeout(300)
def test_mavsdk_sees_the_vehicle_and_the_target_and_is_obeyed(site: Site):
    with site.service() as service, station(site) as peer:
        service.wait_for("link ground is up")
        peer.wait_for(r'"listens": true', SECONDS_S)  # the text about a target is sent once
        with site.mock("--scenario", "unbiased", seconds=60.0) as mock:
            peer.wait_for(r'"system": true', SECONDS_S)
            peer.wait_for(r'"CAMERA_TRACKING_GEO_STATUS"(.|\n)*"CAMERA_TRACKING_GEO_STATUS"', SECONDS_S)
            peer.write_line(command(100, 512, 259.0))
            peer.wait_for(r'"answer": .*"command": 512, .*"result": 0,', SECONDS_S)
            peer.wait_for(r'"CAMERA_INFORMATION"', SECONDS_S)
            peer.write_line(command(100, 2010))
            peer.wait_for(r'"answer": .*"command": 2010, .*"result": 0,', SECONDS_S)
            peer.write_line(command(191, 40999))
            peer.wait_for(r'"answer": .*"command": 40999, .*"result": 3,', SECONDS_S)
            for component in (1, 191, 100):
                peer.wait_for(rf'"HEARTBEAT", "component": {component},', SECONDS_S)
            peer.stop()
            assert service.stop() == 0
            assert mock.stop() == 0
    messages = heard(peer.said)
    beats = {component: messages["HEARTBEAT", component][-1] for component in (1, 191, 100)}
    assert [(beats[c]["type"], beats[c]["autopilot"], beats[c]["system_status"]) for c in (191, 100)] == [
        (18, 8, 4),
        (30, 8, 4),
    ]
    assert messages["ATTITUDE", 1], "nothing was relayed"
    assert not messages["ATTITUDE_QUATERNION", 1], "only the service asked for it"
    _is_the_target(messages["CAMERA_TRACKING_GEO_STATUS", 100][-1], site.truth()[0]["targets"][0])
    image = messages["CAMERA_TRACKING_IMAGE_STATUS", 100][0]
    assert (image["tracking_status"], image["target_data"]) == (1, 4)
    assert 0.0 < image["point_x"] < 1.0
    assert image["rec_top_x"] is None, "NaN, which JSON does not have"
    information = messages["CAMERA_INFORMATION", 100][-1]
    assert information["flags"] & (512 | 1024 | 2048) == 512 | 1024 | 2048
    assert (information["resolution_h"], information["resolution_v"]) == (640, 480)
    assert any(text["text"].startswith("found target 1: 48.1") for text in messages["STATUSTEXT", 191])


@pytest.mark.slow
@pytest.mark.timeout(300)
def test_mavsdks_camera_plugin_finds_the_camera_its_stream_and_its_storage(site: Site):
    """By its own sequence of requests, old and new."""
    site.replace('video_uri = ""', 'video_uri = "rtsp://10.0.0.2:8554/live"')
    with site.service() as service, site.mock("--scenario", "unbiased", seconds=60.0) as mock:
        service.wait_for("link ground is up")
        program = (sys.executable, str(STATION.with_name("mavsdk_camera.py")))
        with process(f"udpin://127.0.0.1:{site.ground.port}", folder=site.folder, program=program) as peer:
            peer.wait_for(r'"stopped": true', SECONDS_S)
            peer.stop()
        assert service.stop() == 0
        assert mock.stop() == 0
    said = [json.loads(line) for line in peer.said.splitlines() if line.startswith("{")]
    reported = {name: value for line in said[:2] + said[3:] for name, value in line.items()}
    assert (reported["camera"], reported["vendor"], reported["model"]) == (100, "fwav-companion", "target localization")
    assert reported["size"] == [640, 480]
    assert (reported["mode"], reported["storage"], reported["video_on"]) == ("VIDEO", "NOT_SUPPORTED", False)
    assert said[2] == {
        "stream": 1,
        "uri": "rtsp://10.0.0.2:8554/live",
        "status": "IN_PROGRESS",
        "size": [640, 480],
        "fov_deg": pytest.approx(55.0),
    }


@pytest.mark.slow
@pytest.mark.timeout(300)
def test_mavsdk_gets_the_streams_that_it_asks_of_an_autopilot_that_sends_nothing_by_itself(site: Site):
    """By SET_MESSAGE_INTERVAL, which the autopilot answers; the service only merges."""
    wanted = {"SYS_STATUS": 1, "VFR_HUD": 74, "BATTERY_STATUS": 147, "RC_CHANNELS": 65, "EKF_STATUS_REPORT": 193}
    with site.service() as service, site.mock("--scenario", "arducopter", seconds=120.0) as mock:
        service.wait_for("origin 48")  # positions come, at our rate
        with station(site) as peer:
            peer.wait_for(r'"system": true', SECONDS_S)
            for name, number in wanted.items():
                peer.write_line(command(1, 511, float(number), 200_000.0))
                answers = peer.said.count('"command": 511')
                wait_for_count(peer, '"command": 511', answers + 1)
                wait_for_count(peer, f'"name": "{name}"', 10)
            rate = measured(site, "ATTITUDE_QUATERNION", 85.0)
            peer.stop()
        assert service.stop() == 0
        assert mock.stop() == 0
    messages = heard(peer.said)
    assert [line for line in peer.said.splitlines() if '"refused"' in line] == []
    assert messages["BATTERY_STATUS", 1][-1]["battery_remaining"] == 82
    assert not messages["ATTITUDE_QUATERNION", 1]
    assert not messages["GLOBAL_POSITION_INT", 1], "only the service asked for it"
    assert rate["undone_by"] is None


def measured(site: Site, name: str, least_hz: float) -> dict[str, Any]:
    """The service's own report of one of its rates, once at least ``least_hz`` is measured."""
    deadline = time.monotonic() + SECONDS_S
    while time.monotonic() < deadline:
        rate: dict[str, Any] = site.status()["rates"].get(name) or {}
        if (rate.get("measured_hz") or 0.0) > least_hz:
            return rate
        time.sleep(0.2)
    pytest.fail(f"{name} did not come at {least_hz} Hz")


def wait_for_count(peer: Process, text: str, count: int) -> None:
    """Wait until the text was printed ``count`` times; answers and messages are lines of their own."""
    peer.wait_for(rf"(?s)(?:{re.escape(text)}.*?){{{count}}}", SECONDS_S)


def _is_the_target(geo: dict[str, Any], true: dict[str, float]) -> None:
    north_m = (geo["lat"] / 1e7 - true["lat"]) * 111_320.0
    east_m = (geo["lon"] / 1e7 - true["lon"]) * 111_320.0 * cos(radians(true["lat"]))
    assert (abs(north_m), abs(east_m)) < (1.5, 1.5)
    assert geo["alt"] == pytest.approx(true["alt_amsl"], abs=1.0)
    assert 0.0 < geo["h_acc"] < 3.0
    assert geo["hdg"] is None, "of a target that stands still"
