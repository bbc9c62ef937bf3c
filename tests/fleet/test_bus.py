"""The bus over real Zenoh on loopback, with the ground process's input at its end."""

from __future__ import annotations

import asyncio
import json
import shutil
import subprocess
import sys
from collections.abc import Callable
from contextlib import ExitStack
from itertools import count, pairwise
from pathlib import Path
from typing import Any

import msgspec
import pytest
from fleet_messages import NOW, shared, tracks_message
from processes import Process, free_port

zenoh = pytest.importorskip("zenoh")

from fwav_companion.errors import UserError
from fwav_companion.fleet import bus as bus_module
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

    async def run_in_stack() -> None:
        with ExitStack() as stack:
            await story(stack)

    asyncio.run(run_in_stack())


def opened_input(stack: ExitStack, place: BusPlace) -> tuple[GroundPicture, FleetInput]:
    """A ground process's input, and its picture."""
    picture = GroundPicture()
    made = FleetInput(place, picture, clock=Clock().now)
    stack.callback(made.close)
    made.start()
    return picture, made


class Vehicle:
    """A vehicle with one target; each message is newer than the last."""

    def __init__(self, stack: ExitStack, place: BusPlace) -> None:
        self.clock, self._seq = Clock(), count(1)
        self.refusals: list[str] = []
        self.bus = FleetBus(place, lambda works, why: None if works else self.refusals.append(why))
        stack.callback(self.bus.close)
        self.bus.start()

    def publish(self) -> None:
        now = self.clock.now()
        self.bus.announce("1")
        self.bus.publish("1/tracks", encoded(tracks_message(shared(7), seq=next(self._seq), time_unix=now)))
        state = StateMessage(vehicle="1", time_unix=now, session="a", ready=True, lat=48.0, lon=11.0)
        self.bus.publish("1/state", [msgspec.json.encode(state)])


def test_a_ground_process_that_listens_may_end_and_come_back():
    """It is the hub itself: the vehicle connects to it, also before it is there."""
    endpoint = f"tcp/127.0.0.1:{free_port()}"

    async def story(stack: ExitStack) -> None:
        vehicle = Vehicle(stack, BusPlace("t", connect=[endpoint]))
        for _ in range(2):
            picture, ground = opened_input(stack, BusPlace("t", listen=[endpoint]))

            def step(ground: FleetInput = ground) -> None:
                vehicle.publish()
                ground.tick(vehicle.clock.now())

            await until(lambda: picture.targets and picture.vehicles["1"].ready, step)  # noqa: B023
            (target,) = picture.targets.values()
            assert target.vehicles == {"1": "7"}
            assert (target.lat, target.lon) == pytest.approx((48.0, 11.0), abs=1e-6)
            ground.close()
        picture, _ = opened_input(stack, BusPlace("t", listen=[endpoint]))
        await until(lambda: "1" in picture.vehicles, vehicle.publish)
        vehicle.bus.close()
        await until(lambda: said(picture, "left the fleet"))

    run(story)


class PromptLoop:
    """An event loop that runs what another thread hands over before that thread goes on."""

    def call_soon_threadsafe(self, work: Callable[[], None]) -> None:
        work()


def test_tokens_that_the_loop_runs_at_once_are_all_passed_on(monkeypatch):
    """Each of them left the count of those that wait one too high: after 4096 no change of a token was passed on."""
    monkeypatch.setattr(bus_module, "MAX_TOKENS", 3)
    bus, ran = FleetBus(BusPlace("t"), lambda *_: None), []
    bus._loop = PromptLoop()
    for number in range(10):
        bus._hand_over(lambda number=number: ran.append(number))
    assert ran == list(range(10))


