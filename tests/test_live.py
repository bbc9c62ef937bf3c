"""The daemon as a user runs it: a process of its own, real sockets, the mock as a second process."""

import json
import math
import os
import pty
import signal
import socket

import pytest
from draws import first_of
from processes import process
from sites import Site


@pytest.fixture
def site(tmp_path):
    site = Site(tmp_path)
    yield site
    site.close()


@pytest.mark.timeout(120)
def test_targets_of_the_mock_reach_a_ground_station(site: Site):
    with site.service() as service, site.mock("--scenario", "unbiased", "--seed", "2") as mock:
        heard = site.ground.listen(until="CAMERA_TRACKING_GEO_STATUS", count=30)
        status = json.loads((site.folder / "status.json").read_text())
        assert service.stop() == 0
        assert mock.stop() == 0
    geo = [message for message in heard if message.get_type() == "CAMERA_TRACKING_GEO_STATUS"][-1]
    target = site.truth()[0]["targets"][0]
    assert (geo.get_srcSystem(), geo.get_srcComponent()) == (1, 100)
    metres_per_degree = 111_320.0
    assert abs(geo.lat / 1e7 - target["lat"]) * metres_per_degree < 1.0
    assert abs(geo.lon / 1e7 - target["lon"]) * metres_per_degree * math.cos(math.radians(target["lat"])) < 1.0
    assert geo.alt == pytest.approx(target["alt_amsl"], abs=1.0)
    assert 0.0 < geo.h_acc < 3.0
    beats = {(m.get_srcComponent(), m.type) for m in heard if m.get_type() == "HEARTBEAT" and m.get_srcSystem() == 1}
    assert {(191, 18), (100, 30), (1, 16)} <= beats
    assert any(m.get_type() == "ATTITUDE" and m.get_srcComponent() == 1 for m in heard), "nothing was relayed"
    assert status["autopilot"]["system"] == 1
    assert status["internal_faults"] == 0
    assert not (site.folder / "status.json").exists()


@pytest.mark.timeout(120)
def test_the_terminal_shows_what_the_ground_station_shows(site: Site):
    """Found and ready, by name; and no alarm about an attitude that is not measured yet."""
    with site.service() as service, site.mock("--scenario", "unbiased", "--seed", "2", seconds=60.0):
        heard = site.ground.listen_for(lambda m: m.get_type() == "STATUSTEXT" and m.text.startswith("ready: "))
        service.wait_for("ready: ")
        assert service.stop() == 0
    texts = [message.text for message in heard if message.get_type() == "STATUSTEXT"]
    assert any(text.startswith("found target 1: ") for text in texts)
    assert "found target 1: " in service.said
    assert "no attitude" not in service.said
    assert not any("no attitude" in text for text in texts)


@pytest.mark.timeout(120)
@pytest.mark.parametrize("scenario", first_of("old_ardupilot", "unbiased", "px4"))
def test_every_landing_consumer_takes_what_is_sent(site: Site, scenario: str):
    site.replace("landing_target = false", "landing_target = true")
    site.replace('landing_label = ""', 'landing_label = "target"')
    site.replace("landing_max_sigma_m = 0.5", "landing_max_sigma_m = 3.0")
    with site.service() as service, site.mock("--scenario", scenario, "--set", "draw_biases=false") as mock:
        site.ground.listen(until="CAMERA_TRACKING_GEO_STATUS", count=25)
        assert service.stop() == 0
        assert mock.stop() == 0
    landing = site.truth()[-1]["landing"]
    assert landing["refused"] == {}
    assert landing["accepted"] > 20
    assert landing["mean_error_m"] < 0.8


def test_without_an_autopilot_it_says_in_one_line_what_it_waits_for(site: Site):
    with site.service() as service:
        service.wait_for("link ground is up")
        assert service.stop() == 0
    waiting = [line for line in service.said.splitlines() if "waiting" in line]
    assert len(waiting) == 1
    assert f"autopilot (udpin://127.0.0.1:{site.autopilot_port})" in waiting[0]


@pytest.fixture
def deaf_port():
    """A TCP port whose queue is full: connecting to it blocks until the caller gives up."""
    with socket.socket() as server:
        server.bind(("127.0.0.1", 0))
        server.listen(0)
        waiting = [socket.socket() for _ in range(8)]
        for each in waiting:
            each.setblocking(False)
            each.connect_ex(server.getsockname())
        yield server.getsockname()[1]
        for each in waiting:
            each.close()


