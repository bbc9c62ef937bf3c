"""How the board itself is doing."""

from __future__ import annotations

import msgspec


class LinkLoad(msgspec.Struct, frozen=True):
    """What one link carries."""

    serial: bool
    """A serial line; else a network."""
    sent_kib_s: float
    received_kib_s: float


class BoardReport(msgspec.Struct, frozen=True, kw_only=True):
    """The computer that we run on, over the last seconds. None, or nothing, where it does not tell."""

    cpu: tuple[float, ...] = ()
    """How busy each core was, 0 to 1."""
    ram_used_mib: int | None = None
    ram_total_mib: int | None = None
    core_celsius: float | None = None
    links: tuple[LinkLoad, ...] = ()
    utc_minus_host_s: float | None = None
    """By the wall clock, where something keeps it synchronised; for times that leave the board."""
