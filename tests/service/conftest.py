"""A service that is not running: the test calls its parts."""

from __future__ import annotations

from pathlib import Path

import pytest

from fwav_companion.config import load
from fwav_companion.service.daemon import Service

LINKS = """
[[link]]
name = "autopilot"
url = "tcpin://127.0.0.1:5760"
role = "autopilot"
[[link]]
name = "ground"
url = "udpout://127.0.0.1:14550"
role = "gcs"
[detections]
url = ""
"""


@pytest.fixture
def service(tmp_path: Path) -> Service:
    """The service of a relay."""
    config = tmp_path / "relay.toml"
    config.write_text(LINKS)
    return Service(load(str(config)), None, None, elevation=(), extra_files={})