@pytest.mark.parametrize("number", [signal.SIGTERM, signal.SIGINT, signal.SIGHUP], ids=["SIGTERM", "SIGINT", "SIGHUP"])
def test_it_stops_while_a_link_is_being_opened(site: Site, deaf_port: int, number: int):
    site.replace(f"udpin://127.0.0.1:{site.autopilot_port}", f"tcpout://127.0.0.1:{deaf_port}")
    with site.service() as service:
        service.wait_for("link ground is up")
        site.ground.listen(until="HEARTBEAT", count=2)
        status = json.loads((site.folder / "status.json").read_text())
        assert status["links"]["autopilot"]["state"] == "opening"
        assert service.stop(number, within_s=5.0) == 0
    assert "stopped" in service.said


@pytest.mark.timeout(120)
def test_it_flies_over_a_serial_line(site: Site):
    """A pseudo-terminal is a serial line to both ends; the mock's end is at the other side of a small relay of ours."""
    ours, theirs = pty.openpty()
    site.replace(f"udpin://127.0.0.1:{site.autopilot_port}", f"serial://{os.ttyname(theirs)}:921600")
    listener = socket.socket(socket.AF_INET, socket.SOCK_DGRAM)
    listener.bind(("127.0.0.1", site.autopilot_port))
    listener.setblocking(False)
    relay = Relay(ours, listener)
    with site.service() as service, site.mock("--scenario", "unbiased"), relay:
        site.ground.listen(until="CAMERA_TRACKING_GEO_STATUS", count=5)
        assert service.stop() == 0
    os.close(theirs)
    assert "autopilot found" in service.said


class Relay:
    """Bytes between a pty and a UDP socket, in a thread, until the block ends."""

    def __init__(self, terminal: int, udp: socket.socket) -> None:
        import threading

        self._terminal, self._udp = terminal, udp
        self._stop = threading.Event()
        self._thread = threading.Thread(target=self._run)

    def __enter__(self) -> None:
        self._thread.start()

    def __exit__(self, *_: object) -> None:
        self._stop.set()
        self._thread.join()
        self._udp.close()
        os.close(self._terminal)

    def _run(self) -> None:
        import select

        peer = None
        while not self._stop.is_set():
            for ready in select.select([self._terminal, self._udp], [], [], 0.1)[0]:
                if ready is self._udp:
                    data, peer = self._udp.recvfrom(65536)
                    os.write(self._terminal, data)
                elif peer is not None:
                    self._udp.sendto(os.read(self._terminal, 4096), peer)


def test_no_datagram_stops_the_service(site: Site):
    with site.service() as service:
        service.wait_for("link autopilot is up")
        with socket.socket(socket.AF_INET, socket.SOCK_DGRAM) as sender:
            for port in (site.autopilot_port, site.detections_port):
                for junk in (b"", b"\x00", b"\xfd" * 300, os.urandom(1400), b"[" * 5000, b'{"time_unix": NaN}'):
                    sender.sendto(junk, ("127.0.0.1", port))
        site.ground.listen(until="HEARTBEAT", count=2)
        assert service.stop() == 0
    assert "fault" not in service.said


@pytest.mark.parametrize(
    ("old", "new", "said"),
    [
        ("[tracking]", "[traking]", "tracking"),
        ("alpha = 0.125", "alpha = 12.5", "alpha"),
        ('"udpout://', '"carrier-pigeon://', "udpout://"),
        ('calibration = "camera.yaml"', 'calibration = "absent.yaml"', "absent.yaml"),
        ("landing_target = false", "landing_target = true", "landing_label"),
        ('role = "autopilot"', 'role = "gcs"', "autopilot"),
    ],
    ids=["unknown table", "range", "URL", "missing file", "landing without label", "no autopilot link"],
)
def test_a_wrong_configuration_is_one_line_and_exit_2(site: Site, old: str, new: str, said: str):
    site.replace(old, new)
    with site.service() as service:
        assert service.end() == 2
    assert service.said.count("\n") == 1
    assert "fwav-companion.toml" in service.said
    assert said in service.said


def test_a_missing_configuration_is_one_line_and_exit_2(tmp_path):
    with process("fwav_companion", "run", "--config", "absent.toml", folder=tmp_path) as service:
        assert service.end() == 2
    assert service.said == (
        "fwav-companion: absent.toml: No such file or directory; accepted: a configuration, as `init` writes one\n"
    )


def test_two_services_do_not_share_a_port_and_the_second_keeps_trying(site: Site):
    with site.service() as first:
        first.wait_for("link autopilot is up")
        with site.service() as second:
            second.wait_for("link autopilot is down: .*trying again")
            assert first.stop() == 0
            second.wait_for("link autopilot is up")
            assert second.stop() == 0
