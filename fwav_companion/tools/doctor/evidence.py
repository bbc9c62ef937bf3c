"""The evidence that findings are derived from: board, configured files, and the service's status."""

from __future__ import annotations

from collections.abc import Mapping, Sequence

import msgspec

from fwav_companion.camera import Calibration
from fwav_companion.config import Config
from fwav_companion.localization import ElevationTile
from fwav_companion.mount_points import MissingMount
from fwav_companion.types.status import RunStatus


class SerialPort(msgspec.Struct, frozen=True, kw_only=True):
    """The device of a serial link, as the operating system reports it."""

    link: str
    device: str
    """Path as configured, or found by its USB ids; the ids where nothing was found."""
    baud: int
    exists: bool
    name: str = ""
    """Name of the device itself, behind symbolic links: ttyAMA0."""
    allowed: bool = True
    """Whether this user may read and write the device."""
    group: str = ""
    """Group of the device file."""
    console: str = ""
    """Where the kernel's console is configured on this device; "" if it is not."""
    bluetooth: str = ""
    """Why Bluetooth is known to use this device; "" if it does not."""
    mini_uart: bool = False
    """Whether it is a Raspberry Pi's second UART, whose baud rate follows the core clock."""
    others: tuple[str, ...] = ()
    """Serial devices that are present, if this one is missing."""


class Folder(msgspec.Struct, frozen=True, kw_only=True):
    """A directory that the service writes to."""

    key: str
    """Configuration key that names it."""
    path: str
    writable: bool
    read_only: bool
    """Whether its file system is mounted read-only."""
    file_system: str
    """File system type, as ext4 or tmpfs; "" if unknown."""
    free_bytes: int | None
    missing_mount: MissingMount | None = None
    """Mount point above the directory that is not mounted."""
    file_in_the_way: str = ""
    """File in the place of the directory or of one above it; "" if there is none."""


class Device(msgspec.Struct, frozen=True):
    """A camera's device file."""

    path: str
    exists: bool
    allowed: bool
    group: str


class Power(msgspec.Struct, frozen=True):
    """State of the board's supply; None where the board has no monitor."""

    low_now: bool | None = None
    low_since_boot: bool | None = None
    throttled_now: bool | None = None


class Board(msgspec.Struct, frozen=True, kw_only=True):
    """State of the board as the operating system reports it."""

    user: str = ""
    ports: Sequence[SerialPort] = ()
    folders: Sequence[Folder] = ()
    cameras: Sequence[Device] = ()
    power: Power = Power()
    holders: Mapping[str, str] = {}
    """Process that occupies the port of a link (or of ``detections``), by the link's name: "mavproxy.py (pid 812)"."""


class ModelReport(msgspec.Struct, frozen=True, kw_only=True):
    """How the model of [vision] is read."""

    reading: str = ""
    """Layout, size, preset and sigma."""
    error: str = ""
    """Why it does not run; "" if it does."""
    problem: str = ""
    """What is implausible in its first outputs; "" where nothing is."""
    passes: int = 1
    """Passes of the model for each picture."""
    seconds: float = 0.0
    """Time of all passes over one picture, seconds."""


class Files(msgspec.Struct, frozen=True, kw_only=True):
    """The files that the configuration names, or why they cannot be read."""

    calibration: Calibration | None = None
    calibration_error: str = ""
    elevation: Sequence[ElevationTile] = ()
    elevation_error: str = ""
    key_error: str = ""
    model: ModelReport | None = None


class Evidence(msgspec.Struct, frozen=True, kw_only=True):
    """All evidence of one `check`."""

    config: Config
    board: Board
    files: Files
    status: RunStatus | None
    """The service's status; None if `check` did not listen."""
