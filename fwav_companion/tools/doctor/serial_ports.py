"""SHELL: what the board tells of the device behind a serial link."""

from __future__ import annotations

import os
from collections.abc import Callable, Iterator
from pathlib import Path
from typing import Final

from fwav_companion.links.url import SerialUrl
from fwav_companion.tools.doctor.evidence import SerialPort
from fwav_companion.tools.doctor.tree import Tree, group_of, is_there, text_of

GLOBS: Final = ("ttyAMA*", "ttyS[0-9]*", "ttyUSB*", "ttyACM*", "serial[0-9]*", "ttyTHS*")
USB_LEVELS: Final = 4
"""From a tty up to the USB device that has the ids: the port, the interface, the device, and one for a hub's own."""

Access = Callable[[Path, int], bool]


class SerialPorts:
    """The serial devices of one board."""

    def __init__(self, tree: Tree, may: Access) -> None:
        self._tree = tree
        self._may = may

    def of(self, link: str, url: SerialUrl) -> SerialPort:
        """The device of one link, by its path or its USB ids."""
        device = url.device or self._by_usb_ids(url.vendor_id, url.product_id)
        called = device or f"USB {url.vendor_id:04x}:{url.product_id:04x}"
        path = self._tree.at(device)
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
        """What is there instead, with the ids that a URL may name."""
        for name in sorted({each.name for glob in GLOBS for each in self._tree.at("/dev").glob(glob)}):
            ids = self._usb_ids(name)
            yield f"/dev/{name} ({ids})" if ids else f"/dev/{name}"

    # USB.

    def _by_usb_ids(self, vendor_id: int, product_id: int) -> str:
        wanted = f"{vendor_id:04x}:{product_id:04x}"
        ttys = (each.name for each in self._tree.listed("/sys/class/tty"))
        return next((f"/dev/{name}" for name in ttys if self._usb_ids(name) == wanted), "")

    def _usb_ids(self, name: str) -> str:
        device = self._tree.at(f"/sys/class/tty/{name}/device").resolve()
        for folder in (device, *device.parents)[:USB_LEVELS]:
            vendor, product = text_of(folder / "idVendor"), text_of(folder / "idProduct")
            if vendor and product:
                return f"{vendor}:{product}"
        return ""

    # What else may be on it.

    @property
    def _is_raspberry_pi(self) -> bool:
        return "Raspberry Pi" in self._tree.text("/proc/device-tree/model")

    def _console(self, name: str) -> str:
        for word in self._tree.text("/proc/cmdline").split():
            if word.startswith("console=") and self._named(word.removeprefix("console=").partition(",")[0]) == name:
                return f"{word} in /proc/cmdline"
        if name in self._tree.text("/sys/class/tty/console/active").split():
            return "/sys/class/tty/console/active"
        return ""

    def _bluetooth(self, name: str) -> str:
        if self._is_raspberry_pi and is_there(self._tree.at("/dev/serial1")) and self._named("serial1") == name:
            return "it is /dev/serial1"
        uart = self._tree.at(f"/sys/class/tty/{name}/device")
        for adapter in self._tree.listed("/sys/class/bluetooth"):
            if is_there(uart) and adapter.resolve().is_relative_to(uart.resolve()):
                return f"it carries {adapter.name}"
        return ""

    def _named(self, device: str) -> str:
        return self._tree.at(f"/dev/{device}").resolve().name
