"""Files whose newest content counts: complete or absent, in the first writable place, and without blocking the
caller.
"""

import json
import os
import stat
import threading
import time
from pathlib import Path

import pytest

from fwav_companion.service.latest_file import LatestFile, state_path, status_paths


def test_the_newest_content_is_there_whole_while_a_reader_looks(tmp_path):
    path = tmp_path / "deep" / "status.json"
    file = LatestFile([path], lambda why: None, outlives_us=True)
    file.start()
    stop, seen = threading.Event(), set()

    def read() -> None:
        while not stop.is_set():
            if path.exists():
                seen.add(len(json.loads(path.read_bytes())["filler"]))

    reader = threading.Thread(target=read)
    reader.start()
    for count in range(300):
        file.write(json.dumps({"n": count, "filler": "x" * 50_000}).encode())
    file.close(5.0)
    stop.set()
    reader.join()
    assert json.loads(path.read_bytes())["n"] == 299
    assert seen <= {50_000}
    assert [entry.name for entry in path.parent.iterdir()] == ["status.json"]


def test_the_status_of_another_run_stays(tmp_path):
    """Two services with one status file: the one that ends leaves what the other has written since."""
    path = tmp_path / "status.json"
    file = LatestFile([path], pytest.fail, outlives_us=False)
    file.start()
    file.write(b"ours")
    while not path.exists():
        time.sleep(0.01)
    path.write_bytes(b"another's")
    file.close(5.0)
    assert path.read_bytes() == b"another's"


def test_a_file_about_a_process_goes_with_it(tmp_path):
    path = tmp_path / "status.json"
    written = threading.Event()
    file = LatestFile([path], lambda why: None, outlives_us=False)
    file.start()
    file.write(b"{}")
    while not path.exists():
        written.wait(0.01)
    file.close(5.0)
    assert not path.exists()


@pytest.mark.parametrize(("outlives_us", "mode"), [(False, 0o644), (True, 0o640)], ids=["status", "state"])
def test_every_user_may_read_the_status_and_the_group_the_state(tmp_path, outlives_us, mode):
    usual = os.umask(0o027)
    try:
        path = tmp_path / "file.json"
        file = LatestFile([path], lambda why: None, outlives_us=outlives_us)
        file.start()
        file.write(b"{}")
        while not path.exists():
            time.sleep(0.01)
        assert stat.S_IMODE(path.stat().st_mode) == mode
        file.close(5.0)
    finally:
        os.umask(usual)


def test_the_first_path_that_may_be_written_is_taken(tmp_path):
    (tmp_path / "file").write_text("")
    reported: list[str] = []
    second = tmp_path / "second" / "status.json"
    file = LatestFile([tmp_path / "file" / "status.json", second], reported.append, outlives_us=True)
    file.start()
    file.write(b"{}")
    file.close(5.0)
    assert second.read_bytes() == b"{}"
    assert reported == []


def test_where_nothing_can_be_written_that_is_reported_once(tmp_path):
    (tmp_path / "file").write_text("")
    reported: list[str] = []
    told_once = threading.Event()
    file = LatestFile(
        [tmp_path / "file" / "a.json"], lambda why: (reported.append(why), told_once.set()), outlives_us=True
    )
    file.start()
    file.write(b"1")
    assert told_once.wait(10.0)
    file.write(b"2")
    file.close(5.0)
    assert len(reported) == 1
    assert "Not a directory" in reported[0] or "exists" in reported[0]


def test_where_the_status_may_lie():
    assert status_paths(Path("/tmp/here.json"), {}) == [Path("/tmp/here.json")]
    everything = {"RUNTIME_DIRECTORY": "/run/fwav:/run/other", "XDG_RUNTIME_DIR": "/run/user/7"}
    assert status_paths(None, everything) == [
        Path("/run/fwav/status.json"),
        Path("/run/fwav-companion/status.json"),
        Path("/run/user/7/fwav-companion/status.json"),
    ]
    assert status_paths(None, {}) == [Path("/run/fwav-companion/status.json")]


def test_where_state_is_kept():
    assert state_path(None, "signing.json", {}) is None
    assert state_path(None, "signing.json", {"STATE_DIRECTORY": "/var/lib/a:/var/lib/b"}) == Path(
        "/var/lib/a/signing.json"
    )
    assert state_path(Path("/x"), "signing.json", {"STATE_DIRECTORY": "/var/lib/a"}) == Path("/x/signing.json")
