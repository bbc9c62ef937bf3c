"""Disks that are full, read-only or gone, as file systems of their own under the recording of the real daemon."""

from __future__ import annotations

import os
import shutil
import subprocess
from collections.abc import Callable, Iterator
from contextlib import suppress
from pathlib import Path
from typing import Any

import pytest
from sites import Site
from small_vehicle import Datagrams, SmallVehicle

Until = Callable[[Callable[[dict[str, Any]], bool]], dict[str, Any]]


@pytest.fixture
def disk(site: Site) -> Iterator[Path]:
    """A file system of 64 MiB in memory, on which the daemon records and keeps its state."""
    folder = site.folder / "disk"
    folder.mkdir()
    done = subprocess.run(["mount", "-t", "tmpfs", "-o", "size=64m", "none", folder], capture_output=True, check=False)
    if done.returncode:
        pytest.skip("mounting needs root")
    site.replace('directory = ""                # "" records', 'directory = "disk/records"  # "" records')
    site.replace("min_free_mb = 200", "min_free_mb = 0")
    site.replace('directory = ""                # kept', 'directory = "disk/state"  # kept')
    yield folder
    subprocess.run(["umount", "-l", folder], check=True)


def fill(path: Path) -> None:
    """Write a file until the disk is full."""
    with path.open("wb", buffering=0) as file, suppress(OSError):
        while True:
            file.write(b"x" * 4096)


def records(status: dict[str, Any]) -> bool:
    return status["recording"] is not None and "recording stopped" not in status["recording"]


def flies(status: dict[str, Any]) -> bool:
    return status["autopilot"] is not None and not status["autopilot_lost"]


@pytest.mark.slow
def test_a_disk_that_fills_and_has_room_again(site: Site, disk: Path, until: Until):
    with site.service() as service, SmallVehicle(Datagrams(site.autopilot_port)):
        until(lambda status: flies(status) and list((disk / "records").glob("*/telemetry.tlog")))
        filler = disk / "filler"
        fill(filler)
        service.wait_for("recording stopped: [^\n]*(the disk is full|No space left)", within_s=60.0)
        until(flies)
        site.ground.listen(until="HEARTBEAT", count=3)
        filler.unlink()
        status = until(lambda status: records(status) and len(list((disk / "records").iterdir())) > 1)
        assert service.stop() == 0
    assert service.said.count("recording stopped") == 1
    assert status["internal_faults"] == 0
    assert all((folder / "telemetry.tlog").stat().st_size > 0 for folder in (disk / "records").iterdir())


@pytest.mark.slow
def test_a_disk_that_is_read_only_for_a_while(site: Site, disk: Path, until: Until):
    """As after an error of an SD card, from before the start until it is mounted again."""
    subprocess.run(["mount", "-o", "remount,ro", disk], check=True)
    with site.service() as service, SmallVehicle(Datagrams(site.autopilot_port)):
        service.wait_for("(?i)read-only file system", within_s=60.0)
        until(flies)
        site.ground.listen(until="HEARTBEAT", count=3)
        subprocess.run(["mount", "-o", "remount,rw", disk], check=True)
        status = until(lambda status: records(status) and list((disk / "records").glob("*/telemetry.tlog")))
        assert service.stop() == 0
    assert service.said.count("Read-only file system") <= 2, "the recording, and the state"
    assert status["internal_faults"] == 0


@pytest.mark.slow
def test_a_recording_that_is_removed(site: Site, disk: Path, until: Until):
    with site.service() as service, SmallVehicle(Datagrams(site.autopilot_port)):
        until(lambda status: flies(status) and list((disk / "records").glob("*/telemetry.tlog")))
        shutil.rmtree(disk / "records")
        service.wait_for("recording stopped", within_s=60.0)
        status = until(lambda status: records(status) and list((disk / "records").glob("*/telemetry.tlog")))
        os.sync()
        assert service.stop() == 0
    assert service.said.count("recording stopped") == 1
    assert status["internal_faults"] == 0
