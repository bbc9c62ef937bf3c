"""Folders of a flight: by arming, by size, and the first and last records of each."""

import json

from fwav_companion.recording.folder import FILES, TARGETS, TELEMETRY, RecordingPlan, SpacePolicy, recordings
from fwav_companion.recording.recorder import Recorder
from fwav_companion.recording.spans import (
    AFTER_DISARMING_US,
    BEFORE_ARMING_US,
    MOST_BEFORE_BYTES,
    BeginSpan,
    EndSpan,
    SpanRecord,
    Spans,
)

S = 1_000_000


class Site:
    """Recording spans under observation: folders as lists of (seconds, record)."""

    def __init__(self, when, *, headed=True, most=1 << 30):
        self.headed = headed
        self._spans = Spans(when, self._header, lambda at_us: SpanRecord(at_us, TARGETS, b"summary"), most)
        self.folders = []
        self.is_open = False

    def _header(self, at_us):
        return SpanRecord(at_us, TARGETS, b"header", is_header=True) if self.headed else None

    def put(self, at_s, data=b"x", **how):
        self._do(self._spans.on_record(SpanRecord(round(at_s * S), TELEMETRY, data, **how)))

    def arm(self, at_s, armed=True):
        self._do(self._spans.on_armed(armed, round(at_s * S)))

    def _do(self, steps):
        for step in steps:
            if isinstance(step, BeginSpan):
                assert not self.is_open
                self.is_open = True
                self.folders.append([])
            elif isinstance(step, EndSpan):
                assert self.is_open
                self.is_open = False
            else:
                assert self.is_open
                self.folders[-1].append((step.at_us / S, step.data))


def test_always_records_from_the_start_and_begins_again_with_each_later_arming():
    site = Site("always", headed=False)
    site.put(0)
    site.put(1, b"header", is_header=True)
    site.headed = True
    for now in range(2, 10):
        site.arm(now, armed=now in (3, 4, 7, 8))
        site.put(now)
    first, second = site.folders
    assert first == [(0, b"x"), (1, b"header"), *((t, b"x") for t in range(2, 7)), (7, b"summary")]
    assert second == [(7, b"header"), (7, b"x"), (8, b"x"), (9, b"x")]
    assert site.is_open


def test_a_folder_whose_origin_never_came_has_no_summary_without_a_header():
    site = Site("always", headed=False)
    for now, armed in enumerate((True, False, True)):
        site.arm(now, armed=armed)
        site.put(now)
    assert site.folders == [[(0, b"x"), (1, b"x")], [(2, b"x")]]


def test_armed_keeps_half_a_minute_before_and_ten_seconds_after():
    site = Site("armed")
    for now in range(200):
        site.arm(now, armed=100 <= now < 120)
        site.put(now)
    (folder,) = site.folders
    assert folder[0] == (100, b"header")
    assert folder[-1] == (120 + AFTER_DISARMING_US / S, b"summary")
    held_from = 99 - BEFORE_ARMING_US / S
    assert [at for at, data in folder if data == b"x"] == list(range(int(held_from), 130))
    assert not site.is_open


def test_arming_again_within_ten_seconds_goes_on_with_the_folder():
    site = Site("armed")
    for now in range(40):
        site.arm(now, armed=5 <= now < 10 or now >= 15)
        site.put(now)
    assert len(site.folders) == 1


def test_what_is_kept_before_arming_is_bounded():
    site = Site("armed")
    for count in range(100):
        site.put(count / 100, bytes(100_000))
    site.arm(1)
    held = sum(len(data) for _, data in site.folders[0])
    assert MOST_BEFORE_BYTES - 100_000 < held <= MOST_BEFORE_BYTES + len(b"header")


def test_a_header_that_is_held_is_not_written_twice():
    site = Site("armed")
    site.put(0, b"header", is_header=True)
    site.arm(1)
    assert [data for _, data in site.folders[0]] == [b"header"]


def test_a_folder_that_is_full_is_followed_by_another():
    site = Site("always", most=1000)
    for now in range(30):
        site.put(now, bytes(100))
    assert len(site.folders) == 4
    assert [at for folder in site.folders for at, data in folder if len(data) == 100] == list(range(30))
    assert all(sum(len(data) for _, data in folder) <= 1000 + len(b"summary") for folder in site.folders)


def test_the_folders_are_on_the_disk(tmp_path):
    reported = []
    plan = RecordingPlan(directory=tmp_path, when="armed", sync_s=0.05, space=SpacePolicy(0, 0, False))
    recorder = Recorder(plan, reported.append, header=lambda: {"type": "header"}, summary=lambda: {"type": "summary"})
    recorder.start()
    for now in range(200):
        recorder.on_armed(now in range(60, 70) or now >= 150, now * S)
        recorder.telemetry(now * S, b"%d" % now)
        recorder.target(now * S, {"type": "target"})
    recorder.close(5.0)
    assert reported == []
    folders = recordings(tmp_path)
    assert len(folders) == 2
    for folder in folders:
        assert sorted(path.name for path in folder.iterdir()) == sorted(FILES)
    lines = [[json.loads(line)["type"] for line in (folder / TARGETS).read_text().splitlines()] for folder in folders]
    assert [kinds[0] for kinds in lines] == ["header", "header"]
    assert [kinds.count("header") for kinds in lines] == [1, 1]
    assert [kinds[-1] for kinds in lines] == ["summary", "target"]
