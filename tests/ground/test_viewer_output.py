"""The picture over Foxglove's WebSocket, read by a client made from its public protocol."""

import asyncio
import contextlib
import json
import socket
import struct
from itertools import count

import aiohttp
import jsonschema
import pytest
from numpy.testing import assert_allclose
from processes import free_port
from pymap3d import geodetic2enu

from fwav_companion.errors import UserError
from fwav_companion.ground.picture import GroundPicture
from fwav_companion.ground.viewer_gate import MOST_VIEWERS, MOST_WAITING
from fwav_companion.ground.viewer_output import SENT, ViewerOutput
from fwav_companion.ground.views import EllipseView, TargetView
from fwav_companion.recording.exports.viewer_schemas import SCHEMAS, TOPICS

QUICK = aiohttp.ClientWSTimeout(ws_close=0.02)  # the server waits before it answers a close
NOW = 1_790_000_000.0
TICKS = count(0.0, 0.5)
UPGRADE = (
    b"GET / HTTP/1.1\r\nHost: x\r\nUpgrade: websocket\r\nConnection: Upgrade\r\n"
    b"Sec-WebSocket-Key: dGhlIHNhbXBsZSBub25jZQ==\r\nSec-WebSocket-Version: 13\r\n"
    b"Sec-WebSocket-Protocol: foxglove.sdk.v1\r\n\r\n"
)
MESSAGE = 1
"""Opcode of a binary message: then the subscription (uint32), the time (uint64, ns), the payload."""


def target(**changes):
    usual = {
        "id": "1.7", "vehicle": "1", "track": "7", "label": "person", "state": "confirmed", "lat": 48.1001,
        "lon": 11.5, "alt_amsl": 490.0, "ellipse": EllipseView(4.0, 2.0, 30.0), "radius95_m": 3.5,
        "first_unix": NOW, "seen_unix": NOW, "source": "mavlink",
    }  # fmt: skip
    return TargetView(**usual | changes)


@pytest.fixture
def picture():
    picture = GroundPicture()
    picture.on_vehicle("1", NOW, lat=48.1, lon=11.5, alt_amsl=500.0)
    picture.on_target(target(), NOW)
    return picture


async def viewed(output, port, until):
    """Messages, (topic, time, content), that a viewer of all topics gets until ``until(messages)``."""
    messages, topics, ticks = [], {}, TICKS
    async with (
        aiohttp.ClientSession() as session,
        session.ws_connect(f"http://127.0.0.1:{port}", protocols=["foxglove.sdk.v1"], timeout=QUICK) as viewer,
    ):
        for _ in range(400):
            output.tick(NOW + next(ticks))
            try:
                received = await viewer.receive(timeout=0.02)
            except TimeoutError:
                continue
            if received.type is aiohttp.WSMsgType.TEXT:
                said = json.loads(received.data)
                if said["op"] == "advertise":
                    for channel in said["channels"]:
                        assert json.loads(channel["schema"])["title"] == channel["schemaName"]
                        assert (channel["encoding"], channel["schemaEncoding"]) == ("json", "jsonschema")
                        topics[channel["id"]] = channel["topic"]
                    wanted = [{"id": each["id"], "channelId": each["id"]} for each in said["channels"]]
                    await viewer.send_str(json.dumps({"op": "subscribe", "subscriptions": wanted}))
            elif received.type is aiohttp.WSMsgType.BINARY and received.data[0] == MESSAGE:
                subscription, at_ns = struct.unpack_from("<IQ", received.data, 1)
                content = json.loads(received.data[13:])
                topic = topics[subscription]
                jsonschema.validate(content, SCHEMAS[TOPICS[topic]])
                messages.append((topic, at_ns, content))
                if until(messages):
                    return messages
    raise AssertionError(f"not all came: {sorted({topic for topic, _, _ in messages})}")


@pytest.fixture
def serving(picture):
    port = free_port()
    output = ViewerOutput("127.0.0.1", port, picture)
    output.start()
    yield output, port
    output.close()


def test_viewer_gets_every_topic_with_the_places_of_an_independent_geodesy(serving, picture):
    def until(messages):
        if len(messages) == 1:  # it is there now
            picture.say("1", "target lost", NOW, severity=4)
        return {topic for topic, _, _ in messages} == set(SENT)

    messages = asyncio.run(viewed(*serving, until))
    of = {topic: content for topic, _, content in messages}
    (entity,) = of["/targets/scene"]["entities"]
    place = entity["spheres"][0]["pose"]["position"]
    expected = geodetic2enu(48.1001, 11.5, 490.0, 48.1, 11.5, 500.0)
    assert_allclose([place["x"], place["y"], place["z"]], expected, atol=0.01)
    assert entity["cylinders"][0]["size"] == {"x": 8.0, "y": 4.0, "z": 0.02}
    assert of["/vehicle/location"]["altitude"] == 500.0
    assert (of["/log"]["message"], of["/log"]["level"]) == ("target lost", 3)
    assert of["/tf"]["child_frame_id"] == "vehicle"


def test_viewer_that_connects_late_gets_the_whole_scene_and_each_text_once(serving, picture):
    output, port = serving
    for k in range(30):
        output.tick(NOW - 60.0 + 0.1 * k)
    messages = asyncio.run(viewed(output, port, lambda all_: sum(topic == "/targets/scene" for topic, *_ in all_) >= 3))
    whole = [content for topic, _, content in messages if topic == "/targets/scene"]
    assert all(content["deletions"][0]["type"] == 1 and content["entities"] for content in whole)
    assert not any(topic == "/log" for topic, *_ in messages)


def test_removed_target_is_deleted_from_the_scene(serving, picture):
    output, port = serving
    seen = []

    def until(messages):
        scenes = [content for topic, _, content in messages if topic == "/targets/scene"]
        if scenes and not seen:
            seen.append(True)
            picture.remove_target("1.7")
        return scenes[1:] != [] and scenes[-1]["deletions"] != [] and scenes[-1]["entities"] == []

    asyncio.run(viewed(output, port, until))


def test_viewer_that_connects_a_hundred_times_is_served_each_time(serving):
    async def again():
        for _ in range(100):
            await viewed(*serving, lambda messages: True)

    asyncio.run(again())


def test_port_that_is_taken_is_one_line(serving, picture):
    _, port = serving
    with pytest.raises(UserError, match=rf"^--foxglove 127.0.0.1:{port}: .+") as caught:
        ViewerOutput("127.0.0.1", port, picture).start()
    assert "\n" not in str(caught.value)


def test_strangers_keep_few_connections_of_the_viewers_port_and_none_keeps_it_from_closing(picture):
    """Any number was held, until no more files could be opened, and one half request kept `ground` from ending."""
    port = free_port()
    output = ViewerOutput("127.0.0.1", port, picture)
    output.start()
    half = [socket.create_connection(("127.0.0.1", port), 20.0) for _ in range(MOST_WAITING + 20)]
    for each in half[:20]:
        assert each.recv(100) == b"", "the oldest yield to the newest"
    for each in half:
        each.close()
    held = socket.create_connection(("127.0.0.1", port), 20.0)
    viewers = [socket.create_connection(("127.0.0.1", port), 20.0) for _ in range(MOST_VIEWERS)]
    for each in viewers:
        each.sendall(UPGRADE)
        assert each.recv(100).startswith(b"HTTP/1.1 101")
    with socket.create_connection(("127.0.0.1", port), 20.0) as refused:
        refused.sendall(UPGRADE)
        assert refused.recv(100) == b""
    output.close()
    for each in (held, *viewers):
        with each, contextlib.suppress(ConnectionResetError):
            while each.recv(65536):
                pass