def test_flood_of_messages_is_read_in_turns_that_leave_the_loop_to_others(monkeypatch):
    """Each reading of the CPU's clock is 1 ms: a turn of 8 ms has at most eight messages. All come, in their order."""
    cpu_ms, turns, most = count(), [], 200
    monkeypatch.setattr(bus_module.time, "thread_time", lambda: next(cpu_ms) / 1000.0)

    async def story() -> None:
        bus, taken = FleetBus(BusPlace("t"), lambda *_: None), []
        bus.subscribe(lambda vehicle, kind, data: taken.append(data), lambda *_: None, lambda vehicle: True)
        bus._loop = asyncio.get_running_loop()
        for number in range(most):
            bus._deliver("1", "tracks", bytes([number]))
        async with asyncio.timeout(WITHIN_S):
            while len(taken) < most:
                turns.append(len(taken))
                await asyncio.sleep(0)
        assert taken == [bytes([number]) for number in range(most)]

    asyncio.run(story())
    assert max(later - earlier for earlier, later in pairwise(turns)) <= 8


def test_messages_that_were_left_out_are_shown_until_ten_seconds_after_the_last():
    picture = GroundPicture()
    ground = FleetInput(BusPlace("t"), picture, clock=lambda: NOW)

    def shown(now: float) -> tuple[bool, str]:
        ground.tick(now)
        (source,) = picture.update_since(0, now).sources
        return source.works, source.text

    ground._on_state(True, "")
    assert shown(NOW) == (True, "open")
    for _ in range(20):
        ground._bus._mail.put("1", "tracks", bytes(1_000_000))
    left_out = f"more messages come than can be handled: {ground._bus.dropped} were left out"
    assert ground._bus.dropped > 0
    assert shown(NOW + 1.0) == shown(NOW + 10.5) == (False, left_out)
    assert shown(NOW + 11.5) == (True, "open")


def said(picture: GroundPicture, words: str) -> bool:
    return any(words in text.text for text in picture.update_since(0, NOW).texts)


ROUTER = """
import sys, time, zenoh
configuration = zenoh.Config()
configuration.insert_json5("mode", '"router"')
configuration.insert_json5("listen/endpoints", f'["{sys.argv[1]}"]')
configuration.insert_json5("scouting/multicast/enabled", "false")
session = zenoh.open(configuration)
print("router open", flush=True)
time.sleep(600.0)
"""


def test_through_a_router_a_late_joiner_gets_the_newest_and_the_router_may_be_killed(tmp_path):
    """Vehicle and ground process meet through the router alone."""
    endpoint = f"tcp/127.0.0.1:{free_port()}"

    def router(stack: ExitStack) -> Process:
        started = Process(ROUTER, endpoint, folder=tmp_path, program=(sys.executable, "-c"))
        stack.callback(started.kill)
        started.wait_for("router open")
        return started

    async def story(stack: ExitStack) -> None:
        first = router(stack)
        vehicle = Vehicle(stack, BusPlace("t", connect=[endpoint]))
        now = vehicle.clock.now
        await until(lambda: vehicle.bus._session is not None)
        vehicle.publish()  # before the ground process is there: it is kept
        picture, ground = opened_input(stack, BusPlace("t", connect=[endpoint]))
        await until(lambda: picture.targets, lambda: ground.tick(now()))

        first.kill()
        await until(lambda: said(picture, "left the fleet"), vehicle.publish)
        seen = max(target.seen_unix for target in picture.targets.values())
        router(stack)
        await until(
            lambda: any(target.seen_unix > seen for target in picture.targets.values()),
            lambda: (vehicle.publish(), ground.tick(now())),
        )
        assert len(picture.targets) == 1

    run(story)


@pytest.mark.parametrize(
    ("keys", "mode"),
    [
        ({"connect": ["tcp/127.0.0.1:1"]}, "client"),  # a router passes nothing on between peers
        ({"connect": ["tcp/127.0.0.1:1", "tcp/127.0.0.1:2"]}, "peer"),
        ({"connect": ["tcp/127.0.0.1:1"], "listen": ["tcp/127.0.0.1:2"]}, "peer"),
        ({"connect": ["tcp/127.0.0.1:1"], "scouting": True}, "peer"),
        ({"listen": ["tcp/127.0.0.1:1"]}, "peer"),
    ],
)
def test_one_endpoint_makes_a_client(keys, mode):
    assert json.loads(BusPlace("t", **keys).configuration.get_json("mode")) == mode


