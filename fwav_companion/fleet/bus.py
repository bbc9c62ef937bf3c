"""SHELL: the bus of a fleet, a Zenoh session. The only module that imports zenoh.

Zenoh finds peers, routes and reconnects; a router that ends and comes back needs no action here. Zenoh calls back on
its own threads. The event loop takes the messages from a mailbox in turns with pauses, so that no flood of them holds
up its other work.
"""

from __future__ import annotations

import asyncio
import json
import threading
import time
from collections.abc import Callable, Sequence
from typing import Any

import zenoh
import zenoh.ext

from fwav_companion.errors import UserError
from fwav_companion.fleet.mailbox import Mailbox
from fwav_companion.fleet.payloads import MAX_BYTES, MAX_PARTS

PREFIX = "fwav"
MAX_TOKENS = 4096
"""Most changes of liveliness tokens that wait for the event loop; further ones are dropped."""
TURN_S, PAUSE_S = 0.008, 0.008
"""CPU time of a turn of the reader, seconds, after which no message is begun, and the pause after it."""
RETRY_S = 3.0
CONNECT, LISTEN, SCOUTING = "connect/endpoints", "listen/endpoints", "scouting/multicast/enabled"
"""Keys of Zenoh's configuration. Its own defaults listen on all addresses, unencrypted, and answer multicast: both must
be configured here."""

OnMessage = Callable[[str, str, bytes], None]
"""(vehicle, kind, payload): kind is the last word of the key."""
OnAlive = Callable[[str, bool], None]
"""(vehicle, whether its liveliness token is there)."""


class BusPlace:
    """The place of a fleet's bus, by [fleet] or the command line."""

    def __init__(
        self,
        name: str,
        *,
        connect: Sequence[str] = (),
        listen: Sequence[str] = (),
        scouting: bool = False,
        config: str = "",
    ) -> None:
        """UserError if Zenoh does not accept the configuration file or an endpoint."""
        self.name = name
        try:
            self.configuration = zenoh.Config.from_file(config) if config else zenoh.Config()
            # Messages that are kept for late joiners are distinguished by their times.
            self.configuration.insert_json5("timestamping/enabled", "true")
            if connect:
                self.configuration.insert_json5(CONNECT, json.dumps(list(connect)))
            if listen or _is_default(self.configuration, LISTEN):
                self.configuration.insert_json5(LISTEN, json.dumps(list(listen)))
            if scouting or _is_default(self.configuration, SCOUTING):
                self.configuration.insert_json5(SCOUTING, json.dumps(scouting))
            if _is_default(self.configuration, "mode"):
                self.configuration.insert_json5("mode", json.dumps(_mode(self.configuration)))
        except zenoh.ZError as error:
            where = config or ", ".join([*connect, *listen])
            plain = str(error).partition(" at /")[0]
            why = plain.partition('msg: "')[2].partition(":")[0] or plain
            accepted = "a Zenoh configuration (.json5)" if config else "Zenoh endpoints, as tcp/10.0.0.1:7447"
            raise UserError(f"[fleet] {where}: {why}; accepted: {accepted}") from None

    def why_closed(self, error: str) -> str:
        """Why the session does not open: Zenoh's error without the references to its own code."""
        if "Unable to connect" in error:
            endpoints = ", ".join(json.loads(self.configuration.get_json(CONNECT)))
            return f"no connection to {endpoints}: check address, network, and with TLS the certificates"
        return error.partition(" at /")[0].strip()[:200]


