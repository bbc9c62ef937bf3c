"""The daemon stopped for ten seconds, ended in every phase, and on a wall clock that steps by days."""

from __future__ import annotations

import os
import signal
import sys
import time
from collections.abc import Callable
from pathlib import Path
from typing import Any

import pytest
from processes import Process
from sites import Site
from small_vehicle import Datagrams, SmallVehicle

Until = Callable[[Callable[[dict[str, Any]], bool]], dict[str, Any]]
STOPPED_S = 10.0
DAY_S = 86_400


def is_settled(status: dict[str, Any]) -> bool:
    return bool(status["clock"]["status"] == "settled")


def moved_ns(before: dict[str, Any], after: dict[str, Any]) -> int:
    """The change of the clock's offset between two statuses."""
    offsets = [status["clock"]["host_from_autopilot_ns"] for status in (before, after)]
    return int(offsets[1] - offsets[0])


@pytest.mark.slow
def test_after_ten_seconds_without_the_processor_it_flies_on(site: Site, until: Until):
    """Its sockets are full of old messages then: they are no reboot, and the clock stays."""
    with site.service() as service, site.mock("--scenario", "unbiased", seconds=90.0):
        service.wait_for("ready: ")
        before = site.status()
        os.kill(service.pid, signal.SIGSTOP)
        time.sleep(STOPPED_S)
        os.kill(service.pid, signal.SIGCONT)
        after = until(
            lambda status: (
                status["up_s"] > before["up_s"] + STOPPED_S
                and status["fixes"] > before["fixes"] + 60
                and not status["autopilot_lost"]
            )
        )
        site.ground.listen(until="CAMERA_TRACKING_GEO_STATUS", count=5)
        assert service.stop() == 0
    assert abs(moved_ns(before, after)) < 50_000_000
    assert after["telemetry"]["reboots"] == before["telemetry"]["reboots"]
    assert after["internal_faults"] == 0
    assert service.said.count("autopilot found") == 1


@pytest.mark.slow
@pytest.mark.parametrize("after_s", [0.0, 0.1, 0.2, 0.4, 0.6, 0.8, 1.0, 1.3, 1.6, 2.0, 3.0, 5.0])
def test_sigterm_ends_it_cleanly_in_every_phase(site: Site, after_s: float):
    """From the first moment that the kernel reports a handler: imports, configuration, adoption, rates, flight."""
    site.replace('directory = ""                # "" records', 'directory = "records"  # "" records')
    with SmallVehicle(Datagrams(site.autopilot_port)), site.service() as service:
        status = Path(f"/proc/{service.pid}/status")
        while not int(status.read_text().partition("SigCgt:")[2].split()[0], 16) >> (signal.SIGTERM - 1) & 1:
            time.sleep(0.001)
        time.sleep(after_s)
        assert service.stop(within_s=20.0) == 0
    assert "Traceback" not in service.said
    assert "fault" not in service.said
    assert not (site.folder / "status.json").exists()


STEPPED_CLOCK = """
import signal, sys, time
offset_ns = [0]
real, real_ns = time.time, time.time_ns
time.time, time.time_ns = lambda: real() + offset_ns[0] / 1e9, lambda: real_ns() + offset_ns[0]
STEPS = {signal.SIGUSR1: 3 * 86_400, signal.SIGUSR2: -5 * 86_400}
for number, step_s in STEPS.items():
    signal.signal(number, lambda *_, step_s=step_s: offset_ns.__setitem__(0, offset_ns[0] + step_s * 10**9))
sys.argv = ["fwav-companion", "run", "--config", "fwav-companion.toml"]
from fwav_companion.__main__ import main
sys.exit(main())
"""


@pytest.mark.slow
def test_a_wall_clock_that_steps_by_days_both_ways_costs_no_target(site: Site, until: Until):
    """Injected into the process. The mock stamps by the wall clock, which does not step: frames stamped before a step
    and after it differ by days from the daemon's clock, and are refused by name until they agree again."""
    service = Process("-c", STEPPED_CLOCK, folder=site.folder, program=(sys.executable,))
    try:
        with site.mock("--scenario", "unbiased", seconds=120.0):
            service.wait_for("ready: ")
            after = until(is_settled)
            for number in (signal.SIGUSR1, signal.SIGUSR2, signal.SIGUSR2):
                before = after
                os.kill(service.pid, number)
                after = until(
                    lambda status, before=before: status["fixes"] > before["fixes"] + 60 and is_settled(status)
                )
                assert abs(moved_ns(before, after)) < 50_000_000
                assert not after["autopilot_lost"]
            assert service.stop() == 0
    finally:
        service.kill()
    assert after["internal_faults"] == 0
    assert after["telemetry"]["reboots"] == 0
    assert "lost target" not in service.said
