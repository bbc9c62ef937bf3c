"""The status file of a service that flies with the mock, and `check --json` with and without that service."""

from __future__ import annotations

import json
import socket
import subprocess
import sys
import time
from collections.abc import Iterable
from pathlib import Path
from typing import Any

import pytest
from frozen import FREEZING, differences, frozen, hold, keys
from sites import Site

TABLES = {"status.links", "status.traffic[].peers[].rates_hz"}
"""Objects whose keys are names of links and messages."""
PATIENCE_S = 60.0
FREEZING_S = 20.0
"""Time in which every part of the service reports something, when the files are written again."""


@pytest.fixture
def site(tmp_path):
    site = Site(tmp_path)
    yield site
    site.close()


def paths(statuses: Iterable[Any]) -> set[str]:
    """The paths of all keys without kinds, which depend on the moment; the flight's own part is held elsewhere."""
    of_flights = {fact.partition(":")[0] for fact in frozen("status_of_flights")}
    facts = keys(statuses, "status", tables=TABLES, opaque=of_flights - {"status"})
    return {fact.partition(":")[0].replace("?", "") for fact in facts}


def watched(file: Path) -> set[str]:
    """The paths that the status file shows until none is missing, or until the time is over."""
    seen: set[str] = set()
    deadline = time.monotonic() + (FREEZING_S if FREEZING else PATIENCE_S)
    while time.monotonic() < deadline:
        if file.exists():
            seen |= paths([json.loads(file.read_text())])
        if not FREEZING and not any(line.startswith("vanished") for line in differences("status", seen)):
            break
        time.sleep(0.1)
    return seen


def check(folder: Path, *words: str) -> dict[str, Any]:
    command = [sys.executable, "-m", "fwav_companion", "check", "--config", "fwav-companion.toml", "--json", *words]
    done = subprocess.run(command, capture_output=True, text=True, cwd=folder, timeout=120)
    reported: dict[str, Any] = json.loads(done.stdout.splitlines()[-1])
    assert done.returncode == (0 if reported["ok"] else 1)
    return reported


def add_links_and_a_camera(site: Site) -> None:
    """Add one link of each further kind, connected or not, and a camera without pictures."""
    urls = (
        f"tcpin://127.0.0.1:{free_tcp_port()}",
        f"tcpout://127.0.0.1:{free_tcp_port()}",
        "serial:///dev/absent:9600",
    )
    links = "".join(f'[[link]]\nname = "{url[:6]}"\nurl = "{url}"\nrole = "gcs"\n' for url in urls)
    site.replace("[rates]", f'{links}[vision]\nsource = "pictures"\ndetector = "color"\n[rates]')


def free_tcp_port() -> int:
    with socket.socket() as probe:
        probe.bind(("127.0.0.1", 0))
        port: int = probe.getsockname()[1]
        return port


@pytest.mark.timeout(180)
def test_the_status_file_and_check_beside_the_service(site: Site):
    site.replace("self_calibration = false", "self_calibration = true")
    site.replace("landing_target = false", "landing_target = true")
    site.replace('landing_label = ""', 'landing_label = "target"')
    add_links_and_a_camera(site)
    with site.service() as service, site.mock("--scenario", "unbiased", seconds=2 * PATIENCE_S):
        hold("status", watched(site.folder / "status.json"))
        reported = check(site.folder)
        assert service.stop() == 0
    hold("check", keys([reported | {"findings": []}], "check", opaque={"check.status"}))


def test_a_finding(site: Site):
    """The keys that every finding has, those that it may have, and the levels."""
    findings = check(site.folder, "--seconds", "3")["findings"]
    assert "nothing_heard" in [finding["code"] for finding in findings]
    for finding in findings:
        assert set(finding) - {"where", "consequences"} == {"level", "code", "problem", "fix"}
        assert finding["level"] in ("ERROR", "WARNING", "NOTE")
