"""``fwav-companion replay``: the pipeline over a recording."""

from __future__ import annotations

import argparse
import json
import sys
from pathlib import Path
from typing import TYPE_CHECKING

from fwav_companion.errors import InputFileError, UserError

if TYPE_CHECKING:
    from argparse import _SubParsersAction
    from collections.abc import Iterable, Iterator, Sequence

    from fwav_companion.config import Config
    from fwav_companion.recording.exports import Export
    from fwav_companion.recording.lines import Line
    from fwav_companion.recording.truth import TruthPoint
    from fwav_companion.replay import Recording, TelemetryRead

MOST_TOLD = 10
"""Damaged places of one file that are told one by one."""


def add_parser(subparsers: _SubParsersAction[argparse.ArgumentParser]) -> None:
    """Register the command."""
    parser = subparsers.add_parser(
        "replay",
        description="Puts recorded telemetry and detections through the same pipeline as `run`, as fast as it goes.",
        epilog=(
            "example:\n  fwav-companion replay --telemetry telemetry.tlog --detections detections.jsonl \\\n"
            "      --config fwav-companion.toml --out targets.jsonl --export targets.kml"
        ),
        formatter_class=argparse.RawDescriptionHelpFormatter,
    )
    add = parser.add_argument
    add("--telemetry", metavar="F.tlog", nargs="+",
        help="the MAVLink recording, in parts if it has several; or an ArduPilot .bin or a PX4 .ulg log")  # fmt: skip
    add("--detections", metavar="D.jsonl", nargs="+", help="one JSON object a frame; in parts too")
    add("--config", metavar="FILE", help="the configuration, as `init` writes one")
    add("--out", metavar="T.jsonl", help="where the targets go")
    add("--truth", metavar="T", help="CSV or JSONL with label and place: adds errors to the summary")
    add("--sightings", action="store_true", help="a line for every detection, used or not")
    add("--set", metavar="KEY=VALUE", action="append", default=[],
        help="a configuration key, as tracking.filter=lowpass; filters of your own: module:Class")  # fmt: skip
    add("--export", metavar="FILE", action="append", default=[],
        help="the targets for other tools, by the name's end: .geojson, .kml or .csv; may be repeated")  # fmt: skip
    add("--report", metavar="DIR", help="a folder for report.html: where everything is, how sure, and what limited it")
    add("--alone", action="store_true",
        help="a report of this configuration's answers only; by default it also draws what the paper's filter and the "
        "tracker without and with self-calibration make of the recording, a replay each")  # fmt: skip
    add("--compare", metavar=("A.jsonl", "B.jsonl"), nargs=2,
        help="no replay: two targets files side by side, as compare.html in the --report folder")  # fmt: skip
    add("--json", action="store_true", help="end with the summary as one JSON object")
    parser.set_defaults(run=run)


def run(arguments: argparse.Namespace) -> int:
    """Read everything, then write line by line."""
    if arguments.compare:
        return _compare(arguments)
    _require(arguments, "telemetry", "detections", "config", "out")
    return _replay(arguments)


def _require(arguments: argparse.Namespace, *names: str) -> None:
    missing = [f"--{name}" for name in names if getattr(arguments, name) is None]
    if missing:
        raise UserError(
            f"the following arguments are required: {', '.join(missing)} (see fwav-companion replay --help)"
        )


def _compare(arguments: argparse.Namespace) -> int:
    from fwav_companion.files.report import write_comparison

    _require(arguments, "report")
    first, second = map(Path, arguments.compare)
    print(write_comparison(Path(arguments.report), first, second, _truth(arguments.truth)))
    return 0


def _replay(arguments: argparse.Namespace) -> int:
    from functools import partial

    from fwav_companion.cli.progress import replays
    from fwav_companion.config import load
    from fwav_companion.files.named import load_calibration, load_elevation
    from fwav_companion.files.own_filter import load_own_filter
    from fwav_companion.files.report import ReportWriter, other_ways
    from fwav_companion.recording.exports import export_for
    from fwav_companion.replay import replay

    config = load(arguments.config, arguments.set)
    exports = [export_for(Path(name)) for name in arguments.export]
    calibration = load_calibration(config)
    truth = _truth(arguments.truth)
    recording = _recording(arguments, config)
    _tell_damage(arguments, recording)
    again = partial(replay, recording, calibration=calibration, elevation=load_elevation(config))
    reported = arguments.report is not None
    lines = again(config, own_filter=load_own_filter(config), sightings=arguments.sightings or reported, truth=truth)
    report = ReportWriter()
    with replays(recording) as watched:
        lines = watched("replay", lines)
        if reported:
            lines = report.watched(lines, sightings=arguments.sightings)
        mistakes: set[str] = set()
        summary = _write(Path(arguments.out), _suspected(_exported(lines, exports), mistakes))
        for export in exports:
            _write_bytes(export.path, export.content())
        others = []
        if reported and not arguments.alone:
            others = other_ways(config, lambda name, chosen: watched(name, again(chosen)))
    if reported:
        title = Path(arguments.telemetry[0]).stem
        print(report.write(Path(arguments.report), title, config, others, truth, recording.notes))
    for mistake in sorted(mistakes):
        print(f"camera mount: {mistake}", file=sys.stderr)
    _tell(summary, as_json=arguments.json)
    return 0


