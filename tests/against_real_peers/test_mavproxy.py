"""MAVProxy as the ground station, with its own pymavlink: it sees our components, and they do what it asks."""

import signal
import time
from pathlib import Path

import pytest
from processes import Process, process
from pymavlink import mavutil
from scipy.spatial.transform import Rotation
from sites import Site

from fwav_companion.recording.tlog import SkippedBytes, TlogRecord, read_tlog

SECONDS_S = 60.0


@pytest.fixture
def site(tmp_path: Path):
    site = Site(tmp_path)
    site.close()  # its port is MAVProxy's
    return site


def station(site: Site, mavproxy: tuple[str, str], *target: str, streamrate: int = -1) -> Process:
    return process(
        f"--master=udpin:127.0.0.1:{site.ground.port}",
        *target,
        "--default-modules=link,cmdlong,misc,output",
        *("--logfile=station.tlog", f"--state-basedir={site.folder}", f"--streamrate={streamrate}"),
        folder=site.folder,
        program=mavproxy,
    )


def heard(site: Site) -> list:
    """Everything in its log."""
    log = mavutil.mavlink_connection(str(site.folder / "station.tlog"))
    messages = []
    while (message := log.recv_match()) is not None:
        messages.append(message)
    log.close()
    return messages


def wait_until_logged(site: Site, wanted: tuple[str, int]) -> None:
    """MAVProxy writes its log behind, and a stop takes what it has not written."""
    for _ in range(100):
        if wanted in {(message.get_type(), message.get_srcComponent()) for message in heard(site)}:
            return
        time.sleep(0.2)
    pytest.fail(f"{wanted} never came into MAVProxy's log")


@pytest.mark.timeout(400)
def test_mavproxy_sees_the_vehicle_and_the_target_and_is_obeyed(site: Site, mavproxy: tuple[str, str]):
    to_camera = ("--target-system=1", "--target-component=100")
    with site.service() as service, station(site, mavproxy, *to_camera) as peer:
        service.wait_for("link ground is up")
        peer.wait_for("Waiting for heartbeat", SECONDS_S)  # the text about a target is sent once
        with site.mock("--scenario", "unbiased", seconds=60.0) as mock:
            peer.wait_for(r"Detected vehicle 1:1 on link 0", SECONDS_S)
            peer.wait_for(r"Detected vehicle 1:100 on link 0", SECONDS_S)
            peer.write_line("watch CAMERA_TRACKING_GEO_STATUS")
            peer.wait_for(r"CAMERA_TRACKING_GEO_STATUS {.*lat : 4813\d{5}", SECONDS_S)
            peer.write_line("watch CAMERA_INFORMATION")
            for _ in range(2):  # as ground stations do: a datagram may be lost
                peer.write_line("long 512 259")
            peer.wait_for(r"CAMERA_INFORMATION {", SECONDS_S)
            peer.write_line("watch COMMAND_ACK")
            for line, result in (("512 259", 0), ("CAMERA_STOP_TRACKING", 0), ("40999", 3)):
                number = {"CAMERA_STOP_TRACKING": 2010}.get(line, line.split()[0])
                peer.write_line(f"long {line}")
                peer.wait_for(rf"COMMAND_ACK {{command : {number}, result : {result},", SECONDS_S)
            peer.write_line("status")  # its counters of all messages, from every sender
            peer.wait_for(r"\d+: ATTITUDE {", SECONDS_S)  # the quaternion is only ours, and stays here
            wait_until_logged(site, ("CAMERA_INFORMATION", 100))
            peer.stop(signal.SIGINT)
            assert service.stop() == 0
            assert mock.stop() == 0
    messages = heard(site)
    names = {(message.get_type(), message.get_srcComponent()) for message in messages}
    assert {("ATTITUDE", 1), ("GLOBAL_POSITION_INT", 1), ("HEARTBEAT", 1)} <= names, "nothing was relayed"
    assert {("CAMERA_INFORMATION", 100), ("CAMERA_TRACKING_GEO_STATUS", 100)} <= names
    texts = [message.text for message in messages if message.get_type() == "STATUSTEXT"]
    assert any(text.startswith("found target 1: 48.1") for text in texts)
    beats = {
        (m.get_srcComponent(), m.type, m.autopilot, m.system_status) for m in messages if m.get_type() == "HEARTBEAT"
    }
    assert {(191, 18, 8, 4), (100, 30, 8, 4)} <= beats
    assert "fault" not in service.said
    ours = read_by_us(site)
    assert len(messages) - 1 <= len(ours), "all but one that MAVProxy's end may have cut"
    assert ours == [(round(m._timestamp * 1e6), bytes(m.get_msgbuf())) for m in messages[: len(ours)]]


@pytest.mark.slow
@pytest.mark.timeout(400)
def test_mavproxy_prints_our_texts_once_it_listens_to_every_component(site: Site, mavproxy: tuple[str, str]):
    """MAVProxy prints only the texts of the autopilot's component by default, as the README says."""
    with site.service() as service, site.mock("--scenario", "unbiased", seconds=60.0) as mock:
        service.wait_for("link ground is up")
        with station(site, mavproxy) as peer:
            peer.wait_for("online system 1", SECONDS_S)
            service.wait_for("ready: ")
            assert "AP: ready" not in peer.said
            peer.write_line("set target_component 0")
            assert mock.stop() == 0
            peer.wait_for("AP: autopilot lost: ", SECONDS_S)
            peer.stop(signal.SIGINT)
        assert service.stop() == 0


