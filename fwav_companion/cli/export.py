"""``fwav-companion export``: a recording for other programs, by the suffix of the output."""

from __future__ import annotations

import argparse
from pathlib import Path
from typing import TYPE_CHECKING

from fwav_companion.cli.output import written
from fwav_companion.cli.signals import as_by_ctrl_c
from fwav_companion.errors import InputFileError, UserError
from fwav_companion.libraries import require

if TYPE_CHECKING:
    from argparse import _SubParsersAction

SUFFIXES = (".mcap", ".kml", ".kmz", ".geojson", ".csv", ".gpx")


def add_parser(subparsers: _SubParsersAction[argparse.ArgumentParser]) -> None:
    """Register the command."""
    parser = subparsers.add_parser(
        "export",
        description="Writes a recording for other programs. The suffix says which: .mcap for Foxglove and Lichtblick "
        "(layout: docs/examples/layout.json), .kml and .kmz for Google Earth, .geojson, .csv, .gpx.",
        epilog="examples:\n  fwav-companion export recordings/00007-20260101T101500Z --out flight.mcap\n"
        "  fwav-companion export targets.jsonl --out targets.kmz",
        formatter_class=argparse.RawDescriptionHelpFormatter,
    )
    parser.add_argument("recording", metavar="RECORDING|TARGETS.jsonl", help="a recording's folder, or a targets file")
    parser.add_argument("--out", metavar="FILE", required=True, help="the file to write")
    parser.set_defaults(run=run)


def run(arguments: argparse.Namespace) -> int:
    """Read the recording line by line, and write."""
    from fwav_companion.cli.export_inputs import RecordedFlight

    out = Path(arguments.out)
    suffix = out.suffix.lower()
    if suffix not in SUFFIXES:
        raise UserError(f"--out {out}: accepted: FILE with {' | '.join(SUFFIXES)}")
    if suffix == ".mcap":
        require("export to .mcap", "mcap")
    flight = RecordedFlight(Path(arguments.recording))
    if out.exists() and out.resolve() in flight.files:
        raise InputFileError(f"--out {out}: it is an input; accepted: another file")
    with as_by_ctrl_c(), flight.watched() as lines:
        if suffix == ".mcap":
            from fwav_companion.recording.exports.mcap_file import write_mcap

            with written(str(out)) as file:
                write_mcap(file, flight.messages(lines))
        else:
            from fwav_companion.recording.exports import export_for
            from fwav_companion.recording.exports.kmz import KmzExport

            export = KmzExport(out, flight.pictures_by_frame()) if suffix == ".kmz" else export_for(out)
            for line in lines:
                export.add(line)
            with written(str(out)) as file:
                file.write(export.content())
    flight.print_damage()
    return 0
