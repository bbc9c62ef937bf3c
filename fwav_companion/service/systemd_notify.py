"""SHELL: what Type=notify of systemd wants to hear, over its datagram socket (sd_notify(3)). Elsewhere nothing."""

from __future__ import annotations

import os
import socket
from collections.abc import Mapping


class SystemdNotifier:
    """Tells the service manager that we are ready, alive, stopping. Never blocks, never raises."""

    def __init__(self, environment: Mapping[str, str] = os.environ) -> None:
        """$NOTIFY_SOCKET and $WATCHDOG_USEC as systemd sets them; without the first nobody is told."""
        path = environment.get("NOTIFY_SOCKET", "")
        self._address = f"\0{path[1:]}" if path.startswith("@") else path
        self._socket: socket.socket | None = None
        if path.startswith(("@", "/")):
            self._socket = socket.socket(socket.AF_UNIX, socket.SOCK_DGRAM | socket.SOCK_CLOEXEC)
            self._socket.setblocking(False)
        self.watchdog_period_s: float | None = _watchdog_period_s(environment) if self._socket is not None else None
        """How often :meth:`alive` is expected, seconds: half of what systemd waits. None: not at all."""

    def ready(self) -> None:
        """Started: links are configured."""
        self._send("READY=1")

    def stopping(self) -> None:
        """A clean stop has begun."""
        self._send("STOPPING=1")

    def alive(self) -> None:
        """The watchdog may wait again."""
        self._send("WATCHDOG=1")

    def status(self, text: str) -> None:
        """One line for ``systemctl status``."""
        self._send(f"STATUS={' '.join(text.split())}")

    def close(self) -> None:
        """Release the socket."""
        if self._socket is not None:
            self._socket.close()
            self._socket = None

    def _send(self, message: str) -> None:
        if self._socket is None:
            return
        try:
            self._socket.sendto(message.encode(errors="replace"), self._address)
        except OSError:  # the manager is restarting or busy: the service goes on, the next message may arrive
            return


def _watchdog_period_s(environment: Mapping[str, str]) -> float | None:
    """Half of $WATCHDOG_USEC, if it is meant for this process."""
    microseconds, pid = environment.get("WATCHDOG_USEC", ""), environment.get("WATCHDOG_PID", "")
    if not microseconds.isdecimal() or int(microseconds) == 0 or pid not in ("", str(os.getpid())):
        return None
    return int(microseconds) * 1e-6 / 2
