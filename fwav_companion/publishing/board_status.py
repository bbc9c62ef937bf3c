"""ONBOARD_COMPUTER_STATUS (390): how the board is doing, for whoever watches over the vehicle."""

from __future__ import annotations

from collections.abc import Sequence
from math import isfinite
from typing import Any

from fwav_companion.geometry.stamps import NS_PER_US, HostNs
from fwav_companion.publishing.target_report import boot_ms
from fwav_companion.types.board import BoardReport
from fwav_companion.types.situation import Situation

ONBOARD_COMPUTER_STATUS = 390
UNUSED_8, UNUSED_32 = 0xFF, 0xFFFFFFFF
UNUSED_CELSIUS, UNUSED_RPM = 127, 32767
"""The definition's own words for a field that is not used."""
UART, WIRED_NETWORK = 0, 10
"""Of link_type; whether a network is wired, nobody tells us."""


def onboard_computer_status(board: BoardReport, now: HostNs) -> dict[str, Any]:
    """The fields, whose lists hold the first cores and links in their order."""
    celsius = board.core_celsius
    return {
        "time_usec": now // NS_PER_US,
        "uptime": boot_ms(now),
        "type": 0,
        "cpu_cores": _list([_percent(share) for share in board.cpu], 8, UNUSED_8),
        "cpu_combined": _list([], 10, UNUSED_8),
        "gpu_cores": _list([], 4, UNUSED_8),
        "gpu_combined": _list([], 10, UNUSED_8),
        "temperature_board": UNUSED_CELSIUS,
        "temperature_core": _list([] if celsius is None else [_celsius(celsius)], 8, UNUSED_CELSIUS),
        "fan_speed": _list([], 4, UNUSED_RPM),
        "ram_usage": _uint32(board.ram_used_mib),
        "ram_total": _uint32(board.ram_total_mib),
        "storage_type": _list([], 4, UNUSED_32),
        "storage_usage": _list([], 4, UNUSED_32),
        "storage_total": _list([], 4, UNUSED_32),
        "link_type": _list([UART if link.serial else WIRED_NETWORK for link in board.links], 6, UNUSED_32),
        "link_tx_rate": _list([_uint32(link.sent_kib_s) for link in board.links], 6, UNUSED_32),
        "link_rx_rate": _list([_uint32(link.received_kib_s) for link in board.links], 6, UNUSED_32),
        "link_tx_max": _list([], 6, UNUSED_32),
        "link_rx_max": _list([], 6, UNUSED_32),
    }


def requested_board_status(situation: Situation) -> dict[str, Any] | None:
    """For who asks; None until the board has been looked at."""
    return None if situation.board is None else onboard_computer_status(situation.board, situation.now_ns)


def _list(values: Sequence[int], length: int, unused: int) -> tuple[int, ...]:
    return (*values[:length], *(unused,) * (length - len(values)))


def _percent(share: float) -> int:
    return round(100.0 * min(max(share, 0.0), 1.0)) if isfinite(share) else UNUSED_8


def _celsius(celsius: float) -> int:
    return min(max(round(celsius), -128), UNUSED_CELSIUS - 1) if isfinite(celsius) else UNUSED_CELSIUS


def _uint32(value: float | None) -> int:
    return UNUSED_32 if value is None or not 0.0 <= value < UNUSED_32 else round(value)
