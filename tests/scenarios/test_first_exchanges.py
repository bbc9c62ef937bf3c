"""What leaves with a TIMESYNC request: nothing at first, and never anything behind it in its write."""

from __future__ import annotations

from merged_network import LINKS, MergedNetwork, Station

from sitl_mock import scenario
from sitl_mock.codec import Heard, Listener

OURS = (1, 191)
UNHELD = {"HEARTBEAT", "TIMESYNC", "REQUEST_MESSAGE"}
"""What may leave before three exchanges agree; REQUEST_MESSAGE are those for home and origin."""


def own_writes(network: MergedNetwork) -> list[tuple[float, list[Heard]]]:
    """(seconds, our frames in order) of each write to the autopilot that contains one."""
    heard = [(at_s, Listener().feed(data)) for at_s, data in network.to_autopilot]
    own = [(at_s, [each for each in write if (each.system, each.component) == OURS]) for at_s, write in heard]
    return [(at_s, write) for at_s, write in own if write]


def name_of(heard: Heard) -> str:
    return "REQUEST_MESSAGE" if heard.fields.get("command") == 512 else heard.name


def flown() -> MergedNetwork:
    station = Station("ground").ask_group(6.0, 0, 4)
    options = scenario("arducopter").but({"seconds": 16.0, "camera.enabled": False})
    return MergedNetwork(options, [station], text=f"{LINKS}[rates]\nattitude = 30.0\n").fly()


def test_timesync_is_the_last_frame_of_its_write_and_the_first_ones_have_the_link_to_themselves():
    writes = own_writes(flown())
    asked_s = [at_s for at_s, write in writes if any(heard.name == "TIMESYNC" for heard in write)]
    joined = [write for _, write in writes if len(write) > 1 and any(heard.name == "TIMESYNC" for heard in write)]
    assert len(asked_s) > 20
    assert joined, "a heartbeat and a request are due at one instant"
    assert all(write[-1].name == "TIMESYNC" for write in joined)
    first = [name_of(heard) for at_s, write in writes if at_s <= asked_s[2] for heard in write]
    assert set(first) <= UNHELD
