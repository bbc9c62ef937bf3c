"""Targets as Cursor on Target over UDP."""

from __future__ import annotations

import argparse
import asyncio
import socket
import xml.etree.ElementTree as ET

from cot_schema import complaints
from tak_server import Authority, TakServer, p12, pem

from fwav_companion.cli import ground
from fwav_companion.cli.ground_inputs import make_inputs
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


def test_flags_send_all_vehicles_and_targets_over_tls(tmp_path):
    """`ground` is the sender in place of the vehicles: the same keys by flags, events by the schema."""
    authority = Authority()
    certificate, key = authority.issue("unit")
    (tmp_path / "ca.pem").write_bytes(pem(authority.certificate))
    (tmp_path / "unit.p12").write_bytes(p12(certificate, key, "atakatak"))
    (tmp_path / "password").write_text("atakatak")
    picture = GroundPicture()
    for number in (1, 2):
        heard = {"autopilot": NOW, "position": NOW}
        picture.on_vehicle(str(number), NOW, heard=heard, lat=48.1, lon=11.5, alt_amsl=500.0)
        picture.on_target(
            TargetView(id=f"{number}/7", vehicle=str(number), track="7", label="person", state="confirmed", lat=48.1,
                       lon=11.5, alt_amsl=480.0, first_unix=NOW, seen_unix=NOW, source="mavlink"), NOW,
        )  # fmt: skip
    with TakServer(tmp_path, authority, *authority.issue("tak.example")) as server:
        parser = argparse.ArgumentParser()
        ground.add_parser(parser.add_subparsers())
        flags = {"client-cert": "unit.p12", "password-file": "password", "ca": "ca.pem"}
        words = ["ground", "--link", "udpin://127.0.0.1:1", "--cot", f"tls://127.0.0.1:{server.port}"]
        words += [word for name, file in flags.items() for word in (f"--cot-{name}", str(tmp_path / file))]
        inputs, _ = make_inputs(parser.parse_args(words), picture, lambda: NOW)
        (output,) = [each for each in inputs if isinstance(each, MapOutput)]
        output._utc_ns = lambda: round(NOW * 1e9)  # this machine's clock may be anything

        async def run():
            output.start()
            async with asyncio.timeout(20):
                second = 0
                while len(server.events) < 8:
                    output.tick(NOW + 0.01 * (second := second + 10))
                    await asyncio.sleep(0.02)
            output.close()

        asyncio.run(run())
        found = [each.partition(b"?>")[2] for each in server.events]
    names = {ET.fromstring(each).find("detail/contact").get("callsign") for each in found}
    assert names == {"UAV 1", "UAV 2", "person 1/7", "person 2/7"}
    assert [complaints(each) for each in found if complaints(each)] == []