def _recording(arguments: argparse.Namespace, config: Config) -> Recording:
    from fwav_companion.flow.wiring import own_components
    from fwav_companion.replay import join

    own = own_components(config)
    detections = b"".join(_content(name) for name in arguments.detections)
    return join(_telemetry(arguments.telemetry, own), detections, own, config.vehicle.system_id)


def _telemetry(names: Sequence[str], own: frozenset[int]) -> TelemetryRead:
    """One file of any kind, or the parts of one .tlog in their order."""
    from fwav_companion.files.telemetry import load_telemetry
    from fwav_companion.recording.tlog import load_tlog
    from fwav_companion.replay import read_telemetry

    if len(names) == 1:
        return load_telemetry(Path(names[0]), own)
    return read_telemetry(b"".join(load_tlog(Path(name)) for name in names))


def _tell_damage(arguments: argparse.Namespace, recording: Recording) -> None:
    """What was skipped, with offsets: counted through all parts where there are several."""
    telemetry, detections = " + ".join(arguments.telemetry), " + ".join(arguments.detections)
    for note in recording.notes:
        print(f"{telemetry}: {note}", file=sys.stderr)
    _tell_first(
        f"{telemetry}: skipped {skipped.length} damaged bytes at offset {skipped.offset}"
        for skipped in recording.skipped
    )
    _tell_first(
        f"{detections}: line {skipped.number} at offset {skipped.offset} is no frame: {skipped.why}"
        for skipped in recording.skipped_lines
    )


def _tell_first(complaints: Iterable[str]) -> None:
    complaints = list(complaints)
    for complaint in complaints[:MOST_TOLD]:
        print(complaint, file=sys.stderr)
    if len(complaints) > MOST_TOLD:
        print(f"  and {len(complaints) - MOST_TOLD} more such places", file=sys.stderr)


def _content(name: str) -> bytes:
    try:
        return Path(name).read_bytes()
    except OSError as error:
        raise InputFileError(f"{name}: {error.strerror}; accepted: detections, one JSON object a line") from None


def _truth(name: str | None) -> list[TruthPoint]:
    from fwav_companion.recording.truth import parse_truth

    if name is None:
        return []
    try:
        return parse_truth(Path(name).read_text(encoding="utf-8"), name)
    except OSError as error:
        raise InputFileError(f"{name}: {error.strerror}; accepted: a truth file, CSV or JSONL") from None
    except UnicodeDecodeError as error:
        raise InputFileError(f"{name}: byte {error.start} is not UTF-8; accepted: CSV or JSONL") from None


def _exported(lines: Iterator[Line], exports: Sequence[Export]) -> Iterator[Line]:
    """The same lines; each export has seen them too."""
    for line in lines:
        for export in exports:
            export.add(line)
        yield line


def _suspected(lines: Iterator[Line], mistakes: set[str]) -> Iterator[Line]:
    """The same lines; what self-calibration named as grossly wrong is gathered."""
    for line in lines:
        if "mistake" in line:
            mistakes.add(line["mistake"])
        yield line


def _write(path: Path, lines: Iterator[Line]) -> Line:
    """Write all lines; the last one, which is the summary."""
    from fwav_companion.recording.lines import encode_line

    last: Line = {}
    try:
        with path.open("wb") as file:
            for last in lines:
                file.write(encode_line(last))
    except OSError as error:
        raise InputFileError(f"{path}: {error.strerror}; accepted: a file that can be written") from None
    return last


def _write_bytes(path: Path, content: bytes) -> None:
    try:
        path.write_bytes(content)
    except OSError as error:
        raise InputFileError(f"{path}: {error.strerror}; accepted: a file that can be written") from None


def _tell(summary: Line, *, as_json: bool) -> None:
    if as_json:
        print(json.dumps(summary))
        return
    print(f"{summary['frames']} frames, {summary['detections']} detections, {summary['fixes']} fixes")
    for reason, count in summary["dropped"].items():
        print(f"  not used: {count} {reason}")
    for error in summary.get("errors", ()):
        said = f"final {error['final_m']:.3f} m, rms {error['rms_m']:.3f} m" if error["found"] else "not found"
        print(f"  {error['label'] or 'target'}: {said}")
