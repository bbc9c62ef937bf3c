"""Reconnection, with an opener controlled by the test and simulated seconds."""

import asyncio
from collections.abc import Callable

import pytest

from fwav_companion.errors import LinkError
from fwav_companion.links import reconnect
from fwav_companion.links.base import Connection, LinkReceiver, LinkState
from fwav_companion.links.reconnect import LONGEST_DELAY_S, StayingConnected
from fwav_companion.types.network_status import LinkReport


class Plug:
    """A connection in the test's hands."""

    def __init__(self, receiver: LinkReceiver) -> None:
        self.receiver = receiver
        self.sent: list[bytes] = []
        self.closed = 0

    def send(self, data: bytes, *, origin: object) -> None:
        self.sent.append(data)

    def close(self) -> None:
        self.closed += 1

    def status(self) -> LinkReport:
        return LinkReport(device="plug")


class Socket:
    """An opener that fails while it has errors, then gives plugs."""

    def __init__(self, *errors: OSError | LinkError) -> None:
        self.errors = list(errors)
        self.plugs: list[Plug] = []
        self.closed = 0

    async def open(self, receiver: LinkReceiver) -> Connection:
        if self.errors:
            raise self.errors.pop(0)
        self.plugs.append(Plug(receiver))
        return self.plugs[-1]

    def close(self) -> None:
        self.closed += 1


class Story:
    """A link over a Socket; its pauses are counted, and end when the test says so."""

    def __init__(self, *errors: OSError | LinkError) -> None:
        self.socket = Socket(*errors)
        self.states: list[tuple[bool, str]] = []
        self.heard: list[bytes] = []
        self.pauses: list[float] = []
        self.link = StayingConnected(
            "a",
            self.socket,
            lambda _name, data: self.heard.append(data),
            lambda _name, up, why: self.states.append((up, why)),
            sleep=self.pause,
        )

    async def pause(self, seconds: float) -> None:
        self.pauses.append(seconds)
        await asyncio.sleep(0)

    async def turns(self, count: int = 20) -> None:
        for _ in range(count):
            await asyncio.sleep(0)


def run_story(story: Callable[[], object]) -> None:
    asyncio.run(story())


def test_up_bytes_and_counters():
    async def story() -> None:
        s = Story()
        assert s.link.state is LinkState.IDLE
        s.link.send(b"too early")
        s.link.start()
        assert s.link.state is LinkState.OPENING
        await s.turns()
        s.link.send(b"out")
        s.socket.plugs[0].receiver.on_bytes(b"in")
        assert s.states == [(True, "")]
        assert s.heard == [b"in"]
        assert s.socket.plugs[0].sent == [b"out"]
        assert s.link.status() == LinkReport(
            state="up", why="", times_up=1, bytes_in=2, bytes_out=0, dropped=1, device="plug"
        )
        s.link.close()

    run_story(story)


def test_an_outage_is_reported_once_and_retried_at_growing_intervals():
    async def story() -> None:
        s = Story(*[OSError(101, "x")] * 6, LinkError("hangs"))
        s.link.start()
        await s.turns(60)
        assert s.states == [(False, "Network is unreachable"), (True, "")]
        assert s.pauses == [0.25, 0.5, 1.0, 2.0, LONGEST_DELAY_S, LONGEST_DELAY_S, LONGEST_DELAY_S]
        s.link.close()

    run_story(story)


def test_why_it_is_down_is_the_latest_reason():
    async def story() -> None:
        s = Story(LinkError("first"), LinkError("second"))
        s.link.start()
        await asyncio.sleep(0)
        assert (s.link.state, s.link.status().why) == (LinkState.DOWN, "first")
        await asyncio.sleep(0)
        assert s.link.status().why == "second"
        s.link.close()

    run_story(story)


def test_a_loss_is_reported_and_a_new_connection_made():
    async def story() -> None:
        s = Story()
        s.link.start()
        await s.turns()
        first = s.socket.plugs[0]
        first.receiver.on_lost("unplugged")
        first.receiver.on_lost("and again")
        await s.turns()
        assert s.states == [(True, ""), (False, "unplugged"), (True, "")]
        assert first.closed == 1
        s.link.send(b"x")
        assert s.socket.plugs[1].sent == [b"x"]
        assert first.sent == []
        assert s.link.status().times_up == 2
        s.link.close()

    run_story(story)


@pytest.mark.parametrize(("steady_s", "pauses"), [(0.0, [0.25, 0.25, 0.25]), (3600.0, [0.25, 0.5, 1.0])])
def test_only_a_connection_that_held_earns_short_pauses(
    steady_s: float, pauses: list[float], monkeypatch: pytest.MonkeyPatch
):
    monkeypatch.setattr(reconnect, "STEADY_S", steady_s)

    async def story() -> None:
        s = Story()
        s.link.start()
        for _ in range(3):
            await s.turns()
            s.socket.plugs[-1].receiver.on_lost("flaps")
        await s.turns()
        assert s.pauses == pauses
        s.link.close()

    run_story(story)


def test_a_closed_link_reports_nothing_more():
    async def story() -> None:
        s = Story()
        s.link.start()
        await s.turns()
        s.link.close()
        s.socket.plugs[0].receiver.on_lost("late")
        s.link.send(b"late")
        await s.turns()
        assert s.states == [(True, "")]
        assert s.link.state is LinkState.CLOSED
        assert s.socket.plugs[0].closed == 1
        assert s.socket.closed == 1
        assert len(s.socket.plugs) == 1

    run_story(story)


def test_closed_while_down_and_before_it_was_started():
    async def story() -> None:
        s = Story(*[LinkError("x")] * 100)
        s.link.close()
        s.link.start()
        s.link.close()
        await s.turns()
        assert s.states == []

    run_story(story)


def test_a_mistake_of_ours_reaches_the_loop():
    async def story() -> None:
        errors: list[dict[str, object]] = []
        asyncio.get_running_loop().set_exception_handler(lambda _loop, context: errors.append(context))
        s = Story(ZeroDivisionError())  # type: ignore[arg-type]
        s.link.start()
        await s.turns()
        assert [error["message"] for error in errors] == ["link a failed"]

    run_story(story)
