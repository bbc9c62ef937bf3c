"""A service that starts reports another one that is active with the same status file."""

import json
import os
import subprocess
import sys
import time

import pytest

from fwav_companion.service.other_run import other_run


def written(path, **changes):
    path.write_text(json.dumps({"pid": os.getppid(), "time_monotonic": time.monotonic(), "frames": 7} | changes))
    return path


def test_the_first_status_of_an_active_process_is_found(tmp_path):
    path = written(tmp_path / "status.json")
    assert other_run([tmp_path / "absent.json", path]) == (os.getppid(), path)


def test_a_status_of_an_ended_process_or_of_our_own_or_an_old_one_is_not_another_run(tmp_path):
    with subprocess.Popen([sys.executable, "-c", ""]) as ended:
        ended.wait()
    for changes in (
        {"pid": ended.pid},
        {"pid": os.getpid()},
        {"pid": 2**70},
        {"time_monotonic": time.monotonic() - 10.0},
    ):
        assert other_run([written(tmp_path / "status.json", **changes)]) is None, changes


@pytest.mark.parametrize("content", [b"", b"[]", b"{}", b"\xff", b'{"pid": null}', b"[" * 100_000])
def test_any_other_content_is_not_another_run(tmp_path, content):
    (tmp_path / "status.json").write_bytes(content)
    assert other_run([tmp_path / "status.json"]) is None
