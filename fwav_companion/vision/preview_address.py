"""The address of [vision] preview. PURE, shared by the configuration and the vision process."""

from __future__ import annotations

import re

import msgspec

from fwav_companion.http_hosts import is_loopback

SHORTEST_TOKEN = 16
"""Least number of characters: 95 bits of letters and digits, which cannot be guessed over a network."""


class PreviewAddress(msgspec.Struct, frozen=True):
    """Address at which the pictures are served."""

    host: str
    port: int
    token: str
    """Path of the URL without its slash; "": anyone who reaches the address may look."""


def parse_preview(text: str) -> PreviewAddress | None:
    """The address of ``HOST:PORT`` or ``HOST:PORT/TOKEN``; None for "". ValueError with what is accepted."""
    if not text:
        return None
    match = re.fullmatch(r"(?:\[([0-9a-fA-F:]+)\]|([^:/\s\[\]]+)):([0-9]{1,5})(?:/([A-Za-z0-9_-]*))?", text)
    if match is None or not 0 < int(match[3]) < 65536:
        raise ValueError("accepted: HOST:PORT, as 127.0.0.1:8089")
    address = PreviewAddress(match[1] or match[2], int(match[3]), match[4] or "")
    if not is_loopback(address.host) and len(address.token) < SHORTEST_TOKEN:
        raise ValueError(
            "beyond loopback anyone may look; accepted: HOST:PORT/TOKEN with a token of "
            f"{SHORTEST_TOKEN} characters or more, or 127.0.0.1:PORT"
        )
    return address
