"""SHELL: a ground station over any number of links: heartbeats and rate requests out, messages in.

It asks vehicles for the few messages that the picture needs, as every ground station does, and for nothing else.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from math import nan

from fwav_companion.ground.picture import GroundPicture
from fwav_companion.ground.target_messages import TargetMessages
from fwav_companion.ground.vehicle_messages import VehicleMessages
from fwav_companion.links.base import Link
from fwav_companion.links.reconnect import make_link
from fwav_companion.links.url import LinkUrl, SerialUrl, TcpUrl
from fwav_companion.mavlink.wire.codec import Encoder, decode
from fwav_companion.mavlink.wire.definitions import definition_of
from fwav_companion.mavlink.wire.enums import (
    MAV_AUTOPILOT_INVALID,
    MAV_CMD_REQUEST_MESSAGE,
    MAV_CMD_SET_MESSAGE_INTERVAL,
    MAV_STATE_ACTIVE,
    MAV_TYPE_GCS,
)
from fwav_companion.mavlink.wire.frames import RawFrame
from fwav_companion.mavlink.wire.scanner import Scanner

STATION = 254
"""System id of this station: other stations use 255."""
COMPONENT = 190
AUTOPILOT, CAMERA = 1, 100
WANTED_HZ = {"GLOBAL_POSITION_INT": 4.0, "ATTITUDE": 4.0, "SYS_STATUS": 1.0, "GPS_RAW_INT": 1.0}
REQUEST_STEP_S = 10.0
PROMPT_ROUNDS = 6
"""Rounds of requests to a vehicle after which they become rare: if it does not answer in a minute, it may not have the
message; or it is not the one that was heard before, or has rebooted since."""
RARE_STEP_S = 60.0
FRESH_S = 5.0
"""Age of a message up to which it needs no request."""


class Asked:
    """Requests that were sent to one vehicle."""

    def __init__(self, link: str) -> None:
        self.link = link
        """Name of the link on which it was heard last."""
        self.rounds = 0
        self.due_unix = 0.0
        self.heard: dict[str, float] = {}
        """Instant of the newest message of each wanted type, by name."""


class PictureStation:
    """The ground station: its links and its requests."""

    def __init__(
        self, urls: Sequence[LinkUrl], picture: GroundPicture, *, clock: Callable[[], float], hfov_deg: float | None
    ) -> None:
        """``clock``: Unix seconds of this process."""
        self._picture, self._clock = picture, clock
        self.vehicles = VehicleMessages(picture, hfov_deg)
        self._targets = TargetMessages(picture)
        self._urls = {f"link {index}": url for index, url in enumerate(urls, 1)}
        self._links: dict[str, Link] = {}
        self._scanners: dict[str, Scanner] = {}
        self._encoders: dict[str, Encoder] = {}
        self._asked: dict[int, Asked] = {}
        """By system id, at most 256."""
        self._beat_unix = 0.0

    def start(self) -> None:
        """Open every link. Called once, from a running loop."""
        for name, url in self._urls.items():
            self._scanners[name] = Scanner(datagrams=not isinstance(url, SerialUrl | TcpUrl))
            self._encoders[name] = Encoder(STATION, COMPONENT)
            self._links[name] = make_link(name, url, self._on_bytes, self._on_state)
            self._picture.on_source(str(url), works=False, text="opening")
            self._links[name].start()

    def close(self) -> None:
        """Close every link."""
        for link in self._links.values():
            link.close()

    def tick(self, now: float) -> None:
        """Write the received data to the picture; send the heartbeat and the requests that are due."""
        self.vehicles.flush(now)
        self._targets.flush(now)
        if now >= self._beat_unix + 1.0:
            self._beat_unix = now
            for name, link in self._links.items():
                link.send(self._encoders[name].encode("HEARTBEAT", HEARTBEAT))
        for system, asked in self._asked.items():
            if now >= asked.due_unix:
                asked.rounds += 1
                asked.due_unix = now + (REQUEST_STEP_S if asked.rounds < PROMPT_ROUNDS else RARE_STEP_S)
                self._ask(system, asked, now)

    def _on_bytes(self, name: str, data: bytes) -> bool:
        now = self._clock()
        subscribes = False
        for frame in self._scanners[name].feed(data):
            if frame.definition is None or frame.system == STATION:
                continue
            subscribes = True
            self._on_frame(name, frame, now)
        return subscribes

    def _on_frame(self, link: str, frame: RawFrame, now: float) -> None:
        message = decode(frame, link)
        self.vehicles.on_message(message, now)
        if not self.vehicles.knows(message.system):
            return
        self._targets.on_message(message, now)
        asked = self._asked.get(message.system)
        if asked is None:
            asked = self._asked[message.system] = Asked(link)
            asked.due_unix = now + 2.0  # the vehicle may send these by itself
        asked.link = link
        if message.name in WANTED_HZ or message.name == "CAMERA_INFORMATION":
            asked.heard[message.name] = now

    def _ask(self, system: int, asked: Asked, now: float) -> None:
        """Ask for the wanted messages that are not heard."""
        encoder, link = self._encoders[asked.link], self._links[asked.link]
        for name, hertz in WANTED_HZ.items():
            if now > asked.heard.get(name, 0.0) + FRESH_S:
                params = (float(definition_of(name).msgid), 1e6 / hertz)
                link.send(encoder.encode("COMMAND_LONG", command(system, AUTOPILOT, SET_INTERVAL, params)))
        if "CAMERA_INFORMATION" not in asked.heard:
            params = (float(definition_of("CAMERA_INFORMATION").msgid), nan)
            link.send(encoder.encode("COMMAND_LONG", command(system, CAMERA, REQUEST, params)))

    def _on_state(self, name: str, up: bool, why: str) -> None:
        self._picture.on_source(str(self._urls[name]), works=up, text="open" if up else f"not open: {why}")


SET_INTERVAL, REQUEST = MAV_CMD_SET_MESSAGE_INTERVAL, MAV_CMD_REQUEST_MESSAGE
HEARTBEAT = {
    "type": MAV_TYPE_GCS,
    "autopilot": MAV_AUTOPILOT_INVALID,
    "base_mode": 0,
    "custom_mode": 0,
    "system_status": MAV_STATE_ACTIVE,
}


def command(system: int, component: int, number: int, params: tuple[float, float]) -> dict[str, float]:
    """Fields of a COMMAND_LONG with two parameters."""
    fields: dict[str, float] = {"target_system": system, "target_component": component, "command": number}
    fields |= {f"param{index}": 0.0 for index in range(1, 8)}
    return fields | {"confirmation": 0, "param1": params[0], "param2": params[1]}
