"""The status file stays below 64 kB, whatever is heard: what is left out is counted."""

import json
import subprocess
import sys

from mavlink_wire import Wire

from fwav_companion.geometry.stamps import NS_PER_MS, NS_PER_S, HostNs
from fwav_companion.mavlink.router.node import LinkPolicy, Node
from fwav_companion.mavlink.router.statistics import MAX_LISTED_PEERS
from fwav_companion.pipeline.pipeline_factory import WANTED
from fwav_companion.service.status import MAX_STATUS_BYTES, encoded
from fwav_companion.types.flight_status import ClockReport
from fwav_companion.types.status import RunStatus

LINKS = (LinkPolicy("autopilot", "autopilot"), LinkPolicy("ground", "gcs", datagrams=True))


def heard(senders: int) -> RunStatus:
    node, now = Node(LINKS, WANTED), HostNs(NS_PER_S)
    node.adopt(1, 1)
    vehicle = Wire(1, 1)
    for number in range(senders):
        now = HostNs(now + 10 * NS_PER_MS)
        wire = Wire(2 + number % 250, number // 250)
        node.receive("autopilot", vehicle.heartbeat(), now)
        node.receive("ground", wire.heartbeat() + wire.attitude() + wire.command(1, 1) + bytes(2000), now)
    node.statistics(now)
    return RunStatus(traffic=node.statistics(HostNs(now + NS_PER_S)), clock=ClockReport(sigma_s=0.001))


def test_a_thousand_senders_are_listed_in_part_and_counted() -> None:
    status = heard(1000)
    data = encoded(status)
    assert len(data) <= MAX_STATUS_BYTES
    autopilot, ground = json.loads(data)["traffic"]
    assert [(peer["system"], peer["component"]) for peer in autopilot["peers"]] == [(1, 1)]
    assert len(ground["peers"]) == MAX_LISTED_PEERS // 2
    assert ground["peers_left_out"] > 100


def test_a_status_that_is_still_too_long_leaves_all_peers_out() -> None:
    status = heard(100)
    for link in status.traffic:
        for peer in link.peers:
            peer.rates_hz.clear()
            peer.rates_hz.update({f"MESSAGE_{number}": 1.0 for number in range(300)})
    data = encoded(status)
    assert len(data) <= MAX_STATUS_BYTES
    shown = json.loads(data)
    assert [link["peers"] for link in shown["traffic"]] == [[], []]
    assert shown["traffic"][0]["peers_left_out"] == 1
    assert shown["clock"]["sigma_s"] == 0.001


def test_the_vision_process_is_the_first_to_end_when_memory_is_short() -> None:
    code = "from fwav_companion.vision import worker; worker._offer_to_oom_killer()"
    look = "from pathlib import Path; print(Path('/proc/self/oom_score_adj').read_text())"
    done = subprocess.run([sys.executable, "-c", f"{code}; {look}"], capture_output=True, text=True, check=True)
    assert int(done.stdout) == 800
