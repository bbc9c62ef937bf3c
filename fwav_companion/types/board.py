"""Load and health of the companion computer."""

from __future__ import annotations

import msgspec


class LinkLoad(msgspec.Struct, frozen=True):
    """Traffic of one link."""

    serial: bool
    """Whether the link is a serial line; else it is a network."""
    sent_kib_s: float
    received_kib_s: float


class BoardReport(msgspec.Struct, frozen=True, kw_only=True):
    """State of the companion computer over the last seconds; None or empty where the system does not report it."""

    cpu: tuple[float, ...] = ()
    """Load of each core, 0 to 1."""
    ram_used_mib: int | None = None
    ram_total_mib: int | None = None
    core_celsius: float | None = None
    links: tuple[LinkLoad, ...] = ()
    utc_minus_host_s: float | None = None
    """UTC minus host clock by a synchronised wall clock, seconds; used for times that leave the board."""
