"""A folder with a configuration for each of these tests, and the daemon's status once it shows something."""

from __future__ import annotations

import json
import time
from collections.abc import Callable, Iterator
from pathlib import Path
from typing import Any

import pytest
from sites import Site

PATIENCE_S = 40.0


@pytest.fixture
def site(tmp_path: Path) -> Iterator[Site]:
    site = Site(tmp_path)
    yield site
    site.close()


@pytest.fixture
def until(site: Site) -> Callable[[Callable[[dict[str, Any]], bool]], dict[str, Any]]:
    """Return the status once a condition holds."""

    def wait(condition: Callable[[dict[str, Any]], bool]) -> dict[str, Any]:
        deadline, status = time.monotonic() + PATIENCE_S, {}
        while time.monotonic() < deadline:
            try:
                status = site.status()
            except (FileNotFoundError, json.JSONDecodeError):
                status = {}
            if status and condition(status):
                return status
            time.sleep(0.1)
        raise AssertionError(f"the status never showed it: {json.dumps(status)[:3000]}")

    return wait
