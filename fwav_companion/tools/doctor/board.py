"""SHELL: probes serial devices, disks, cameras and supply. Reads only; every probe may fail alone."""

from __future__ import annotations

import getpass
import os
import subprocess
from collections.abc import Callable, Iterator, Mapping
from pathlib import Path
from typing import Final

from fwav_companion.config import Config
from fwav_companion.links.url import SerialUrl
from fwav_companion.mount_points import missing_mount
from fwav_companion.service.latest_file import state_path
from fwav_companion.tools.doctor.board_files import BoardFiles, group_of, is_there, port_holders, text_of
from fwav_companion.tools.doctor.evidence import Board, Device, Folder, Power, SerialPort
from fwav_companion.vision.task import shown_source

VCGENCMD_S: Final = 2.0
UNDERVOLTAGE_NOW, THROTTLED_NOW, UNDERVOLTAGE_SEEN = 1 << 0, 1 << 2, 1 << 16
"""Bits of get_throttled (Raspberry Pi documentation, vcgencmd)."""
GLOBS: Final = ("ttyAMA*", "ttyS[0-9]*", "ttyUSB*", "ttyACM*", "serial[0-9]*", "ttyTHS*")
USB_LEVELS: Final = 4
"""Folders from a tty up to the USB device with the ids: port, interface, device, and one more for a hub."""

Access = Callable[[Path, int], bool]


def vcgencmd() -> str:
    """Return ``throttled=0x50005`` on a Raspberry Pi with its tools; "" elsewhere."""
    try:
        done = subprocess.run(["vcgencmd", "get_throttled"], capture_output=True, text=True, timeout=VCGENCMD_S)  # noqa: S607
    except (OSError, subprocess.SubprocessError):
        return ""
    return done.stdout


class Probe:
    """Probes one board: this one, or a folder of files that imitates one."""

    def __init__(
        self,
        root: Path = Path("/"),
        *,
        may: Access = os.access,
        throttled: Callable[[], str] = vcgencmd,
        environment: Mapping[str, str] = os.environ,
    ) -> None:
        self._files = BoardFiles(root)
        self._may = may
        self._throttled = throttled
        self._environment = environment

    def board(self, config: Config, taken: Mapping[str, str]) -> Board:
        """Return the state of the board. ``taken``: why a link (or ``detections``) could not be opened, by name."""
        serial = SerialDevices(self._files, self._may)
        urls = {link.name: link.parsed_url for link in config.link}
        return Board(
            user=_user(),
            ports=[serial.of(name, url) for name, url in urls.items() if isinstance(url, SerialUrl)],
            folders=list(self._folders(config)),
            cameras=list(self._cameras(config)),
            power=self._power(),
            holders=port_holders(self._files, urls | {"detections": config.detections.parsed_url}, taken),
        )

    # Disks.

    def _folders(self, config: Config) -> Iterator[Folder]:
        if config.record.directory:
            yield self._folder("[record] directory", config.resolve(config.record.directory).absolute())
        configured = config.resolve(config.state.directory) if config.state.directory else None
        state = state_path(configured, "x", self._environment)
        if state is not None:
            yield self._folder("[state] directory", state.parent.absolute())

    def _folder(self, key: str, path: Path) -> Folder:
        there = next(each for each in (path, *path.parents) if is_there(each))
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
            file_in_the_way="" if there.is_dir() else str(there),
            missing_mount=missing_mount(
                path.resolve(), self._files.text("/proc/self/mountinfo"), self._files.text("/etc/fstab")
            ),
        )

    def _mount(self, path: Path) -> tuple[str, list[str]]:
        """Return type and options of the file system of a path: the longest mount point above it, the last of two."""
        best, found = -1, ("", [""])
        for line in self._files.text("/proc/mounts").splitlines():
            words = line.split()
            if len(words) < 4:
                continue
            point = Path(words[1].replace("\\040", " "))
            if path.is_relative_to(point) and len(point.parts) >= best:
                best, found = len(point.parts), (words[2], words[3].split(","))
        return found

    # Cameras and supply.

    def _cameras(self, config: Config) -> Iterator[Device]:
        source = shown_source(config.vision) if config.vision is not None else ""
        if source.startswith("/dev/"):
            yield self._camera(source)
        elif source.startswith("libcamera:"):
            media = sorted(self._files.at("/dev").glob("media[0-9]*"))
            yield self._camera(f"/dev/{media[0].name}" if media else "/dev/media0")

    def _camera(self, device: str) -> Device:
        path = self._files.at(device)
        exists = is_there(path)
        return Device(device, exists, exists and self._may(path, os.R_OK | os.W_OK), group_of(path) if exists else "")

    def _power(self) -> Power:
        low_now = None
        for sensor in self._files.listed("/sys/class/hwmon"):
            if text_of(sensor / "name") == "rpi_volt":
                low_now = text_of(sensor / "in0_lcrit_alarm") == "1"
        reported = (
            self._files.text("/sys/devices/platform/soc/soc:firmware/get_throttled")
            or self._throttled().partition("=")[2]
        )
        try:
            bits = int(reported.strip(), 16)
        except ValueError:
            return Power(low_now=low_now)
        low_now = bool(low_now) or bool(bits & UNDERVOLTAGE_NOW)
        return Power(low_now, bool(bits & UNDERVOLTAGE_SEEN), bool(bits & THROTTLED_NOW))


