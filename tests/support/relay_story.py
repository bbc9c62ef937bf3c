"""Ten minutes of a network, written before any relay runs: every frame with its arrival time and link, and the links to
which the routing rules send it.

Four links: a vehicle uses two of them at once, and each loses its own share; it reboots every two minutes, and is
heard on both links again at once, so that no route is stale. Two ground stations have one each. The rules are
implemented here in a few plain lines of their own (MAVLink guide, routing).
"""

from __future__ import annotations

import random
from collections.abc import Iterator
from typing import NamedTuple

from mavlink_wire import Wire, unknown_frame
from pymavlink.dialects.v20 import ardupilotmega as dialect

VEHICLE_LINKS, STATION_LINKS = ("fc1", "fc2"), ("gs1", "gs2")
LINKS = VEHICLE_LINKS + STATION_LINKS
VEHICLE, COMPANION = (1, 1), (1, 191)
STATIONS = {"gs1": (255, 190), "gs2": (254, 190)}
STEP_MS = 10
SECOND_COPY_MS = 3
REBOOT_EVERY_S, REBOOT_TAKES_S = 120, 4
LOSS = 0.05


class Event(NamedTuple):
    """One frame that arrives by one link."""

    at_ms: int
    link: str
    frame: bytes
    to: tuple[str, ...]


class Rules:
    """Links by which each component was heard, and so the destinations of a frame."""

    def __init__(self) -> None:
        self._heard: dict[str, set[tuple[int, int]]] = {link: set() for link in LINKS}

    def hear(self, link: str, sender: tuple[int, int]) -> None:
        self._heard[link].add(sender)

    def everywhere(self, link: str, sender: tuple[int, int]) -> tuple[str, ...]:
        """Destinations of a broadcast: every link except those of its sender."""
        return tuple(out for out in LINKS if out != link and sender not in self._heard[out])

    def where(self, link: str, target: tuple[int, int]) -> tuple[str, ...]:
        """Destinations of an addressed frame: the links where the component was heard; without a component, those of
        the whole system.
        """
        system, component = target
        return tuple(
            out
            for out in LINKS
            if out != link and any(heard[0] == system and component in (0, heard[1]) for heard in self._heard[out])
        )


class Vehicle:
    """Sends the standard stream, and answers the first station."""

    def __init__(self, rng: random.Random) -> None:
        self._rng = rng
        self._wire = Wire(*VEHICLE)
        self._booted_ms = 0

    def reboot(self, at_ms: int) -> None:
        self._wire = Wire(*VEHICLE)
        self._booted_ms = at_ms

    def speak(self, at_ms: int) -> tuple[bytes, str]:
        """(frame of this step, its kind)."""
        boot_ms, step = at_ms - self._booted_ms, at_ms // STEP_MS
        wire = self._wire
        if step % 100 == 0:
            return wire.heartbeat(), "to all"
        if step % 100 == 1:
            return wire.frame("SYSTEM_TIME", 1_790_000_000_000_000 + at_ms * 1000, boot_ms), "clock"
        if step % 100 == 2:
            return wire.frame("COMMAND_ACK", 400, 0, 0, 0, *STATIONS["gs1"]), "to gs1"
        if step % 100 == 3:
            payload = bytes(self._rng.randrange(256) for _ in range(20))
            frame = unknown_frame(payload=payload, seq=wire.mav.seq)
            wire.mav.seq = (wire.mav.seq + 1) % 256
            return frame, "to all"
        if step % 5 == 0:
            place = (480_000_000 + step, 110_000_000, 520_000, 10_000, 1, 2, 3, 4)
            return wire.frame("GLOBAL_POSITION_INT", boot_ms, *place), "to all"
        return wire.attitude(boot_ms), "to all"


class Station:
    """One ground station: its messages in each second, by tenths of it."""

    def __init__(self, link: str, rng: random.Random) -> None:
        self.link = link
        self.sender = STATIONS[link]
        self._wire = Wire(*self.sender)
        self._rng = rng

    def speak(self, tenth: int) -> tuple[bytes, tuple[int, int] | str] | None:
        """(frame, its target); a word in place of the target where a special rule applies."""
        wire = self._wire
        match tenth:
            case 0:
                return wire.heartbeat(dialect.MAV_TYPE_GCS, dialect.MAV_AUTOPILOT_INVALID), "all"
            case 2:
                return wire.command(*VEHICLE), VEHICLE
            case 3:
                return wire.frame("PARAM_REQUEST_READ", VEHICLE[0], 0, b"PLND_LAG", -1), (VEHICLE[0], 0)
            case 4:
                return wire.command(*COMPANION, command=2010), "none"
            case 5:
                return wire.frame("REQUEST_DATA_STREAM", *VEHICLE, 10, 4, 1), "none"
            case 6:
                return wire.frame("SETUP_SIGNING", *VEHICLE, bytes(32), 1), "none"
            case 7:
                other = next(sender for sender in STATIONS.values() if sender != self.sender)
                return wire.frame("FILE_TRANSFER_PROTOCOL", 0, *other, bytes(251)), other
            case 8:
                return wire.command(9, 1), (9, 1)
        return None


def story(seconds: int, seed: int = 1) -> Iterator[Event]:
    """All events in the order of time."""
    rng = random.Random(seed)
    rules, vehicle = Rules(), Vehicle(rng)
    stations = [Station(link, rng) for link in STATION_LINKS]
    for at_ms in range(0, seconds * 1000, STEP_MS):
        in_cycle_s = at_ms / 1000 % REBOOT_EVERY_S
        away = in_cycle_s >= REBOOT_EVERY_S - REBOOT_TAKES_S
        if in_cycle_s == 0 and at_ms:
            vehicle.reboot(at_ms)
        if not away:
            frame, what = vehicle.speak(at_ms)
            draw = rng.random()
            lost_by = "fc1" if draw < LOSS else "fc2" if draw < 2 * LOSS else ""
            for when_ms, link in ((at_ms, "fc1"), (at_ms + SECOND_COPY_MS, "fc2")):
                if link != lost_by:
                    first = "fc1" in (link, lost_by)
                    yield Event(when_ms, link, frame, _from_vehicle(rules, link, what) if first else ())
                    if not first and what == "to gs1":
                        rules.hear(
                            link, VEHICLE
                        )  # it was never sent to this link: not an echo of ours but a second path
        if at_ms % 100 == 0 and 1.0 < in_cycle_s < REBOOT_EVERY_S - REBOOT_TAKES_S - 1.0:
            for station in stations:
                yield from _from_station(rules, station, at_ms)


def _from_vehicle(rules: Rules, link: str, what: str) -> tuple[str, ...]:
    """Destinations of a first copy. A second copy may be an echo of our own frame: no sender is learned from a link to
    which the frame was sent.
    """
    rules.hear(link, VEHICLE)
    return rules.where(link, STATIONS["gs1"]) if what == "to gs1" else rules.everywhere(link, VEHICLE)


def _from_station(rules: Rules, station: Station, at_ms: int) -> Iterator[Event]:
    spoken = station.speak(at_ms // 100 % 10)
    if spoken is None:
        return
    frame, whom = spoken
    rules.hear(station.link, station.sender)
    if whom == "all":
        to = rules.everywhere(station.link, station.sender)
    elif isinstance(whom, tuple):
        to = rules.where(station.link, whom)
    else:
        to = ()
    yield Event(at_ms + 2 * SECOND_COPY_MS, station.link, frame, to)
