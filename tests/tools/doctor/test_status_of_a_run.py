"""`check` believes a status file that is fresh, of a living process of any user, and of this configuration."""

import json
import os
import subprocess
import sys
import time
from pathlib import Path

import pytest
from hearing import TEXT

from fwav_companion.config import load
from fwav_companion.tools.doctor.gathering import running_status


@pytest.fixture
def site(tmp_path):
    (tmp_path / "flight.toml").write_text(TEXT + f'[status]\nfile = "{tmp_path}/status.json"\n')
    return load(tmp_path / "flight.toml")


def put(config, **changes):
    status = {"pid": os.getpid(), "config_path": config.file, "time_monotonic": time.monotonic(), "frames": 7}
    Path(config.status.file).write_text(json.dumps(status | changes))


def test_the_status_of_a_running_service_is_read(site):
    put(site)
    assert running_status(site).typed.frames == 7


def test_the_status_of_another_users_service_is_read(site, monkeypatch):
    def not_ours(_pid, _signal):
        raise PermissionError

    monkeypatch.setattr(os, "kill", not_ours)
    put(site)
    assert running_status(site).typed.frames == 7
    put(site, config_path="/etc/fwav-companion/another.toml")
    assert running_status(site) is None


def test_a_status_of_an_ended_or_hanging_or_other_service_is_not_read(site):
    with subprocess.Popen([sys.executable, "-c", ""]) as ended:
        ended.wait()
    for changes in (
        {"pid": ended.pid},
        {"time_monotonic": time.monotonic() - 10.0},
        {"time_monotonic": time.monotonic() + 10.0},
        {"config_path": "/elsewhere.toml"},
    ):
        put(site, **changes)
        assert running_status(site) is None, changes


def test_an_unreadable_status_is_not_read(site, monkeypatch):
    def denied(_path, _mode):
        raise PermissionError(13, "Permission denied")

    put(site)
    monkeypatch.setattr(Path, "open", denied)
    assert running_status(site) is None


@pytest.mark.parametrize("content", ["", "[]", "null", '{"pid": 1e30}', "\0" * 9, "[" * 100_000])
def test_other_content_is_not_read(site, content):
    Path(site.status.file).write_text(content)
    assert running_status(site) is None
    put(site, pid=10**30)
    assert running_status(site) is None
    put(site, config_path="\0")
    assert running_status(site) is None


@pytest.mark.timeout(10)
def test_a_pipe_or_a_ring_of_links_is_not_read(site):
    os.mkfifo(site.status.file)
    assert running_status(site) is None
    Path(site.status.file).unlink()
    Path(site.status.file).symlink_to("status.json")
    assert running_status(site) is None


def test_a_configuration_in_a_ring_of_links_is_not_ours(site, tmp_path):
    (tmp_path / "ring").symlink_to("ring")
    put(site, config_path=str(tmp_path / "ring"))
    assert running_status(site) is None
