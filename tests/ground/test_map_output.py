"""Targets as Cursor on Target over UDP."""

from __future__ import annotations

import asyncio
import socket
import xml.etree.ElementTree as ET

from fwav_companion.ground.map_output import MapOutput
from fwav_companion.ground.picture import GroundPicture
from fwav_companion.ground.views import TargetView
from fwav_companion.links.map_server import MapServer

NOW = 1_790_000_000.0


def sent(utc_ns: int | None) -> tuple[list[bytes], GroundPicture]:
    """Datagrams of a picture with one target that lives, one that is lost and one that was dropped, and the picture."""
    picture = GroundPicture()
    for number, state in ((1, "confirmed"), (2, "lost"), (3, "dropped")):
        picture.on_target(
            TargetView(id=f"fleet/{number}", vehicle="fleet", track=str(number), label="person", state=state, lat=48.1,
                       lon=11.5, first_unix=NOW, seen_unix=NOW, source="fused"), NOW,
        )  # fmt: skip
    receiver = socket.socket(socket.AF_INET, socket.SOCK_DGRAM)
    receiver.bind(("127.0.0.1", 0))
    receiver.settimeout(0.5)
    found: list[bytes] = []

    async def run() -> None:
        server = MapServer(url=f"udpout://127.0.0.1:{receiver.getsockname()[1]}")
        output = MapOutput(server, picture, lambda: utc_ns, "unit")
        output.start()
        for second in range(100):
            output.tick(NOW + 2.0 * second)
            await asyncio.sleep(0.02)
            if picture.update_since(0, NOW).sources:
                break
        await asyncio.sleep(0.05)
        output.close()

    asyncio.run(run())
    try:
        while True:
            found.append(receiver.recv(65536))
    except TimeoutError:
        receiver.close()
    return found, picture


def test_each_target_is_an_event_also_a_lost_one():
    found, picture = sent(1_790_000_000 * 10**9)
    assert {ET.fromstring(each).get("uid") for each in found} == {
        "fwav-companion.unit.ground.fleet/1",
        "fwav-companion.unit.ground.fleet/2",
    }
    assert picture.update_since(0, NOW).sources[0].works


def test_without_utc_nothing_is_sent_and_that_is_reported():
    found, picture = sent(None)
    assert found == []
    assert "synchronise" in picture.update_since(0, NOW).sources[0].text
