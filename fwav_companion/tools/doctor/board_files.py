"""SHELL: the board's files, from its root or from a folder that imitates one. Reads only; nothing here raises."""

from __future__ import annotations

import grp
import os
from collections.abc import Mapping
from pathlib import Path
from typing import Final

from fwav_companion.links.url import LinkUrl, SerialUrl, TcpUrl, UdpUrl, UnixUrl

INODE_COLUMN: Final = 9
"""Column of the inode in /proc/net/udp and tcp (proc(5)); the second is the local address and port, hexadecimal."""


class BoardFiles:
    """The board's files by their absolute paths."""

    def __init__(self, root: Path = Path("/")) -> None:
        self._root = root

    def at(self, path: str) -> Path:
        """Return the path below the root."""
        return self._root / path.lstrip("/")

    def text(self, path: str) -> str:
        """Return a file's content, stripped; "" if it cannot be read."""
        return text_of(self.at(path))

    def listed(self, path: str) -> list[Path]:
        """Return the entries of a folder, sorted; none if it cannot be read."""
        try:
            return sorted(self.at(path).iterdir())
        except OSError:
            return []


def is_there(path: Path) -> bool:
    """Return whether the path exists and may be looked at: Path.exists raises where it may not."""
    try:
        path.stat()
    except OSError:
        return False
    return True


def text_of(path: Path) -> str:
    """Return a file's content, stripped; "" if it cannot be read."""
    try:
        return path.read_text(errors="replace").strip("\0\n ")
    except OSError:
        return ""


def group_of(path: Path) -> str:
    """Return the name of a file's group; "" if it has none."""
    try:
        return grp.getgrgid(path.stat().st_gid).gr_name
    except (OSError, KeyError):
        return ""


def port_holders(
    files: BoardFiles, urls: Mapping[str, LinkUrl | UnixUrl | None], taken: Mapping[str, str]
) -> dict[str, str]:
    """Return the process that occupies each port, by name: "mavproxy.py (pid 812)".

    ``taken``: why each port could not be opened, by the same names. A port of another user's process is left out.
    """
    found = {name: _holder(files, urls.get(name), why) for name, why in taken.items()}
    return {name: holder for name, holder in found.items() if holder}


def _holder(files: BoardFiles, url: LinkUrl | UnixUrl | None, why: str) -> str:
    if isinstance(url, UdpUrl | TcpUrl) and "in use" in why:
        return _process_with(files, _sockets(files, "tcp" if isinstance(url, TcpUrl) else "udp", url.port))
    if isinstance(url, SerialUrl) and url.device and any(word in why for word in ("busy", "in use", "lock")):
        return _process_with(files, {str(files.at(url.device).resolve())})
    return ""


def _sockets(files: BoardFiles, protocol: str, port: int) -> set[str]:
    """Return the sockets bound to a port, as /proc/PID/fd names them."""
    rows = (files.text(f"/proc/net/{name}").splitlines()[1:] for name in (protocol, f"{protocol}6"))
    words = (row.split() for table in rows for row in table)
    return {
        f"socket:[{word[INODE_COLUMN]}]"
        for word in words
        if len(word) > INODE_COLUMN and word[1].rpartition(":")[2] == f"{port:04X}"
    }


def _process_with(files: BoardFiles, targets: set[str]) -> str:
    """Return the first other process that has one of the targets open."""
    for process in files.listed("/proc"):
        if not process.name.isdecimal() or process.name == str(os.getpid()):
            continue
        try:
            if any(str(fd.readlink()) in targets for fd in (process / "fd").iterdir()):
                return f"{text_of(process / 'comm') or 'a process'} (pid {process.name})"
        except OSError:  # another user's, or ended meanwhile
            continue
    return ""
