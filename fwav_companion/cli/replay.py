"""``fwav-companion replay``: the pipeline over a recording."""

from __future__ import annotations

import argparse
import json
import sys
from pathlib import Path
from typing import TYPE_CHECKING

from fwav_companion.errors import InputFileError

if TYPE_CHECKING:
    from argparse import _SubParsersAction
    from collections.abc import Iterator

    from fwav_companion.recording.lines import Line
    from fwav_companion.recording.truth import TruthPoint


def add_parser(subparsers: _SubParsersAction[argparse.ArgumentParser]) -> None:
    """Register the command."""
    parser = subparsers.add_parser(
        "replay",
        description="Puts recorded telemetry and detections through the same pipeline as `run`, as fast as it goes.",
        epilog=(
            "example:\n  fwav-companion replay --telemetry telemetry.tlog --detections detections.jsonl \\\n"
            "      --config fwav-companion.toml --out targets.jsonl"
        ),
        formatter_class=argparse.RawDescriptionHelpFormatter,
    )
    parser.add_argument("--telemetry", metavar="F.tlog", required=True, help="the MAVLink recording")
    parser.add_argument("--detections", metavar="D.jsonl", required=True, help="one JSON object a frame")
    parser.add_argument("--config", metavar="FILE", required=True, help="the configuration, as `init` writes one")
    parser.add_argument("--out", metavar="T.jsonl", required=True, help="where the targets go")
    parser.add_argument("--truth", metavar="T", help="CSV or JSONL with label and place: adds errors to the summary")
    parser.add_argument("--sightings", action="store_true", help="a line for every detection, used or not")
    parser.add_argument(
        "--set",
        metavar="KEY=VALUE",
        action="append",
        default=[],
        help="a configuration key, as tracking.filter=lowpass",
    )
    parser.add_argument("--json", action="store_true", help="end with the summary as one JSON object")
    parser.set_defaults(run=run)


def run(arguments: argparse.Namespace) -> int:
    """Read everything, then write line by line."""
    from fwav_companion.config import load
    from fwav_companion.named_files import load_calibration, load_elevation
    from fwav_companion.recording.tlog import load_tlog
    from fwav_companion.replaying import read_recording, replay
    from fwav_companion.wiring import own_components

    config = load(arguments.config, arguments.set)
    calibration = load_calibration(config)
    truth = _truth(arguments.truth)
    telemetry = load_tlog(Path(arguments.telemetry))
    recording = read_recording(telemetry, _content(arguments.detections), own_components(config))
    for skipped in recording.skipped:
        print(
            f"{arguments.telemetry}: skipped {skipped.length} damaged bytes at offset {skipped.offset}", file=sys.stderr
        )
    elevation = load_elevation(config)
    lines = replay(recording, config, calibration, elevation=elevation, sightings=arguments.sightings, truth=truth)
    summary = _write(Path(arguments.out), lines)
    _tell(summary, as_json=arguments.json)
    return 0


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
