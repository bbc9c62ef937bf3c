"""``fwav-companion replay``: runs a recording through the pipeline."""

from __future__ import annotations

import argparse
import json
import sys
from pathlib import Path
from typing import TYPE_CHECKING, TextIO

import msgspec

from fwav_companion.cli.foreign_files import foreign_files
from fwav_companion.cli.output import is_stdout, written
from fwav_companion.cli.signals import as_by_ctrl_c
from fwav_companion.errors import UserError

if TYPE_CHECKING:
    from argparse import _SubParsersAction
    from collections.abc import Iterator, Sequence

    from fwav_companion.cli.replay_inputs import ReplayInputs
    from fwav_companion.recording.exports import Export
    from fwav_companion.recording.line_types import Line
    from fwav_companion.recording.summary_types import ErrorsObject, SummaryLine
    from fwav_companion.tools.report import RecordedMessages
    from fwav_companion.tools.report.writer import ReportWriter
    from fwav_companion.types.flight_status import LandmarkReport


ERROR_SIZES = (("CE50", "ce50_m"), ("CE90", "ce90_m"), ("rms", "rms_m"))
"""Radii that hold half and 90 % of the errors, and their root mean square."""


def add_parser(subparsers: _SubParsersAction[argparse.ArgumentParser]) -> None:
    """Register the command."""
    parser = subparsers.add_parser(
        "replay",
        description="Runs recorded telemetry and detections through the same pipeline as `run`, at full speed.",
        epilog=(
            "examples:\n  fwav-companion replay recordings/00007-20260101T101500Z --out targets.jsonl\n"
            "  fwav-companion replay --telemetry telemetry.tlog --detections detections.jsonl \\\n"
            "      --config fwav-companion.toml --out targets.jsonl --export targets.kml"
        ),
        formatter_class=argparse.RawDescriptionHelpFormatter,
    )
    add = parser.add_argument
    add("folder", metavar="FOLDER", nargs="?",
        help="a recording's folder: telemetry, detections, configuration and camera file are its own")  # fmt: skip
    add("--telemetry", metavar="F.tlog", nargs="+",
        help="the MAVLink recording, in one or more parts; or an ArduPilot .bin or a PX4 .ulg log")  # fmt: skip
    add("--poses", metavar="CSV",
        help="in place of --telemetry, for photographs or a video with poses: what `detect --poses-out` writes (file, "
        "frame or time_unix, lat, lon, alt with alt_datum, roll_deg, pitch_deg, yaw_deg of the camera), or a table of "
        "OpenDroneMap, Pix4D or Metashape")  # fmt: skip
    add("--detections", metavar="D.jsonl", nargs="+", help="one JSON object per frame, in one or more parts")
    add("--config", metavar="FILE", help="the configuration, as `init` writes one")
    add("--out", metavar="T.jsonl", help="the targets file to write; - for stdout: other output then goes to stderr")
    add("--truth", metavar="T", help="true targets, CSV or JSONL with label and place, or OpenDroneMap's "
        "gcp_list.txt above sea level: adds errors to the summary")  # fmt: skip
    add("--sightings", action="store_true", help="write a line for every detection, used or not")
    add("--set", metavar="KEY=VALUE", action="append", default=[],
        help="a configuration key, as tracking.filter=lowpass; a filter of your own: module:Class")  # fmt: skip
    add("--allow-code", action="store_true",
        help="run the code that tracking.filter = module:Class names, from the working directory; never from the "
        "recording's folder")  # fmt: skip
    add("--export", metavar="FILE", action="append", default=[],
        help="targets for other tools, by suffix: .geojson, .kml, .kmz, .csv or .gpx; may be repeated")  # fmt: skip
    add(
        "--report", metavar="DIR", help="a folder for report.html: targets on a map, their accuracy, and what limits it"
    )
    add("--alone", action="store_true",
        help="a report of this configuration only; by default it also shows the paper's filter and the tracker without "
        "and with self-calibration, with one more replay for each")  # fmt: skip
    add("--compare", metavar=("A.jsonl", "B.jsonl"), nargs=2,
        help="no replay: compares two targets files, as compare.html in the --report folder")  # fmt: skip
    add("--json", action="store_true", help="end with the summary as one JSON object")
    parser.set_defaults(run=run)


