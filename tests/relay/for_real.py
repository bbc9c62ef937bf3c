"""The same ten minutes over UDP, through the daemon as a process of its own, in real time; to be run by hand.

``python tests/relay/for_real.py [SECONDS]``
"""

from __future__ import annotations

import json
import os
import socket
import subprocess
import sys
import tempfile
import threading
import time
from collections import Counter
from pathlib import Path

sys.path.insert(0, str(Path(__file__).parents[1] / "support"))

from processes import free_port, process
from relay_story import COMPANION, LINKS, VEHICLE_LINKS, story
from wire_peers import HELLO

OURS = {COMPANION, (1, 100)}
LATEST_S = 2.0


class Peers:
    """A socket at the far end of each link, with the frames received there that are not the daemon's own."""

    def __init__(self) -> None:
        self.sockets = {link: socket.socket(socket.AF_INET, socket.SOCK_DGRAM) for link in LINKS}
        for sock in self.sockets.values():
            sock.bind(("127.0.0.1", 0))
            sock.setsockopt(socket.SOL_SOCKET, socket.SO_RCVBUF, 1 << 20)
        self.came: dict[str, Counter[bytes]] = {link: Counter() for link in LINKS}
        self.daemon: dict[str, tuple[str, int]] = {}
        for link in LINKS:
            threading.Thread(target=self._listen, args=(link,), daemon=True).start()

    def port(self, link: str) -> int:
        port: int = self.sockets[link].getsockname()[1]
        return port

    def _listen(self, link: str) -> None:
        while True:
            data, self.daemon[link] = self.sockets[link].recvfrom(65536)
            while data:
                frame, data = data[: data[1] + 12], data[data[1] + 12 :]
                if (frame[5], frame[6]) not in OURS:
                    self.came[link][frame] += 1


def configuration(peers: Peers, ports: dict[str, int]) -> str:
    links = [
        (link, f"udpin://127.0.0.1:{ports[link]}", "autopilot")
        if link in VEHICLE_LINKS
        else (link, f"udpout://127.0.0.1:{peers.port(link)}", "gcs")
        for link in LINKS
    ]
    link = '[[link]]\nname = "{}"\nurl = "{}"\nrole = "{}"\nforward_rate_requests = false\n'
    tables = "".join(link.format(*each) for each in links)  # nothing is thinned: the test is of the routing
    return f'[vehicle]\nsystem_id = 1\n{tables}[detections]\nurl = ""\n[status]\nfile = "status.json"\n'


def main(seconds: int) -> int:
    peers, ports = Peers(), {link: free_port() for link in VEHICLE_LINKS}
    with tempfile.TemporaryDirectory() as name:
        folder = Path(name)
        (folder / "relay.toml").write_text(configuration(peers, ports))
        with process("fwav_companion", "run", "--config", "relay.toml", folder=folder) as service:
            for link in LINKS:
                service.wait_for(f"link {link} is up")
            due = run(peers, ports, seconds)
            time.sleep(LATEST_S)
            usage = subprocess.run(
                ["ps", "-o", "rss=,cputimes=", "-p", str(service.pid)], capture_output=True, text=True, check=True
            ).stdout.split()
            traffic = json.loads((folder / "status.json").read_text())["traffic"]
            assert service.stop() == 0
    for link in LINKS:
        missing, more = due[link] - peers.came[link], peers.came[link] - due[link]
        print(f"{link}: due {due[link].total()}, missing {missing.total()}, not due {more.total()}")  # noqa: T201
    print(f"daemon: {int(usage[0]) / 1024:.1f} MiB, {int(usage[1])} s of CPU in {seconds} s")  # noqa: T201
    for link in traffic:
        print(link["name"], link["duplicates"], [(p["system"], p["component"], p["lost"]) for p in link["peers"]])  # noqa: T201
    return 0 if all(due[link] == peers.came[link] for link in LINKS) else 1


def run(peers: Peers, ports: dict[str, int], seconds: int) -> dict[str, Counter[bytes]]:
    """Send every frame at its time; returns the frames that are due on each link."""
    for link in VEHICLE_LINKS:
        peers.daemon[link] = ("127.0.0.1", ports[link])
        peers.sockets[link].sendto(HELLO, peers.daemon[link])  # a server answers clients that have sent a valid frame
    while len(peers.daemon) < len(LINKS):  # stations wait for the daemon's first heartbeat
        time.sleep(0.1)
    due: dict[str, Counter[bytes]] = {link: Counter() for link in LINKS}
    began = time.monotonic()
    for event in story(seconds):
        time.sleep(max(0.0, began + event.at_ms / 1000 - time.monotonic()))
        peers.sockets[event.link].sendto(event.frame, peers.daemon[event.link])
        for link in event.to:
            due[link][event.frame] += 1
    return due


if __name__ == "__main__":
    os._exit(main(int(sys.argv[1]) if len(sys.argv) > 1 else 600))