def certificates(folder: Path) -> None:
    """A certificate authority and a certificate for 127.0.0.1, of elliptic curves: RSA keys take seconds."""
    curve = ("-newkey", "ec", "-pkeyopt", "ec_paramgen_curve:prime256v1", "-nodes", "-days", "2")
    (folder / "server.ext").write_text("subjectAltName=IP:127.0.0.1\nextendedKeyUsage=serverAuth\n")
    for words in (
        ("req", "-x509", *curve, "-subj", "/CN=fleet", "-keyout", "ca.key", "-out", "ca.pem"),
        ("req", *curve, "-subj", "/CN=127.0.0.1", "-keyout", "server.key", "-out", "server.csr"),
        ("x509", "-req", "-in", "server.csr", "-CA", "ca.pem", "-CAkey", "ca.key", "-CAcreateserial",
         "-days", "2", "-extfile", "server.ext", "-out", "server.pem"),
    ):  # fmt: skip
        subprocess.run(["openssl", *words], cwd=folder, check=True, capture_output=True, timeout=60)


def tls_file(path: Path, **keys: Path) -> str:
    """A Zenoh configuration as the handbook shows it."""
    path.write_text(json.dumps({"transport": {"link": {"tls": {name: str(each) for name, each in keys.items()}}}}))
    return str(path)


@pytest.mark.skipif(shutil.which("openssl") is None, reason="openssl makes the certificates")
def test_with_tls_a_client_without_the_authority_is_refused(tmp_path):
    certificates(tmp_path)
    endpoint = f"tls/127.0.0.1:{free_port()}"
    hub = tls_file(tmp_path / "hub.json5", listen_certificate=tmp_path / "server.pem",
                   listen_private_key=tmp_path / "server.key")  # fmt: skip
    trusting = tls_file(tmp_path / "vehicle.json5", root_ca_certificate=tmp_path / "ca.pem")

    async def story(stack: ExitStack) -> None:
        picture, ground = opened_input(stack, BusPlace("t", listen=[endpoint], config=hub))
        await until(lambda: picture.update_since(0, NOW).sources[0].works)
        stranger = Vehicle(stack, BusPlace("t", connect=[endpoint]))
        vehicle = Vehicle(stack, BusPlace("t", connect=[endpoint], config=trusting))
        await until(lambda: picture.targets, lambda: (vehicle.publish(), ground.tick(vehicle.clock.now())))
        await until(lambda: stranger.refusals)
        assert stranger.bus._session is None
        assert stranger.refusals == [
            f"no connection to {endpoint}: check address, network, and with TLS the certificates"
        ]

    run(story)


@pytest.mark.parametrize(
    ("content", "listen", "multicast"),
    [
        ("{}", [], False),
        ('{"listen": {"endpoints": ["tls/0.0.0.0:7447"]}}', ["tls/0.0.0.0:7447"], False),
        ('{"scouting": {"multicast": {"enabled": true}}}', [], True),
    ],
)
def test_nothing_listens_and_answers_multicast_unless_that_is_configured(tmp_path, content, listen, multicast):
    """Zenoh's own default is an unencrypted port on all addresses, also beside a file with TLS."""
    (tmp_path / "zenoh.json5").write_text(content)
    made = BusPlace("t", config=str(tmp_path / "zenoh.json5")).configuration
    assert json.loads(made.get_json("listen/endpoints")) == listen
    assert json.loads(made.get_json("scouting/multicast/enabled")) is multicast


def test_the_fused_picture_is_published_back():
    endpoint = f"tcp/127.0.0.1:{free_port()}"
    heard: list[str] = []

    async def story(stack: ExitStack) -> None:
        picture, ground = opened_input(stack, BusPlace("t", listen=[endpoint]))
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
