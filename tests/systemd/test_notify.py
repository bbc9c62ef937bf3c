"""sd_notify over real sockets, by path and in the abstract name space."""

import os
import socket
from collections.abc import Iterator
from pathlib import Path

import pytest

from fwav_companion.service.status import SystemdNotifier


@pytest.fixture(name="manager", params=["path", "abstract"])
def _manager(request: pytest.FixtureRequest, tmp_path: Path) -> Iterator[tuple[socket.socket, str]]:
    with socket.socket(socket.AF_UNIX, socket.SOCK_DGRAM) as sock:
        name = str(tmp_path / "notify") if request.param == "path" else f"@fwav-test-{os.getpid()}"
        sock.bind(name.replace("@", "\0"))
        sock.settimeout(20)
        yield sock, name


def test_what_the_manager_hears(manager: tuple[socket.socket, str]):
    sock, name = manager
    notifier = SystemdNotifier({"NOTIFY_SOCKET": name})
    notifier.ready()
    notifier.alive()
    notifier.stopping()
    heard = [sock.recv(1000) for _ in range(3)]
    assert heard == [b"READY=1", b"WATCHDOG=1", b"STOPPING=1"]
    notifier.close()
    notifier.alive()


@pytest.mark.parametrize("environment", [{}, {"NOTIFY_SOCKET": ""}, {"NOTIFY_SOCKET": "vsock:2:1"}])
def test_without_systemd_nothing_happens(environment: dict[str, str]):
    notifier = SystemdNotifier(environment)
    notifier.ready()
    notifier.alive()
    notifier.close()


def test_a_manager_that_is_gone_or_full_stops_nothing(tmp_path: Path):
    notifier = SystemdNotifier({"NOTIFY_SOCKET": str(tmp_path / "gone")})
    notifier.ready()
    notifier.close()
    with socket.socket(socket.AF_UNIX, socket.SOCK_DGRAM) as deaf:
        deaf.bind(str(tmp_path / "full"))
        notifier = SystemdNotifier({"NOTIFY_SOCKET": str(tmp_path / "full")})
        for _ in range(1000):
            notifier.alive()
        notifier.close()
