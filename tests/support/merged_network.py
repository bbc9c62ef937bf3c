"""The service's relay and pipeline between the mock autopilot and ground stations, in invented time, without sockets.

The stations encode and decode with pymavlink (the mock's codec), so that our codec is not tested by itself.
"""

from __future__ import annotations

from collections import Counter
from collections.abc import Callable, Iterable
from typing import Any

from configured_links import AUTOPILOT, GROUND, TABLET

from fwav_companion.config import parse
from fwav_companion.fair_queues import Origin
from fwav_companion.geometry.stamps import HostNs, whole_microseconds
from fwav_companion.links.fair_frame_queue import HELD
from fwav_companion.mavlink.router.node import Received
from fwav_companion.pipeline.pipeline_factory import make_pipeline
from fwav_companion.service.network import Outbox, make_node
from sitl_mock import Options, Simulation, simulate
from sitl_mock.codec import NUMBERS, Heard, Listener, Speaker

SECOND_NS = 1_000_000_000
SET_MESSAGE_INTERVAL, REQUEST_MESSAGE = 511, 512
LINKS = AUTOPILOT + GROUND + TABLET + '[detections]\nurl = ""\n'


class Station:
    """A ground station on one link: sends a heartbeat once a second and its scheduled requests, and keeps what it
    receives.
    """

    def __init__(self, link: str, system: int = 255, *, silent_from_s: float = 1e9) -> None:
        self.link = link
        self.heard: list[tuple[float, Heard]] = []
        """(seconds since the start, message)."""
        self.writes: list[tuple[float, bytes]] = []
        """Bytes given to the link, one entry for each write."""
        self._speaker = Speaker(system, 190)
        self._listener = Listener()
        self._silent_from_s = silent_from_s
        self._plan: list[tuple[float, str, dict[str, Any]]] = []
        self._beat_s = 0.2

    def at(self, at_s: float, name: str, **fields: Any) -> Station:
        """Schedule this message."""
        self._plan.append((at_s, name, fields))
        return self

    def command(self, at_s: float, number: int, *parameters: float) -> Station:
        """Schedule a COMMAND_LONG to the autopilot."""
        values = {f"param{i + 1}": float(p) for i, p in enumerate((*parameters, *[0.0] * 7)[:7])}
        return self.at(
            at_s, "COMMAND_LONG", target_system=1, target_component=1, command=number, confirmation=0, **values
        )

    def ask(self, at_s: float, name: str, hz: float) -> Station:
        """Schedule a rate request by SET_MESSAGE_INTERVAL; 0 stops the message."""
        return self.command(at_s, SET_MESSAGE_INTERVAL, NUMBERS[name], 1e6 / hz if hz else -1.0)

    def ask_group(self, at_s: float, group: int, hz: int) -> Station:
        """Schedule a rate request by REQUEST_DATA_STREAM."""
        fields = {"req_stream_id": group, "req_message_rate": hz, "start_stop": 1}
        return self.at(at_s, "REQUEST_DATA_STREAM", target_system=1, target_component=1, **fields)

    def rates(self, from_s: float, to_s: float) -> dict[str, float]:
        """Messages a second of the autopilot, by name."""
        names = Counter(heard.name for at, heard in self.heard if from_s <= at < to_s and heard.component == 1)
        return {name: count / (to_s - from_s) for name, count in names.items()}

    def of(self, name: str) -> list[dict[str, Any]]:
        """Fields of every message of this name."""
        return [heard.fields for _, heard in self.heard if heard.name == name]

    def next_s(self) -> float:
        """The time of its next message."""
        beat_s = self._beat_s if self._beat_s < self._silent_from_s else 1e9
        return min([beat_s, *(at for at, _, _ in self._plan)])

    def take_due(self, now_s: float) -> list[bytes]:
        """The messages that are due by now."""
        frames = []
        if self._beat_s <= now_s and self._beat_s < self._silent_from_s:
            beat = {"type": 6, "autopilot": 8, "base_mode": 0, "custom_mode": 0, "system_status": 4}
            frames.append(self._speaker.frame("HEARTBEAT", {**beat, "mavlink_version": 3}))
            self._beat_s += 1.0
        due = [one for one in self._plan if one[0] <= now_s]
        self._plan = [one for one in self._plan if one[0] > now_s]
        return frames + [self._speaker.frame(name, fields) for _, name, fields in due]

    def hear(self, data: bytes, now_s: float) -> None:
        """Receive bytes that were sent to its link."""
        self.writes.append((now_s, data))
        self.heard += [(now_s, heard) for heard in self._listener.feed(data)]


