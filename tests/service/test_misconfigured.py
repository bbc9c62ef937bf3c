"""`run` and `check` with an [act] follow_system_id that another sender has, as a user sees it."""

import json
import socket
import subprocess
import sys
from contextlib import contextmanager
from threading import Event, Thread

import pytest
from processes import STARTING_S
from pymavlink.dialects.v20 import ardupilotmega as dialect
from sites import Site

LINE = (
    "fwav-companion.toml: [act] follow_system_id = 17: another sender is heard with it; "
    "accepted: an id that no other sender has"
)


@pytest.fixture
def site(tmp_path):
    site = Site(tmp_path)
    with (tmp_path / "fwav-companion.toml").open("a") as file:
        file.write("[act]\nfollow_target = true\nfollow_system_id = 17\n")
    yield site
    site.close()


@contextmanager
def on_the_air(site, *, armed):
    """An autopilot, and a ground station of system 17 behind it."""
    vehicle, station = dialect.MAVLink(None, srcSystem=1, srcComponent=1), dialect.MAVLink(None, 17, 190)
    modes = (128, 4) if armed else (0, 3)
    beats = (
        (vehicle, dialect.MAVLink_heartbeat_message(2, 3, modes[0], 0, modes[1], 3)),
        (station, dialect.MAVLink_heartbeat_message(6, 8, 0, 0, 4, 3)),
    )
    stopped = Event()

    def send():
        with socket.socket(socket.AF_INET, socket.SOCK_DGRAM) as wire:
            while not stopped.wait(0.2):
                for sender, beat in beats:
                    wire.sendto(beat.pack(sender), ("127.0.0.1", site.autopilot_port))

    sender = Thread(target=send)
    sender.start()
    try:
        yield
    finally:
        stopped.set()
        sender.join()


def test_run_on_the_ground_ends_with_one_line_and_status_2(site):
    with on_the_air(site, armed=False), site.service() as service:
        assert service.end() == 2
    assert LINE in service.said.splitlines()[-1]
    assert "Traceback" not in service.said


def test_run_in_flight_goes_on_and_check_of_it_names_the_key(site):
    with on_the_air(site, armed=True), site.service() as service:
        service.wait_for("system 17 is heard")
        for _ in range(round(STARTING_S / 0.1)):
            if (site.folder / "status.json").exists() and site.status()["acting"]["follow_id_heard"]:
                break
            Event().wait(0.1)
        command = [sys.executable, "-m", "fwav_companion", "check", "--config", "fwav-companion.toml", "--json"]
        checked = subprocess.run(command, capture_output=True, text=True, cwd=site.folder, timeout=60, check=False)
        assert service.stop() == 0
    assert checked.returncode == 2
    assert LINE in checked.stderr
    findings = json.loads(checked.stdout.splitlines()[-1])["findings"]
    assert "follow_id_heard" in [each["code"] for each in findings]
