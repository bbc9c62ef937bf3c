"""State files through power cuts and kills: after a cut at any write a file holds its old content or its new one."""

from __future__ import annotations

import json
import os
import random
import signal
import subprocess
import sys
import time
from collections.abc import Iterator
from itertools import product
from pathlib import Path
from typing import NamedTuple

import pytest

from fwav_companion import on_disk
from fwav_companion.service.latest_file import LatestFile

OLD, NEW = b'{"kept": "old"}', b'{"kept": "new", "filler": "' + b"x" * 20_000 + b'"}'


class Event(NamedTuple):
    """One change of the disk's cache, or an order to bring it to the disk."""

    kind: str
    """"write", "sync file", "name" or "sync folder"."""
    content: bytes = b""


class Disk:
    """What reaches a disk: content and names stay in the cache, and go to the disk in any order, until a sync."""

    def __init__(self, monkeypatch: pytest.MonkeyPatch) -> None:
        self.events: list[Event] = []
        fsync, replace = os.fsync, Path.replace

        def synced(descriptor: int) -> None:
            name = Path(f"/proc/self/fd/{descriptor}").readlink()
            if name.is_dir():
                self.events.append(Event("sync folder"))
            else:
                self.events += [Event("write", name.read_bytes()), Event("sync file")]
            fsync(descriptor)

        def named(source: Path, target: Path) -> Path:
            self.events.append(Event("name", source.read_bytes()))
            return replace(source, target)

        monkeypatch.setattr(on_disk.os, "fsync", synced)
        monkeypatch.setattr(on_disk.Path, "replace", named)

    def after_cuts(self) -> Iterator[tuple[int, bytes]]:
        """(events before the cut, what the name leads to), for every cut and every part of the cache written back."""
        for count, (partly, content_went, name_went) in product(
            range(len(self.events) + 1), product((False, True), repeat=3)
        ):
            done = [event.kind for event in self.events[:count]]
            new = next((event.content for event in self.events[:count] if event.content), b"")
            on_disk_content = new if "sync file" in done or content_went else new[: len(new) // 2] if partly else b""
            named = "name" in done and (name_went or "sync folder" in done)
            yield count, on_disk_content if named else OLD


def test_after_a_power_cut_at_any_write_a_state_is_the_old_one_or_the_new_one(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
):
    path = tmp_path / "signing.json"
    path.write_bytes(OLD)
    disk = Disk(monkeypatch)
    file = LatestFile([path], pytest.fail, outlives_us=True)
    file.start()
    file.write(NEW)
    file.close(10.0)
    assert path.read_bytes() == NEW
    cuts = list(disk.after_cuts())
    assert {content for _, content in cuts} == {OLD, NEW}
    assert {content for count, content in cuts if count == len(disk.events)} == {NEW}, "what was written is kept"
    assert [event.kind for event in disk.events] == ["write", "sync file", "name", "sync folder"]


def test_the_status_waits_for_no_disk(tmp_path: Path, monkeypatch: pytest.MonkeyPatch):
    disk = Disk(monkeypatch)
    file = LatestFile([tmp_path / "status.json"], pytest.fail, outlives_us=False)
    file.start()
    file.write(b"{}")
    while not disk.events:
        time.sleep(0.01)
    file.close(10.0)
    assert [event.kind for event in disk.events] == ["name"]


REWRITES = """
import itertools, json, sys
from pathlib import Path
from fwav_companion.service.latest_file import LatestFile

file = LatestFile([Path(sys.argv[1])], print, outlives_us=True)
file.start()
for n in itertools.count():
    file.write(json.dumps({"n": n, "filler": "x" * 50_000, "end": n}).encode())
"""


def test_kill_9_while_a_state_is_rewritten_leaves_one_whole_file(tmp_path: Path):
    rng, path, seen = random.Random(4), tmp_path / "state.json", []
    for _ in range(6):
        path.unlink(missing_ok=True)
        with subprocess.Popen([sys.executable, "-c", REWRITES, str(path)]) as child:
            while not path.exists():
                assert child.poll() is None
                time.sleep(0.005)
            time.sleep(rng.uniform(0.0, 0.05))
            child.send_signal(signal.SIGKILL)
            child.wait()
        content = json.loads(path.read_bytes())
        assert content["n"] == content["end"]
        seen.append(content["n"])
        left = [entry for entry in tmp_path.iterdir() if entry != path]
        assert len(left) <= 1, "one that was being written"
        for entry in left:
            entry.unlink()
    assert max(seen) > 0
