"""Memory of a pure relay, which must leave room for other programs on a board with 512 MB."""

import socket
import time
from pathlib import Path

from processes import free_port, process
from relay_story import story

MOST_MIB = 35.0


def test_a_pure_relay_is_small_and_stays_so(tmp_path: Path):
    port = free_port()
    (tmp_path / "relay.toml").write_text(
        f'[[link]]\nname = "a"\nurl = "udpin://127.0.0.1:{port}"\nrole = "autopilot"\n'
        f'[[link]]\nname = "g"\nurl = "udpin://127.0.0.1:{free_port()}"\nrole = "gcs"\n'
        f'[detections]\nurl = ""\n[status]\nfile = "{tmp_path}/status.json"\n'
    )
    with (
        socket.socket(socket.AF_INET, socket.SOCK_DGRAM) as vehicle,
        process("fwav_companion", "run", "--config", "relay.toml", folder=tmp_path) as service,
    ):
        service.wait_for("link a is up")
        for event in story(30):
            if event.link == "fc1":
                vehicle.sendto(event.frame, ("127.0.0.1", port))
                time.sleep(0.001)
        service.wait_for("autopilot found")
        pages = int(Path(f"/proc/{service.pid}/statm").read_text().split()[1])
        assert service.stop() == 0
    assert pages * 4096 / 2**20 < MOST_MIB
