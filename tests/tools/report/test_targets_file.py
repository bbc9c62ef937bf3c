"""Targets files from a user: whole, cut off, of another kind, or made to break a reader."""

import json

import msgspec
import pytest
from report_lines import approach, calibration, header, sighting, summary, target

from fwav_companion.errors import InputFileError
from fwav_companion.recording.line_decoder import read_lines
from fwav_companion.recording.line_types import TargetLine
from fwav_companion.recording.lines import encode_line
from fwav_companion.tools.report.sighting_statistics import CAUSES
from fwav_companion.tools.report.writer import write_comparison

WHOLE = [
    msgspec.to_builtins(line)
    for line in (
        header(),
        *approach([1.0, 0.5, 0.2]),
        calibration(3.0, 0.01, 0.001, [0.0, 0.1, 0.2], 0.1),
        summary(),
    )
]
TARGET = msgspec.to_builtins(target(1.0, 100.0, -50.0))


def file_of(folder, name, lines, end=b""):
    (folder / name).write_bytes(b"".join(json.dumps(line).encode() + b"\n" for line in lines) + end)
    return folder / name


def test_a_file_that_a_power_cut_left_is_read_to_its_last_whole_line(tmp_path):
    whole = file_of(tmp_path, "whole.jsonl", WHOLE)
    cut = file_of(tmp_path, "cut.jsonl", WHOLE[:3], b'{"type":"target","time_un')
    html = write_comparison(tmp_path, whole, cut, []).read_text()
    assert "cut.jsonl: 1 damaged lines were left out." in html
    assert "whole.jsonl: " not in html.partition("<table>")[0].replace("A: whole.jsonl", "")


@pytest.mark.parametrize(
    "damage",
    [
        {"north": "far"}, {"cov": [[1.0]]}, {"cov": None}, {"fix": 5}, {"track": "x"}, {"label": None}, {"state": []},
        {"time_unix": None}, {"north": 1e300}, {"north": True},
    ],
    ids=str,
)  # fmt: skip
def test_a_line_that_is_no_target_is_left_out_and_counted(damage, tmp_path):
    lines = [*WHOLE[:2], TARGET | damage, *WHOLE[2:]]
    read = read_lines([json.dumps(line).encode() for line in lines])
    assert (len(read.lines), read.damaged, read.unknown) == (len(WHOLE), 1, 0)
    path = file_of(tmp_path, "t.jsonl", lines)
    assert "nan" not in write_comparison(tmp_path, path, path, []).read_text()


@pytest.mark.parametrize(
    "config", [{"landmark": None}, {"landmark": [{"label": "a", "lat": []}]}, {"tracking": 3}], ids=str
)
def test_configuration_that_is_none_of_this_package_costs_its_landmarks_alone(config, tmp_path):
    origin = {"lat": 48.0, "lon": 11.0, "alt_amsl": 500.0}
    head = msgspec.to_builtins(header(origin=origin, config=config))
    path = file_of(tmp_path, "t.jsonl", [head, *WHOLE[1:]])
    assert "mark" in write_comparison(tmp_path, path, path, []).read_text()


def test_a_sighting_of_an_impossible_budget_is_left_out_and_counted(tmp_path):
    line = msgspec.to_builtins(sighting(1.0, {})) | {"budget": dict.fromkeys(CAUSES, 1e308)}
    path = file_of(tmp_path, "t.jsonl", [*WHOLE[:2], line, *WHOLE[2:]])
    assert "1 damaged lines were left out" in write_comparison(tmp_path, path, path, []).read_text()


@pytest.mark.parametrize("key", ["time_unix", "frame", "track", "label", "state", "north", "east", "cov", "fix"])
def test_nothing_that_a_report_needs_may_be_missing(key):
    line = {name: value for name, value in TARGET.items() if name != key}
    read = read_lines([json.dumps(line).encode()])
    assert (read.lines, read.damaged) == ([], 1)


def test_line_of_an_unknown_type_is_passed_over_and_counted_as_no_damage(tmp_path):
    unknown = b'{"type":"weather","wind_m_s":1.0}'
    read = read_lines([unknown, b"", b"\n", json.dumps(TARGET).encode()])
    assert (len(read.lines), read.damaged, read.unknown) == (1, 0, 1)
    newer = file_of(tmp_path, "newer.jsonl", WHOLE, unknown + b"\n")
    html = write_comparison(tmp_path, file_of(tmp_path, "whole.jsonl", WHOLE), newer, []).read_text()
    assert "newer.jsonl: 1 lines of unknown types were left out." in html


def test_unknown_fields_are_ignored_and_a_line_keeps_its_bytes():
    (line,) = read_lines([json.dumps({**TARGET, "wind_m_s": 1.0, "fix": None}).encode()]).lines
    assert isinstance(line, TargetLine)
    assert encode_line(line) == json.dumps(TARGET, separators=(",", ":")).encode() + b"\n"


@pytest.mark.parametrize(
    "content",
    [b"", b"\xff\xfe\x00", b"[]\n", b"null\n", b'{"type":"summary"}\n', b'{"type":"header","config":' + b"[" * 100_000],
    ids=range(6),
)
def test_another_kind_of_file_is_refused_in_one_line(content, tmp_path):
    (tmp_path / "other.jsonl").write_bytes(content)
    whole = file_of(tmp_path, "whole.jsonl", WHOLE)
    with pytest.raises(InputFileError) as refused:
        write_comparison(tmp_path, whole, tmp_path / "other.jsonl", [])
    assert "other.jsonl: its first line is not a header" in str(refused.value)
    assert "\n" not in str(refused.value)
