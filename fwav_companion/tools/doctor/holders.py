"""SHELL: which other process has the port that we could not have, as far as we may look."""

from __future__ import annotations

import os
from collections.abc import Mapping
from typing import Final

from fwav_companion.links.url import LinkUrl, SerialUrl, TcpUrl, UdpUrl, UnixUrl
from fwav_companion.tools.doctor.tree import Tree, text_of

INODE_COLUMN: Final = 9
"""Of /proc/net/udp and tcp (proc(5)); the second is the local address and port, hexadecimal."""


def holders(tree: Tree, urls: Mapping[str, LinkUrl | UnixUrl | None], taken: Mapping[str, str]) -> dict[str, str]:
    """By the name of what it has: "mavproxy.py (pid 812)". ``taken``: why each could not be opened."""
    found = {name: _holder(tree, urls.get(name), why) for name, why in taken.items()}
    return {name: holder for name, holder in found.items() if holder}


def _holder(tree: Tree, url: LinkUrl | UnixUrl | None, why: str) -> str:
    if isinstance(url, UdpUrl | TcpUrl) and "in use" in why:
        return _process_with(tree, _sockets(tree, "tcp" if isinstance(url, TcpUrl) else "udp", url.port))
    if isinstance(url, SerialUrl) and url.device and any(word in why for word in ("busy", "in use", "lock")):
        return _process_with(tree, {str(tree.at(url.device).resolve())})
    return ""


def _sockets(tree: Tree, protocol: str, port: int) -> set[str]:
    """As /proc/PID/fd names them."""
    rows = (tree.text(f"/proc/net/{name}").splitlines()[1:] for name in (protocol, f"{protocol}6"))
    words = (row.split() for table in rows for row in table)
    return {
        f"socket:[{word[INODE_COLUMN]}]"
        for word in words
        if len(word) > INODE_COLUMN and word[1].rpartition(":")[2] == f"{port:04X}"
    }


def _process_with(tree: Tree, targets: set[str]) -> str:
    """The first other process that has one of these open."""
    for process in tree.listed("/proc"):
        if not process.name.isdecimal() or process.name == str(os.getpid()):
            continue
        try:
            if any(str(fd.readlink()) in targets for fd in (process / "fd").iterdir()):
                return f"{text_of(process / 'comm') or 'a process'} (pid {process.name})"
        except OSError:  # another user's, or gone meanwhile
            continue
    return ""
