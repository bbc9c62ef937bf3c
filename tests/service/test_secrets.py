"""Passwords and tokens of a configuration: never in a recording, a log, a status, or on a command line."""

from __future__ import annotations

import json
from pathlib import Path

import pytest
from flying import CAMERA, LINK

from fwav_companion.config import load, parse
from fwav_companion.errors import ConfigError
from fwav_companion.service.configured_files import recorded_extra_files
from fwav_companion.service.log import ServiceLog
from fwav_companion.types.secrets import redacted_path, redacted_url
from fwav_companion.types.status import VisionReport

TOKEN, PASSWORD = "aB3-0123456789abcdef", "p4ss:w0rd"
SECRETS = (TOKEN, "p4ss", "w0rd", "qu3ry", "z3noh")
TABLES = (
    '[camera]\ncalibration = "camera.yaml"\n'
    f'[vision]\nsource = "rtsp://pilot:{PASSWORD}@10.0.0.7:554/live?key=qu3ry"\npreview = "0.0.0.0:8089/{TOKEN}"\n'
    '[publish]\nvideo_uri = "rtsp://u:w0rd@10.0.0.7/x"\n'
    '[fleet]\nconnect = ["tls/10.0.0.1:7447", "quic//z3noh@10.0.0.2:7447"]\n'
    '[record]\ndirectory = "recordings"\n'
)


@pytest.fixture
def path(tmp_path: Path) -> Path:
    (tmp_path / "camera.yaml").write_text(CAMERA)
    path = tmp_path / "c.toml"
    path.write_text(LINK + TABLES)
    return path


@pytest.mark.parametrize(
    ("url", "shown"),
    [
        ("rtsp://10.0.0.7/live", "rtsp://10.0.0.7/live"),
        ("rtsp://a:b@10.0.0.7/live", "rtsp://redacted-redacted@10.0.0.7/live"),
        ("rtsp://a:p@ss@10.0.0.7/live", "rtsp://redacted-redacted@10.0.0.7/live"),
        ("rtsp://a:p?k=s@10.0.0.7/l@ve", "rtsp://redacted-redacted@10.0.0.7/l@ve"),
        ("rtsp://a@h/?k=v&w=x", "rtsp://redacted-redacted@h/?k=redacted-redacted&w=redacted-redacted"),
        ("libcamera:0", "libcamera:0"),
        ("/dev/video0", "/dev/video0"),
        ("pictures/a@b", "pictures/a@b"),
    ],
)
def test_url_keeps_its_place_and_loses_its_secrets(url: str, shown: str) -> None:
    assert redacted_url(url) == shown
    assert redacted_url(shown) == shown


def test_preview_address_keeps_its_place_and_loses_its_token() -> None:
    assert redacted_path("0.0.0.0:8089/abc") == "0.0.0.0:8089/redacted-redacted"
    assert redacted_path("127.0.0.1:8089") == "127.0.0.1:8089"


def test_recorded_copy_has_no_secret_and_is_a_valid_configuration(path: Path) -> None:
    copy = recorded_extra_files(load(path))["c.toml"].decode()
    assert [secret for secret in SECRETS if secret in copy] == []
    replayed = parse(copy, str(path))
    assert replayed.vision is not None
    assert replayed.vision.source.endswith("@10.0.0.7:554/live?key=redacted-redacted")


def test_recorded_header_has_no_secret(path: Path) -> None:
    header = json.dumps(load(path).as_builtins())
    assert [secret for secret in SECRETS if secret in header] == []
    assert "10.0.0.7" in header


def test_secret_that_the_copy_would_show_is_refused_before_anything_is_recorded(path: Path) -> None:
    path.write_text(path.read_text().replace("aB3", r"\u0061B3"))
    with pytest.raises(ConfigError, match="written with escapes"):
        recorded_extra_files(load(path))


def test_log_names_the_camera_without_its_password(path: Path, caplog: pytest.LogCaptureFixture) -> None:
    with caplog.at_level("INFO"):
        ServiceLog(load(path)).pictures_seen(VisionReport(why="no answer"))
    assert "10.0.0.7" in caplog.text
    assert "p4ss" not in caplog.text