class FleetBus:
    """One session: publishes for one vehicle or for `ground`, and passes on the messages of others."""

    def __init__(self, place: BusPlace, on_state: Callable[[bool, str], None]) -> None:
        """``on_state``: called in the loop with (whether it works, why not), once for each reason."""
        self._place, self._on_state = place, on_state
        self._session: Any = None
        self._publishers: dict[str, Any] = {}
        self._held: list[Any] = []
        self._task: asyncio.Task[None] | None = None
        self._loop: asyncio.AbstractEventLoop | None = None
        self._tokens_waiting = 0
        self._alive_key = ""
        self._subscription: tuple[OnMessage, OnAlive] | None = None
        self._mail: Mailbox | None = None
        self._lock = threading.Lock()
        """Held while the mailbox is used, its reader is woken, or tokens are counted."""
        self._reading = False

    def start(self) -> None:
        """Open the session in the background; messages published before it is open are dropped."""
        self._loop = asyncio.get_running_loop()
        self._task = self._loop.create_task(self._open())

    def announce(self, vehicle: str) -> None:
        """Declare this vehicle's liveliness token, once."""
        key = f"{PREFIX}/{self._place.name}/{vehicle}/alive"
        if self._session is not None and key != self._alive_key:
            self._alive_key = key
            self._held.append(self._session.liveliness().declare_token(key))

    def subscribe(self, on_message: OnMessage, on_alive: OnAlive, is_known: Callable[[str], bool]) -> None:
        """Pass on every vehicle's messages, including the newest earlier ones. Called before :meth:`start`.

        ``is_known``: whether a vehicle's messages have been accepted before; it is called on other threads.
        """
        self._subscription, self._mail = (on_message, on_alive), Mailbox(is_known)

    @property
    def dropped(self) -> int:
        """Number of messages that were dropped because too many waited."""
        return 0 if self._mail is None else self._mail.dropped

    def publish(self, key: str, parts: Sequence[bytes]) -> None:
        """Publish the parts of a message under ``fwav/FLEET/key``; never blocks."""
        if self._session is None:
            return
        publisher = self._publishers.get(key)
        if publisher is None:
            publisher = self._publishers[key] = zenoh.ext.declare_advanced_publisher(
                self._session,
                f"{PREFIX}/{self._place.name}/{key}",
                cache=zenoh.ext.CacheConfig(max_samples=MAX_PARTS),
                publisher_detection=True,
                congestion_control=zenoh.CongestionControl.DROP,
                encoding=zenoh.Encoding.APPLICATION_JSON,
            )
        for part in parts:
            publisher.put(part)

    def close(self) -> None:
        """End the session."""
        if self._task is not None:
            self._task.cancel()
        session, self._session = self._session, None
        if session is not None:
            session.close()

    async def _open(self) -> None:
        reported = ""
        while True:
            opening = asyncio.ensure_future(asyncio.to_thread(zenoh.open, self._place.configuration))
            try:
                session = await asyncio.shield(opening)
                break
            except asyncio.CancelledError:  # a session that opens after the end is closed, or the process would not end
                opening.add_done_callback(_close_late)
                raise
            except zenoh.ZError as error:
                why = self._place.why_closed(str(error))
                if why != reported:  # it is tried again each few seconds
                    self._on_state(False, why)
                reported = why
            await asyncio.sleep(RETRY_S)
        self._session = session
        if self._subscription is not None:
            self._subscribe(self._subscription[1])
        self._on_state(True, "")

    def _subscribe(self, on_alive: OnAlive) -> None:
        fleet = f"{PREFIX}/{self._place.name}"

        def take(sample: Any) -> None:
            *_, vehicle, kind = str(sample.key_expr).split("/")
            size = len(sample.payload)
            # An oversized one is not copied: its size is enough to refuse it.
            self._deliver(vehicle, kind, bytes(MAX_BYTES + 1) if size > MAX_BYTES else bytes(sample.payload))

        def take_token(sample: Any) -> None:
            vehicle = str(sample.key_expr).split("/")[-2]
            self._hand_over(lambda: on_alive(vehicle, sample.kind == zenoh.SampleKind.PUT))

        for kind in ("tracks", "state"):
            self._held.append(
                zenoh.ext.declare_advanced_subscriber(
                    self._session,
                    f"{fleet}/*/{kind}",
                    take,
                    history=zenoh.ext.HistoryConfig(detect_late_publishers=True, max_samples=MAX_PARTS),
                )
            )
        tokens = self._session.liveliness().declare_subscriber(f"{fleet}/*/alive", take_token, history=True)
        self._held.append(tokens)

    def _deliver(self, vehicle: str, kind: str, data: bytes) -> None:
        """Put a message into the mailbox, and wake its reader. Called on a thread of Zenoh."""
        loop, mail = self._loop, self._mail
        if loop is None or mail is None:
            return
        with self._lock:
            mail.put(vehicle, kind, data)
            if not self._reading:
                self._reading = _call_soon(loop, self._read)

    def _read(self) -> None:
        """Pass on messages for a turn; what is left waits for the next one, even after an error."""
        if self._loop is None or self._mail is None or self._subscription is None:
            return
        ends_s = time.thread_time() + TURN_S
        try:
            while time.thread_time() < ends_s:
                with self._lock:
                    message = self._mail.take()
                if message is None:
                    break
                self._subscription[0](*message)
        finally:
            with self._lock:
                self._reading = bool(self._mail)
                if self._reading:
                    self._loop.call_later(PAUSE_S, self._read)

    def _hand_over(self, work: Callable[[], None]) -> None:
        """Run the work in the event loop. Called on a thread of Zenoh."""
        with self._lock:
            loop = self._loop
            if self._tokens_waiting >= MAX_TOKENS or loop is None:
                return
            self._tokens_waiting += 1

        def run() -> None:
            with self._lock:
                self._tokens_waiting -= 1
            work()

        _call_soon(loop, run)  # outside the lock: the loop may run it before this returns


def _call_soon(loop: asyncio.AbstractEventLoop, work: Callable[[], None]) -> bool:
    """Call in the loop, from another thread. False if the loop is closed."""
    try:
        loop.call_soon_threadsafe(work)
    except RuntimeError:
        return False
    return True


def _mode(configuration: Any) -> str:
    """Zenoh's mode: client if there is exactly one endpoint, else peer.

    Routers pass on messages of clients, but not messages between peers (Zenoh 1.10), because peers are assumed to reach
    one another. A client has one endpoint at a time; a peer is connected to all of them, each a program that listens.
    """
    connect, listen, scouting = (json.loads(configuration.get_json(key)) for key in (CONNECT, LISTEN, SCOUTING))
    return "client" if len(connect) == 1 and not listen and not scouting else "peer"


def _is_default(configuration: Any, key: str) -> bool:
    """Whether a configuration leaves this key at Zenoh's default."""
    return bool(configuration.get_json(key) == zenoh.Config().get_json(key))


def _close_late(opening: asyncio.Future[Any]) -> None:
    """Close a session that is no longer awaited."""
    if not opening.cancelled() and opening.exception() is None:
        opening.result().close()