def run(arguments: argparse.Namespace) -> int:
    """Read all input, then write line by line."""
    with as_by_ctrl_c(), foreign_files("replay", large=True):
        if arguments.compare:
            return _compare(arguments)
        if arguments.folder is not None:
            from fwav_companion.cli.replay_folder import take_from_folder

            take_from_folder(arguments)
        if arguments.poses is not None and arguments.telemetry is not None:
            raise UserError("--poses and --telemetry (or FOLDER): accepted: one of the two")
        _require(arguments, "telemetry" if arguments.poses is None else "poses", "detections", "config", "out")
        return _replay(arguments)


def _require(arguments: argparse.Namespace, *names: str) -> None:
    missing = [f"--{name}" for name in names if getattr(arguments, name) is None]
    if missing:
        or_folder = ", or a recording's FOLDER and --out" if "--telemetry" in missing else ""
        raise UserError(
            f"the following arguments are required: {', '.join(missing)}{or_folder} (see fwav-companion replay --help)"
        )


def _compare(arguments: argparse.Namespace) -> int:
    from fwav_companion.cli.replay_inputs import read_truth
    from fwav_companion.tools.report.writer import write_comparison

    _require(arguments, "report")
    first, second = map(Path, arguments.compare)
    print(write_comparison(Path(arguments.report), first, second, read_truth(arguments.truth)))
    return 0


def _replay(arguments: argparse.Namespace) -> int:
    from fwav_companion.service.lean import leave_the_rest_alone, without_searches

    with without_searches():
        from fwav_companion.cli.progress import replays
        from fwav_companion.cli.replay_inputs import read_replay_inputs

        given = read_replay_inputs(arguments)
        report = None if arguments.report is None else _report_writer()
    leave_the_rest_alone()
    lines = given.lines(sightings=arguments.sightings or report is not None)
    with replays(given.recording) as watched:
        lines = watched("replay", lines)
        if report is not None:
            lines = report.watched(lines, sightings=arguments.sightings)
        summary, mistakes = _write_all(arguments.out, lines, given.exports)
        others = []
        if report is not None and not arguments.alone:
            from fwav_companion.tools.report.writer import other_variants

            others = other_variants(given.config, lambda name, chosen: watched(name, given.again(chosen)))
    stream = sys.stderr if is_stdout(arguments.out) else sys.stdout
    if report is not None:
        path = report.write(
            Path(arguments.report),
            _title(Path(arguments.poses or arguments.telemetry[0])),
            config=given.config,
            others=others,
            truth=given.truth,
            notes=given.recording.notes,
            recorded=_recorded_messages(given),
        )
        print(path, file=stream)
    for mistake in mistakes:
        print(f"camera mount: {mistake}", file=sys.stderr)
    if not arguments.json:
        _print_summary(summary, stream)
    elif not is_stdout(arguments.out):  # there it is the last line already
        print(json.dumps(msgspec.to_builtins(summary)))
    return 0


def _report_writer() -> ReportWriter:
    from fwav_companion.tools.report.writer import ReportWriter  # here: most replays have no report

    return ReportWriter()


def _recorded_messages(given: ReplayInputs) -> RecordedMessages | None:
    """The messages of a recording that may hold a landing; None for photographs."""
    from fwav_companion.pipeline.pipeline_factory import own_components
    from fwav_companion.replay import Recording
    from fwav_companion.tools.report import RecordedMessages

    if not isinstance(given.recording, Recording):
        return None
    own, label = own_components(given.config), given.config.publish.landing_label
    return RecordedMessages(given.recording.messages, own, label)


def _title(telemetry: Path) -> str:
    """A name of the flight: the folder of a recording of this package, else the file."""
    from fwav_companion.recording.folder import TELEMETRY

    return telemetry.resolve().parent.name if telemetry.name == TELEMETRY else telemetry.stem


def _write_all(out: str, lines: Iterator[Line], exports: Sequence[Export]) -> tuple[SummaryLine, list[str]]:
    """Write the targets file and its exports. Returns the summary and the gross mistakes of the mount."""
    mistakes: set[str] = set()
    summary = _write(out, _with_mistakes(_exported(lines, exports), mistakes))
    for export in exports:
        with written(str(export.path)) as file:
            file.write(export.content())
    return summary, sorted(mistakes)


