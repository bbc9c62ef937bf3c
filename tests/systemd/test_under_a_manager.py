"""The real daemon under a small service manager that does what the unit says: notifications, watchdog, restarts."""

from __future__ import annotations

import os
import signal
import socket
import subprocess
import sys
import time
from collections.abc import Iterator
from contextlib import suppress
from pathlib import Path

import pytest
from sites import Site

UNIT = (Path(__file__).parents[2] / "systemd" / "fwav-companion.service").read_text()
PATIENCE_S = 60.0


def setting(key: str) -> str:
    (value,) = (line.partition("=")[2] for line in UNIT.splitlines() if line.startswith(f"{key}="))
    return value


class Manager:
    """Starts the daemon as a Type=notify service, ends it when the watchdog expires, and restarts it as the unit says.

    systemd.service(5): Restart=always but for the statuses of RestartPreventExitStatus; SIGABRT at the watchdog.
    """

    def __init__(self, folder: Path, watchdog_s: float) -> None:
        self._folder, self._watchdog_s = folder, watchdog_s
        self._socket = socket.socket(socket.AF_UNIX, socket.SOCK_DGRAM)
        self._socket.bind(str(folder / "notify"))
        self.starts = 0
        self.watchdog_kills = 0
        self.stopped = False
        """Whether the service ended and stays so."""
        self.heard: list[str] = []
        self._start()

    def _start(self) -> None:
        self.starts += 1
        self.ready = False
        words = [sys.executable, "-m", "fwav_companion", "run", "--config", "fwav-companion.toml"]
        environment = {
            **os.environ,
            "NOTIFY_SOCKET": str(self._folder / "notify"),
            "WATCHDOG_USEC": str(round(self._watchdog_s * 1e6)),
        }
        environment.pop("WATCHDOG_PID", None)
        self.process = subprocess.Popen(words, cwd=self._folder, env=environment, stderr=subprocess.DEVNULL)
        self._fed_s = time.monotonic()

    def turn(self) -> None:
        """Take one notification, or find that none came for a while; end and restart what must be."""
        self._socket.settimeout(0.1)
        with suppress(TimeoutError):
            self._hear(self._socket.recv(4096).decode())
        if self.ready and time.monotonic() - self._fed_s > self._watchdog_s and self.process.poll() is None:
            self.watchdog_kills += 1
            self.process.send_signal(signal.SIGABRT)
            self.process.send_signal(signal.SIGCONT)
            self.process.wait(PATIENCE_S)
        status = self.process.poll()
        if status is not None and not self.stopped:
            if setting("Restart") == "always" and str(status) not in setting("RestartPreventExitStatus").split():
                time.sleep(min(float(setting("RestartSec")), 0.1))
                self._start()
            else:
                self.stopped = True

    def _hear(self, text: str) -> None:
        self.heard.append(text)
        if text == "READY=1":
            self.ready, self._fed_s = True, time.monotonic()
        elif text == "WATCHDOG=1":
            self._fed_s = time.monotonic()

    def until(self, condition: str) -> None:
        """Turn until this attribute, or this expression of them, is true."""
        deadline = time.monotonic() + PATIENCE_S
        while not eval(condition, {}, vars(self)):
            assert time.monotonic() < deadline, f"{condition} never came true: {self.heard}"
            self.turn()

    def close(self) -> None:
        if self.process.poll() is None:
            self.process.kill()
        self.process.wait()
        self._socket.close()


@pytest.fixture
def site(tmp_path: Path) -> Iterator[Site]:
    site = Site(tmp_path)
    yield site
    site.close()


def test_it_is_ready_feeds_the_watchdog_and_says_that_it_stops(site: Site):
    manager = Manager(site.folder, watchdog_s=float(setting("WatchdogSec")))
    try:
        manager.until("ready")
        manager.until("heard.count('WATCHDOG=1') >= 3")
        manager.process.send_signal(signal.SIGTERM)
        assert manager.process.wait(float(setting("TimeoutStopSec"))) == 0
        while "STOPPING=1" not in manager.heard:
            manager._hear(manager._socket.recv(4096).decode())
    finally:
        manager.close()
    assert manager.heard[0] == "READY=1"
    assert manager.watchdog_kills == 0


@pytest.mark.slow
def test_a_loop_that_stands_still_is_ended_by_the_watchdog_and_started_again(site: Site):
    manager = Manager(site.folder, watchdog_s=4.0)
    try:
        manager.until("ready")
        os.kill(manager.process.pid, signal.SIGSTOP)
        manager.until("watchdog_kills == 1 and starts == 2 and ready")
        manager.until("heard.count('READY=1') == 2")
        site.ground.listen(until="HEARTBEAT", count=2)
    finally:
        manager.close()


@pytest.mark.slow
def test_it_is_started_again_however_often_it_is_killed(site: Site):
    """Five times within seconds, where systemd's default of five starts in 10 s would give up."""
    assert setting("StartLimitIntervalSec") == "0"
    manager = Manager(site.folder, watchdog_s=60.0)
    try:
        for start in range(1, 7):
            manager.until(f"starts == {start} and ready")
            if start < 6:
                manager.process.kill()
        assert not manager.stopped
    finally:
        manager.close()


def test_a_wrong_configuration_is_not_started_again(site: Site):
    site.replace("alpha = 0.125", "alpha = 12.5")
    manager = Manager(site.folder, watchdog_s=60.0)
    try:
        manager.until("stopped")
    finally:
        manager.close()
    assert (manager.starts, manager.process.returncode) == (1, 2)
    assert "READY=1" not in manager.heard
