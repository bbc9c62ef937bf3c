"""SHELL: what the operating system tells of ports, disks, groups and supply. Reads only; every probe may fail alone."""

from __future__ import annotations

import getpass
import grp
import os
import subprocess
from collections.abc import Callable, Iterator, Mapping
from pathlib import Path
from typing import Final

from fwav_companion.config import Config
from fwav_companion.doctor.evidence import Board, Device, Folder, Power, SerialPort
from fwav_companion.files.latest import state_path
from fwav_companion.links.url import SerialUrl, TcpUrl, UdpUrl

SERIAL_GLOBS: Final = ("ttyAMA*", "ttyS[0-9]*", "ttyUSB*", "ttyACM*", "serial[0-9]*", "ttyTHS*")
VCGENCMD_S: Final = 2.0
UNDERVOLTAGE_NOW, THROTTLED_NOW, UNDERVOLTAGE_SEEN = 1 << 0, 1 << 2, 1 << 16
"""Bits of get_throttled (Raspberry Pi documentation, vcgencmd)."""

Access = Callable[[Path, int], bool]


def vcgencmd() -> str:
    """``throttled=0x50005`` on a Raspberry Pi with its tools; "" elsewhere."""
    try:
        done = subprocess.run(["vcgencmd", "get_throttled"], capture_output=True, text=True, timeout=VCGENCMD_S)  # noqa: S607
    except (OSError, subprocess.SubprocessError):
        return ""
    return done.stdout