def _exported(lines: Iterator[Line], exports: Sequence[Export]) -> Iterator[Line]:
    """The same lines, each also added to every export."""
    for line in lines:
        for export in exports:
            export.add(line)
        yield line


def _with_mistakes(lines: Iterator[Line], mistakes: set[str]) -> Iterator[Line]:
    """The same lines; gross mistakes of the mount that self-calibration named are added to ``mistakes``."""
    from fwav_companion.recording.line_types import CalibrationLine

    for line in lines:
        if isinstance(line, CalibrationLine) and line.mistake:
            mistakes.add(line.mistake)
        yield line


def _write(out: str, lines: Iterator[Line]) -> SummaryLine:
    """Write all lines and return the last one, the summary."""
    from fwav_companion.recording.lines import encode_line
    from fwav_companion.recording.summary_types import SummaryLine

    last: Line | None = None
    with written(out) as file:
        for last in lines:
            file.write(encode_line(last))
    if not isinstance(last, SummaryLine):
        raise TypeError(f"a replay ended without its summary: {last!r}")
    return last


def _print_summary(summary: SummaryLine, stream: TextIO) -> None:
    from fwav_companion.recording.labels import notice_texts, shift_text

    print(f"{summary.frames} frames, {summary.detections} detections, {summary.fixes} fixes", file=stream)
    for things, dropped in (("frames", summary.dropped_frames), ("detections", summary.dropped_detections)):
        for reason, count in dropped.items():
            why = "" if summary.fixes else _explained(reason)
            print(f"  not used: {count} {things} {reason}{why}", file=stream)
    if summary.terrain is not None:
        print(f"  terrain: {shift_text(summary.terrain)}", file=stream)
    for text in notice_texts(summary):
        print(f"  {text}", file=stream)
    _print_landmarks(summary.landmarks, stream)
    if summary.shared_errors:
        from fwav_companion.tools.locate.answers import shared_line

        for shared in summary.shared_errors:
            print(f"  {shared_line(shared)}", file=stream)
    if summary.errors is not None:
        _print_errors(summary.errors, stream)


def _explained(reason: str) -> str:
    """The reason in words after a colon, or ""."""
    from fwav_companion.tools.reason_table import words_of

    return f": {words_of(reason)}".rstrip(": ")


def _print_landmarks(landmarks: Sequence[LandmarkReport], stream: TextIO) -> None:
    from fwav_companion.recording.labels import landmark_result

    for landmark in landmarks:
        sights = f"{landmark.used} sights" + (f", {landmark.refused} refused" if landmark.refused else "")
        print(f"  landmark {landmark.label}: {landmark_result(landmark)} ({sights})", file=stream)


def _print_errors(errors: ErrorsObject, stream: TextIO) -> None:
    """Print the state of each true target, and the statistics of fixes and tracks; probabilities are 95 %."""
    from fwav_companion.recording.labels import display_name

    for target in errors.targets:
        result = {"fixed": "fixed, never confirmed", "missed": "not found"}.get(target.state)
        if result is None:
            result = f"final {target.final_m:.3f} m, claimed {target.claimed95_m:.3f} m (95 %)"
            result += ": OUTSIDE ITS CLAIM" if target.outside95 else ""
        print(f"  {display_name(target.label)}: {result}", file=stream)
    if errors.ghosts:
        print(f"  {errors.ghosts} ghosts: confirmed tracks without a target of their own", file=stream)
    for things, numbers in (("fixes", errors.fixes.overall), ("tracks", errors.tracks.overall)):
        coverage = numbers.coverage95
        if coverage is not None and numbers.nees is not None:
            share = f"{1e2 * coverage.inside / coverage.n:.0f} %"
            interval = f"{1e2 * coverage.low:.0f} to {1e2 * coverage.high:.0f} %"
            errors_m = ", ".join(f"{name} {getattr(numbers, key):.3f} m" for name, key in ERROR_SIZES)
            claims = f"{share} inside their claimed 95 % ellipses (true share {interval})"
            print(f"  {things}: {errors_m}", file=stream)
            print(f"    {claims}; mean normalised square {numbers.nees:.1f}, 2 is right", file=stream)