class SerialDevices:
    """The serial devices of one board, with what else may use them."""

    def __init__(self, files: BoardFiles, may: Access) -> None:
        self._files = files
        self._may = may

    def of(self, link: str, url: SerialUrl) -> SerialPort:
        """Return the device of one link, found by its path or its USB ids."""
        device = url.device or self._by_usb_ids(url.vendor_id, url.product_id)
        called = device or f"USB {url.vendor_id:04x}:{url.product_id:04x}"
        path = self._files.at(device)
        if not device or not is_there(path):
            return SerialPort(link=link, device=called, baud=url.baud, exists=False, others=tuple(self._others()))
        name = path.resolve().name
        return SerialPort(
            link=link,
            device=called,
            baud=url.baud,
            exists=True,
            name=name,
            allowed=self._may(path, os.R_OK | os.W_OK),
            group=group_of(path),
            console=self._console(name),
            bluetooth=self._bluetooth(name),
            mini_uart=name == "ttyS0" and self._is_raspberry_pi,
        )

    def _others(self) -> Iterator[str]:
        """Yield the devices that are present, with the ids that a URL may name."""
        for name in sorted({each.name for glob in GLOBS for each in self._files.at("/dev").glob(glob)}):
            ids = self._usb_ids(name)
            yield f"/dev/{name} ({ids})" if ids else f"/dev/{name}"

    def _by_usb_ids(self, vendor_id: int, product_id: int) -> str:
        wanted = f"{vendor_id:04x}:{product_id:04x}"
        ttys = (each.name for each in self._files.listed("/sys/class/tty"))
        return next((f"/dev/{name}" for name in ttys if self._usb_ids(name) == wanted), "")

    def _usb_ids(self, name: str) -> str:
        device = self._files.at(f"/sys/class/tty/{name}/device").resolve()
        for folder in (device, *device.parents)[:USB_LEVELS]:
            vendor, product = text_of(folder / "idVendor"), text_of(folder / "idProduct")
            if vendor and product:
                return f"{vendor}:{product}"
        return ""

    @property
    def _is_raspberry_pi(self) -> bool:
        return "Raspberry Pi" in self._files.text("/proc/device-tree/model")

    def _console(self, name: str) -> str:
        for word in self._files.text("/proc/cmdline").split():
            if word.startswith("console=") and self._resolved(word.removeprefix("console=").partition(",")[0]) == name:
                return f"{word} in /proc/cmdline"
        if name in self._files.text("/sys/class/tty/console/active").split():
            return "/sys/class/tty/console/active"
        return ""

    def _bluetooth(self, name: str) -> str:
        if self._is_raspberry_pi and is_there(self._files.at("/dev/serial1")) and self._resolved("serial1") == name:
            return "it is /dev/serial1"
        uart = self._files.at(f"/sys/class/tty/{name}/device")
        for adapter in self._files.listed("/sys/class/bluetooth"):
            if is_there(uart) and adapter.resolve().is_relative_to(uart.resolve()):
                return f"it carries {adapter.name}"
        return ""

    def _resolved(self, device: str) -> str:
        return self._files.at(f"/dev/{device}").resolve().name


def _user() -> str:
    try:
        return getpass.getuser()
    except (OSError, KeyError):
        return str(os.getuid())