@pytest.mark.slow
@pytest.mark.timeout(400)
def test_mavproxy_gets_its_streams_of_an_autopilot_that_sends_nothing_by_itself(site: Site, mavproxy: tuple[str, str]):
    """It asks for all groups at 4 Hz, again every 15 s; our own rates stay where they are."""
    shown = ("SYS_STATUS", "VFR_HUD", "BATTERY_STATUS", "RC_CHANNELS", "EKF_STATUS_REPORT", "GPS_RAW_INT", "ATTITUDE")
    with site.service() as service, site.mock("--scenario", "arducopter", seconds=240.0) as mock:
        service.wait_for("link ground is up")
        with station(site, mavproxy, streamrate=4) as peer:
            peer.wait_for(r"Detected vehicle 1:1 on link 0", SECONDS_S)
            service.wait_for(r"255/\d+ on ground asks the autopilot for message rates: merged with ours", SECONDS_S)
            for name in shown:
                wait_until_logged(site, (name, 1))
            time.sleep(16.0)  # until it has asked once more
            peer.stop(signal.SIGINT)
        rates = site.status()["rates"]
        assert service.stop() == 0
        assert mock.stop() == 0
    names = {message.get_type() for message in heard(site) if message.get_srcComponent() == 1}
    assert names >= set(shown)
    assert "ATTITUDE_QUATERNION" not in names
    assert rates["ATTITUDE_QUATERNION"]["measured_hz"] > 85.0
    assert rates["ATTITUDE_QUATERNION"]["undone_by"] is None


@pytest.mark.slow
@pytest.mark.timeout(400)
def test_mavproxy_takes_points_and_releases_the_mocks_gimbal(site: Site, mavproxy: tuple[str, str]):
    """By the commands of the gimbal manager's protocol, and by a region of interest, which only COMMAND_INT sets."""
    settings = ("gimbal.device_id=1", "gimbal.manager=true", "gimbal.yaw=vehicle", "draw_biases=false")
    mock = process(
        *("sitl_mock", "--connect", f"udpout:127.0.0.1:{site.ground.port}", "--seconds", "240"),
        *("--scenario", "gimbal", *(word for each in settings for word in ("--set", each))),
        folder=site.folder,
    )
    with station(site, mavproxy, "--target-system=1", "--target-component=1") as peer, mock as vehicle:
        peer.wait_for(r"Detected vehicle 1:1 on link 0", SECONDS_S)
        peer.write_line("watch GIMBAL_MANAGER_STATUS COMMAND_ACK")
        peer.write_line("long DO_GIMBAL_MANAGER_CONFIGURE 255 230 -1 -1 0 0 1")
        peer.wait_for(r"GIMBAL_MANAGER_STATUS {.*primary_control_sysid : 255, primary_control_compid : 230", SECONDS_S)
        peer.write_line("long DO_GIMBAL_MANAGER_PITCHYAW -40 25 nan nan 32 0 1")
        peer.wait_for(r"COMMAND_ACK {command : 1000, result : 0,", SECONDS_S)
        wait_until_gimbal_looks(site, -40.0, 25.0)
        peer.write_line("long DO_SET_ROI_LOCATION 0 0 0 0 48.1372 11.5756 519")
        peer.wait_for(r"COMMAND_ACK {command : 195, result : 4,", SECONDS_S)
        peer.write_line("command_int GLOBAL DO_SET_ROI_LOCATION 0 0 0 0 0 0 481372000 115756000 519")
        peer.wait_for(r"COMMAND_ACK {command : 195, result : 0,", SECONDS_S)
        peer.write_line("long DO_GIMBAL_MANAGER_CONFIGURE 0 0 -1 -1 0 0 1")
        peer.wait_for(r"(?s)primary_control_sysid : 255.*primary_control_sysid : 0, ", SECONDS_S)
        peer.stop(signal.SIGINT)
        vehicle.stop()


def wait_until_gimbal_looks(site: Site, pitch_deg: float, yaw_deg: float) -> None:
    """By the attitudes in MAVProxy's log, yaw from the vehicle."""
    for _ in range(100):
        looks = [message.q for message in heard(site) if message.get_type() == "GIMBAL_DEVICE_ATTITUDE_STATUS"]
        if looks:
            w, x, y, z = looks[-1]
            yaw, pitch, _ = Rotation.from_quat([x, y, z, w]).as_euler("ZYX", degrees=True)
            if (pitch, yaw) == pytest.approx((pitch_deg, yaw_deg), abs=1.0):
                return
        time.sleep(0.2)
    pytest.fail(f"the gimbal never looked at {pitch_deg}, {yaw_deg}")


def read_by_us(site: Site) -> list[tuple[int, bytes]]:
    """Its log by our own reader: each frame with its stamp, and nothing skipped before the end."""
    data = (site.folder / "station.tlog").read_bytes()
    items = list(read_tlog(data))
    damaged = [item for item in items if isinstance(item, SkippedBytes)]
    assert all(each.offset + each.length == len(data) for each in damaged)
    return [(item.unix_us, item.frame) for item in items if isinstance(item, TlogRecord)]