class _Link:
    """The service's output: to a station, or into the bytes for the autopilot."""

    def __init__(self, take: Callable[[bytes], None]) -> None:
        self.send = take


class _Journal:
    def sent(self, frame: bytes, now: HostNs) -> None:
        """Discards sent frames."""


class MergedNetwork:
    """All parts of the service that have no socket, driven by a flight of the mock."""

    def __init__(self, options: Options, stations: Iterable[Station] = (), *, text: str = LINKS) -> None:
        config = parse(text, "relay.toml")
        # No camera looks: the filter of the gyro, a sixth of the work of such a flight, would change no frame's length.
        self.mock: Simulation = simulate(options.but({"autopilot.gyro_filter_hz": 0.0}))
        self.node = make_node(config, None, 0)
        self.pipeline = make_pipeline(config, None, unix_offset_ns=0, live=True)
        self.stations = list(stations)
        self.to_autopilot: list[tuple[float, bytes]] = []
        """(seconds since the start, a write)."""
        self.notices: list[str] = []
        self._out: list[bytes] = []
        links: dict[str, Any] = {link.name: _Link(self._to_stations(link.name)) for link in config.link}
        links["autopilot"] = _Link(self._to_autopilot)
        self._outbox = Outbox(self.node, links, None, _Journal(), self._on_fault)  # type: ignore[arg-type]
        self._now = HostNs(self.mock.start_host_ns)

    def fly(self) -> MergedNetwork:
        """Fly to the end of the flight."""
        for _ in self.mock.drive(self):
            pass
        return self

    @property
    def now_s(self) -> float:
        return (self._now - self.mock.start_host_ns) / SECOND_NS

    @property
    def wake_at(self) -> int | None:
        start_ns = self.mock.start_host_ns
        spoken = [start_ns + round(station.next_s() * SECOND_NS) for station in self.stations]
        due = [self.pipeline.wake_at, self.node.wake_at, *spoken]
        return min((at for at in due if at is not None), default=None)

    def on_wake(self, now_ns: int) -> list[bytes]:
        now = self._instant(now_ns)
        for station in self.stations:
            for frame in station.take_due(self.now_s):
                self._take(self.node.receive(station.link, frame, now), now, (station.link, ""))
        if self.node.wake_at is not None and self.node.wake_at <= now:
            self._take(self.node.on_wake(now), now, HELD)
        self.pipeline.advance(now)
        self._flush(now)
        return self._sent()

    def on_bytes(self, data: bytes, now_ns: int) -> list[bytes]:
        now = self._instant(now_ns)
        self._take(self.node.receive("autopilot", data, now), now, ("autopilot", ""))
        return self._sent()

    def on_frame(self, _frame: dict[str, Any], _now_ns: int) -> list[bytes]:
        return []

    def _take(self, received: Received, now: HostNs, origin: Origin) -> None:
        """Handle a received message as the daemon does."""
        followed = self.pipeline.on_rate_requests(received.rate_requests, self.node.demanded, now)
        self._outbox.forward(received.forwards, followed, now, origin=origin)
        for message in received.messages:
            self.pipeline.on_message(message, now)
        self._flush(now)

    def _flush(self, now: HostNs) -> None:
        outputs = self.pipeline.take()
        identity = self.pipeline.identity
        self.node.adopt(identity.system, identity.autopilot_component, vehicle=identity.vehicle)
        self.node.share(self.pipeline.own_streams)
        self.pipeline.stations_want(self.node.demanded)
        self._outbox.send(outputs.messages, outputs.datagrams, now)
        self.notices += [notice.text for notice in outputs.notices]

    def _to_stations(self, link: str) -> Callable[[bytes], None]:
        def send(data: bytes, **_order: object) -> None:
            for station in self.stations:
                if station.link == link:
                    station.hear(data, self.now_s)

        return send

    def _to_autopilot(self, data: bytes, **_order: object) -> None:
        self._out.append(data)
        self.to_autopilot.append((self.now_s, data))

    def _sent(self) -> list[bytes]:
        out, self._out = self._out, []
        return out

    def _instant(self, now_ns: int) -> HostNs:
        self._now = HostNs(max(whole_microseconds(now_ns), self._now + 1000))
        return self._now

    def _on_fault(self, message: str, error: Exception) -> None:
        raise AssertionError(message) from error
