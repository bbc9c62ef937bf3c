"""SHELL: what the operating system tells of ports, disks, groups and supply. Reads only; every probe may fail alone."""

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
from fwav_companion.tools.doctor.evidence import Board, Device, Folder, Power
from fwav_companion.tools.doctor.holders import holders
from fwav_companion.tools.doctor.serial_ports import Access, SerialPorts
from fwav_companion.tools.doctor.tree import Tree, group_of, is_there, text_of

VCGENCMD_S: Final = 2.0
UNDERVOLTAGE_NOW, THROTTLED_NOW, UNDERVOLTAGE_SEEN = 1 << 0, 1 << 2, 1 << 16
"""Bits of get_throttled (Raspberry Pi documentation, vcgencmd)."""


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
        self._tree = Tree(root)
        self._may = may
        self._throttled = throttled
        self._environment = environment

    def board(self, config: Config, taken: Mapping[str, str]) -> Board:
        """``taken``: why a link (or ``detections``) could not be opened, by name: its holder is looked for."""
        serial = SerialPorts(self._tree, self._may)
        urls = {link.name: link.parsed_url for link in config.link}
        return Board(
            user=_user(),
            ports=[serial.of(name, url) for name, url in urls.items() if isinstance(url, SerialUrl)],
            folders=list(self._folders(config)),
            cameras=list(self._cameras(config)),
            power=self._power(),
            holders=holders(self._tree, urls | {"detections": config.detections.parsed_url}, taken),
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
            missing_mount=missing_mount(
                path.resolve(), self._tree.text("/proc/self/mountinfo"), self._tree.text("/etc/fstab")
            ),
        )

    def _mount(self, path: Path) -> tuple[str, list[str]]:
        """Type and options of the file system that a path is on: the longest mount point above it, the last of two."""
        best, found = -1, ("", [""])
        for line in self._tree.text("/proc/mounts").splitlines():
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
            media = sorted(self._tree.at("/dev").glob("media[0-9]*"))
            yield self._camera(f"/dev/{media[0].name}" if media else "/dev/media0")

    def _camera(self, device: str) -> Device:
        path = self._tree.at(device)
        exists = is_there(path)
        return Device(device, exists, exists and self._may(path, os.R_OK | os.W_OK), group_of(path) if exists else "")

    def _power(self) -> Power:
        low_now = None
        for sensor in self._tree.listed("/sys/class/hwmon"):
            if text_of(sensor / "name") == "rpi_volt":
                low_now = text_of(sensor / "in0_lcrit_alarm") == "1"
        told = (
            self._tree.text("/sys/devices/platform/soc/soc:firmware/get_throttled")
            or self._throttled().partition("=")[2]
        )
        try:
            bits = int(told.strip(), 16)
        except ValueError:
            return Power(low_now=low_now)
        low_now = bool(low_now) or bool(bits & UNDERVOLTAGE_NOW)
        return Power(low_now, bool(bits & UNDERVOLTAGE_SEEN), bool(bits & THROTTLED_NOW))


def _user() -> str:
    try:
        return getpass.getuser()
    except (OSError, KeyError):
        return str(os.getuid())
