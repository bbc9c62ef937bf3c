"""The bus over real Zenoh on loopback, with the ground process's input at its end."""

from __future__ import annotations

import asyncio
from collections.abc import Callable
from contextlib import ExitStack
from itertools import count
from typing import Any

import msgspec
import pytest
from fleet_messages import NOW, shared, tracks_message
from processes import free_port

zenoh = pytest.importorskip("zenoh")

from fwav_companion.errors import UserError
from fwav_companion.fleet.bus import BusPlace, FleetBus
from fwav_companion.fleet.payloads import StateMessage, encoded
from fwav_companion.ground.fleet_input import FleetInput
from fwav_companion.ground.picture import GroundPicture

WITHIN_S = 60.0
"""A hang, not slowness."""


class Clock:
    """Seconds that grow with every reading of the event loop."""

    def now(self) -> float:
        return NOW + asyncio.get_running_loop().time()


async def until(condition: Callable[[], object], meanwhile: Callable[[], object] = lambda: None) -> None:
    async with asyncio.timeout(WITHIN_S):
        while not condition():  # it changes by another process's message
            meanwhile()
            await asyncio.sleep(0.05)


def run(story: Callable[[ExitStack], Any]) -> None:
    """Run a story. Whatever it opens is closed: an open session keeps the process from ending."""

    async def told() -> None:
        with ExitStack() as stack:
            await story(stack)

    asyncio.run(told())


def opened_input(stack: ExitStack, endpoint: str) -> tuple[GroundPicture, FleetInput]:
    """A ground process's input that listens, and its picture."""
    picture = GroundPicture()
    made = FleetInput(BusPlace("t", listen=[endpoint]), picture, clock=Clock().now)
    stack.callback(made.close)
    made.start()
    return picture, made


def test_a_late_joiner_gets_the_newest_and_a_router_may_end_and_come_back():
    """A vehicle connects to a hub; `ground` joins later; the hub ends and another takes its place."""
    endpoint = f"tcp/127.0.0.1:{free_port()}"

    async def story(stack: ExitStack) -> None:
        clock, seq = Clock(), count(1)
        vehicle = FleetBus(BusPlace("t", connect=[endpoint]), lambda _works, _why: None)
        stack.callback(vehicle.close)

        def publish() -> None:
            vehicle.announce("1")
            vehicle.publish("1/tracks", encoded(tracks_message(shared(7), seq=next(seq), time_unix=clock.now())))
            state = StateMessage(vehicle="1", time_unix=clock.now(), session="a", ready=True, lat=48.0, lon=11.0)
            vehicle.publish("1/state", [msgspec.json.encode(state)])

        vehicle.start()
        await until(lambda: vehicle._session is not None)
        publish()  # before the ground process is there: it is kept
        picture, ground = opened_input(stack, endpoint)
        await until(lambda: picture.targets and picture.vehicles["1"].ready, lambda: ground.tick(clock.now()))
        (target,) = picture.targets.values()
        assert target.vehicles == {"1": "7"}
        assert (target.lat, target.lon) == pytest.approx((48.0, 11.0), abs=1e-6)

        ground.close()
        picture, ground = opened_input(stack, endpoint)
        await until(lambda: picture.targets, lambda: (publish(), ground.tick(clock.now())))
        vehicle.close()
        await until(lambda: any("left the fleet" in text.text for text in picture.update_since(0, NOW).texts))

    run(story)


def test_the_fused_picture_is_published_back():
    endpoint = f"tcp/127.0.0.1:{free_port()}"
    heard: list[str] = []

    async def story(stack: ExitStack) -> None:
        picture, ground = opened_input(stack, endpoint)
        await until(lambda: picture.update_since(0, NOW).sources[0].works)
        session = await asyncio.to_thread(zenoh.open, BusPlace("t", connect=[endpoint]).configuration)
        stack.callback(session.close)
        subscriber = session.declare_subscriber("fwav/t/fused", lambda each: heard.append(str(each.key_expr)))
        await until(lambda: heard, lambda: ground.tick(Clock().now()))
        subscriber.undeclare()

    run(story)
    assert heard[0] == "fwav/t/fused"


def test_a_wrong_endpoint_is_one_line():
    with pytest.raises(UserError, match="accepted: Zenoh endpoints"):
        BusPlace("t", connect=["nonsense"])
    with pytest.raises(UserError, match=r"absent\.json5"):
        BusPlace("t", config="/absent.json5")
