"""Obstacles to using a Raspberry Pi's serial port on GPIO 14 and 15, and the boot files without them. PURE.

Raspberry Pi documentation, "Configure UARTs": on models with Bluetooth the PL011 serves Bluetooth, and GPIO 14 and 15
get the mini UART, whose baud rate follows the core's clock; it is off without ``enable_uart=1``.
"""

from __future__ import annotations

import re
from collections.abc import Iterator
from typing import Final, NamedTuple

from fwav_companion.config import Config
from fwav_companion.links.url import SerialUrl

GPIO_PORTS: Final = frozenset({"/dev/serial0", "/dev/ttyAMA0", "/dev/ttyS0"})
CONSOLE: Final = re.compile(r"console=(serial0|ttyAMA0|ttyS0)(,\S*)?\s*")
WITH_BLUETOOTH: Final = re.compile(r"Raspberry Pi (3|4|400|Compute Module 4|Zero W|Zero 2)\b")
FIFTH: Final = re.compile(r"Raspberry Pi (5|500|Compute Module 5)\b")
"""Models whose UART of the GPIO pins is /dev/ttyAMA0, and whose /dev/serial0 is the connector between the HDMI
sockets."""
BLUETOOTH_MOVED: Final = frozenset(
    {"dtoverlay=disable-bt", "dtoverlay=miniuart-bt", "dtoverlay=pi3-disable-bt", "dtoverlay=pi3-miniuart-bt"}
)


class Blocker(NamedTuple):
    """One thing in the way of the serial port."""

    problem: str
    setting: str
    """Line that config.txt lacks; "" where it is a word in cmdline.txt, or in the service's configuration."""


def gpio_port(config: Config) -> str:
    """Return the first configured device that is on the GPIO pins; "" if no link uses one."""
    devices = (url.device for link in config.link if isinstance(url := link.parsed_url, SerialUrl))
    return next((device for device in devices if device in GPIO_PORTS), "")


def obstacles(port: str, model: str, cmdline: str, config_txt: str) -> Iterator[Blocker]:
    """Yield the obstacles to using the port: login console, UART switched off, Bluetooth on the PL011."""
    for console in CONSOLE.finditer(cmdline):
        yield Blocker(f"the login console uses the serial port ({console[0].strip()} in cmdline.txt)", "")
    settings = settings_for_all(config_txt)
    if FIFTH.search(model):
        if port == "/dev/serial0":
            yield Blocker("/dev/serial0 is the debug connector on this model; use serial:///dev/ttyAMA0:BAUD", "")
        if not {"dtparam=uart0=on", "dtoverlay=uart0", "dtoverlay=uart0-pi5"} & settings:
            yield Blocker("the UART of GPIO 14 and 15 is off (no dtparam=uart0=on in config.txt)", "dtparam=uart0=on")
        return
    if "enable_uart=1" not in settings:
        yield Blocker("the UART is off (no enable_uart=1 in config.txt)", "enable_uart=1")
    if WITH_BLUETOOTH.search(model) and not BLUETOOTH_MOVED & settings:
        problem = "Bluetooth has the PL011, and the mini UART's baud rate follows the core's clock"
        yield Blocker(f"{problem} (no dtoverlay=disable-bt in config.txt)", "dtoverlay=disable-bt")


def settings_for_all(config_txt: str) -> set[str]:
    """Return the settings of config.txt that hold for every model: before any filter, and below ``[all]``."""
    found, holds = set(), True
    for line in config_txt.splitlines():
        words = line.partition("#")[0].replace(" ", "")
        if words.startswith("["):
            holds = words.lower() == "[all]"
        elif words and holds:
            found.add(words)
    return found


def without_console(cmdline: str) -> str:
    """Return cmdline.txt without consoles on the serial port. It must stay one line."""
    return CONSOLE.sub("", cmdline).strip() + "\n"


def with_settings(config_txt: str, settings: list[str]) -> str:
    """Return config.txt with these settings for all models at its end."""
    lines = "".join(f"{setting}\n" for setting in settings)
    return f"{config_txt.rstrip()}\n\n[all]\n# fwav-companion: the serial port for the autopilot\n{lines}"
