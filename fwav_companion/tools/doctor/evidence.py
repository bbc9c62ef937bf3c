"""What the doctor judges by: the board, the files, and what the service hears. Nouns, and how to ask the status."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import Any

import msgspec

from fwav_companion.camera import Calibration
from fwav_companion.config import Config
from fwav_companion.localization import ElevationTile
from fwav_companion.mount_points import MissingMount


class SerialPort(msgspec.Struct, frozen=True, kw_only=True):
    """The device of a serial link, as the board has it."""

    link: str
    device: str
    """As configured, or what its USB ids found, or those."""
    baud: int
    exists: bool
    name: str = ""
    """Of the device itself, behind symbolic links: ttyAMA0."""
    allowed: bool = True
    """We may read and write it."""
    group: str = ""
    """That may."""
    console: str = ""
    """Where it says that the kernel's console is there; "" where it is not."""
    bluetooth: str = ""
    """Where it says that Bluetooth is there."""
    mini_uart: bool = False
    """A Raspberry Pi's second one, whose speed follows the core's clock."""
    others: tuple[str, ...] = ()
    """Serial devices that are there."""


class Folder(msgspec.Struct, frozen=True, kw_only=True):
    """A directory that is to be written."""

    key: str
    """Of the configuration."""
    path: str
    writable: bool
    read_only: bool
    """The file system is mounted so."""
    file_system: str
    """Its type, as ext4 or tmpfs; "" where that cannot be told."""
    free_bytes: int | None
    missing_mount: MissingMount | None = None
    """Mount point above the directory that is not mounted."""


class Device(msgspec.Struct, frozen=True):
    """A camera's device file."""

    path: str
    exists: bool
    allowed: bool
    group: str


class Power(msgspec.Struct, frozen=True):
    """What the board's supply monitor says; None where there is none."""

    low_now: bool | None = None
    low_since_boot: bool | None = None
    throttled_now: bool | None = None


class Board(msgspec.Struct, frozen=True, kw_only=True):
    """What the operating system tells."""

    user: str = ""
    ports: Sequence[SerialPort] = ()
    folders: Sequence[Folder] = ()
    cameras: Sequence[Device] = ()
    power: Power = Power()
    holders: Mapping[str, str] = {}
    """Who has the port of a link (or of ``detections``) that we could not have: "mavproxy.py (pid 812)"."""


class Files(msgspec.Struct, frozen=True, kw_only=True):
    """What the configuration names, or why it cannot be had."""

    calibration: Calibration | None = None
    calibration_error: str = ""
    elevation: Sequence[ElevationTile] = ()
    elevation_error: str = ""
    key_error: str = ""


class Evidence(msgspec.Struct, frozen=True, kw_only=True):
    """All of it."""

    config: Config
    board: Board
    files: Files
    status: Mapping[str, Any]
    """As the status file has it; empty where the service could not even be listened with."""

    def ask(self, *path: str) -> Any:
        """A value of the status; None where it says nothing."""
        value: Any = self.status
        for key in path:
            if not isinstance(value, Mapping) or key not in value:
                return None
            value = value[key]
        return value

    def number(self, *path: str) -> float:
        """A number of the status; 0 where it says none."""
        value = self.ask(*path)
        return float(value) if isinstance(value, int | float) else 0.0

    def traffic(self, link: str) -> Mapping[str, Any]:
        """What a link carried."""
        for each in self.ask("traffic") or ():
            if isinstance(each, Mapping) and each.get("name") == link:
                return each
        return {}

    @property
    def autopilot(self) -> Mapping[str, Any] | None:
        """The adopted one."""
        found = self.ask("autopilot")
        return found if isinstance(found, Mapping) else None