class Probe:
    """Looks at one board: this one, or a tree of files that looks like one."""

    def __init__(
        self,
        root: Path = Path("/"),
        *,
        may: Access = os.access,
        throttled: Callable[[], str] = vcgencmd,
        environment: Mapping[str, str] = os.environ,
    ) -> None:
        self._root = root
        self._may = may
        self._throttled = throttled
        self._environment = environment

    def board(self, config: Config, taken: Mapping[str, str]) -> Board:
        """``taken``: why a link (or ``detections``) could not be opened, by name: its holder is looked for."""
        return Board(
            user=_user(),
            ports=[
                self._serial(link.name, link.parsed_url)
                for link in config.link
                if isinstance(link.parsed_url, SerialUrl) and link.parsed_url.device
            ],
            folders=list(self._folders(config)),
            cameras=list(self._cameras(config)),
            power=self._power(),
            holders=self._holders(config, taken),
        )

    # Serial ports.

    def _serial(self, link: str, url: SerialUrl) -> SerialPort:
        path = self._at(url.device)
        others = sorted({f"/dev/{each.name}" for glob in SERIAL_GLOBS for each in self._at("/dev").glob(glob)})
        if not path.exists():
            return SerialPort(link=link, device=url.device, baud=url.baud, exists=False, others=tuple(others))
        name = path.resolve().name
        return SerialPort(
            link=link,
            device=url.device,
            baud=url.baud,
            exists=True,
            name=name,
            allowed=self._may(path, os.R_OK | os.W_OK),
            group=_group(path),
            console=self._console(name),
            bluetooth=self._bluetooth(name),
            mini_uart=name == "ttyS0" and "Raspberry Pi" in self._text("/proc/device-tree/model"),
            others=tuple(others),
        )

    def _console(self, name: str) -> str:
        for word in self._text("/proc/cmdline").split():
            if word.startswith("console=") and self._named(word.removeprefix("console=").partition(",")[0]) == name:
                return f"{word} in /proc/cmdline"
        if name in self._text("/sys/class/tty/console/active").split():
            return "/sys/class/tty/console/active"
        return ""

    def _bluetooth(self, name: str) -> str:
        serial1 = self._at("/dev/serial1")
        if (
            "Raspberry Pi" in self._text("/proc/device-tree/model")
            and serial1.exists()
            and self._named("serial1") == name
        ):
            return "it is /dev/serial1"
        uart = self._at(f"/sys/class/tty/{name}/device").resolve()
        for adapter in self._listed("/sys/class/bluetooth"):
            if self._at(f"/sys/class/tty/{name}/device").exists() and adapter.resolve().is_relative_to(uart):
                return f"it carries {adapter.name}"
        return ""

    def _named(self, device: str) -> str:
        return self._at(f"/dev/{device}").resolve().name

    # Disks.

    def _folders(self, config: Config) -> Iterator[Folder]:
        if config.record.directory:
            yield self._folder("[record] directory", config.resolve(config.record.directory).absolute())
        configured = config.resolve(config.state.directory) if config.state.directory else None
        state = state_path(configured, "x", self._environment)
        if state is not None:
            yield self._folder("[state] directory", state.parent.absolute())

    def _folder(self, key: str, path: Path) -> Folder:
        there = next(each for each in (path, *path.parents) if each.exists())
        file_system, options = self._mount(there.resolve())
        try:
            disk = os.statvfs(there)
            free_bytes: int | None = disk.f_bavail * disk.f_frsize
        except OSError:
            free_bytes = None
        return Folder(
            key=key,
            path=str(path),
            writable=self._may(there, os.W_OK | os.X_OK),
            read_only="ro" in options,
            file_system=file_system,
            free_bytes=free_bytes,
        )

    def _mount(self, path: Path) -> tuple[str, list[str]]:
        """Type and options of the file system that a path is on: the longest mount point above it, the last of two."""
        best, found = -1, ("", [""])
        for line in self._text("/proc/mounts").splitlines():
            words = line.split()
            if len(words) < 4:
                continue
            point = Path(words[1].replace("\\040", " "))
            if path.is_relative_to(point) and len(point.parts) >= best:
                best, found = len(point.parts), (words[2], words[3].split(","))
        return found

    # Cameras and supply.

    def _cameras(self, config: Config) -> Iterator[Device]:
        source = config.vision.source if config.vision is not None else ""
        if source.startswith("/dev/"):
            yield self._camera(source)
        elif source.startswith("libcamera:"):
            media = sorted(self._at("/dev").glob("media[0-9]*"))
            yield self._camera(f"/dev/{media[0].name}" if media else "/dev/media0")

    def _camera(self, device: str) -> Device:
        path = self._at(device)
        exists = path.exists()
        return Device(device, exists, exists and self._may(path, os.R_OK | os.W_OK), _group(path) if exists else "")

    def _power(self) -> Power:
        low_now = None
        for sensor in self._listed("/sys/class/hwmon"):
            if _read(sensor / "name") == "rpi_volt":
                low_now = _read(sensor / "in0_lcrit_alarm") == "1"
        told = self._text("/sys/devices/platform/soc/soc:firmware/get_throttled") or self._throttled().partition("=")[2]
        try:
            bits = int(told.strip(), 16)
        except ValueError:
            return Power(low_now=low_now)
        low_now = bool(low_now) or bool(bits & UNDERVOLTAGE_NOW)
        return Power(low_now, bool(bits & UNDERVOLTAGE_SEEN), bool(bits & THROTTLED_NOW))

    # Who has a port.

    def _holders(self, config: Config, taken: Mapping[str, str]) -> dict[str, str]:
        urls = {link.name: link.parsed_url for link in config.link} | {"detections": config.detections.parsed_url}
        holders = {}
        for name, why in taken.items():
            url = urls.get(name)
            if "in use" in why and isinstance(url, UdpUrl | TcpUrl):
                protocol = "tcp" if isinstance(url, TcpUrl) else "udp"
                holder = self._process_of(self._inodes(protocol, url.port))
            elif isinstance(url, SerialUrl) and ("busy" in why or "in use" in why or "lock" in why):
                holder = self._process_with({str(self._at(url.device).resolve())})
            else:
                continue
            if holder:
                holders[name] = holder
        return holders

    def _inodes(self, protocol: str, port: int) -> set[str]:
        rows = (self._text(f"/proc/net/{name}").splitlines()[1:] for name in (protocol, f"{protocol}6"))
        words = (row.split() for table in rows for row in table)
        return {word[9] for word in words if len(word) > 9 and word[1].rpartition(":")[2] == f"{port:04X}"}

    def _process_of(self, inodes: set[str]) -> str:
        return self._process_with({f"socket:[{inode}]" for inode in inodes})

    def _process_with(self, targets: set[str]) -> str:
        """The first other process that has one of these open, as far as we may look."""
        for process in self._listed("/proc"):
            if not process.name.isdecimal() or process.name == str(os.getpid()):
                continue
            try:
                if any(str(fd.readlink()) in targets for fd in (process / "fd").iterdir()):
                    return f"{_read(process / 'comm') or 'a process'} (pid {process.name})"
            except OSError:  # another user's, or gone meanwhile
                continue
        return ""

    # Files.

    def _at(self, path: str) -> Path:
        return self._root / path.lstrip("/")

    def _text(self, path: str) -> str:
        return _read(self._at(path))

    def _listed(self, path: str) -> list[Path]:
        try:
            return sorted(self._at(path).iterdir())
        except OSError:
            return []


def _read(path: Path) -> str:
    try:
        return path.read_text(errors="replace").strip("\0\n ")
    except OSError:
        return ""


def _group(path: Path) -> str:
    try:
        number = path.stat().st_gid
        return grp.getgrgid(number).gr_name
    except (OSError, KeyError):
        return ""


def _user() -> str:
    try:
        return getpass.getuser()
    except (OSError, KeyError):
        return str(os.getuid())
