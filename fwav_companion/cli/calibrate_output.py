"""The output of ``fwav-companion calibrate``: table, lines, files, JSON object and exit status."""

from __future__ import annotations

import argparse
import json
import sys
from collections.abc import Sequence

from rich import box
from rich.console import Console
from rich.table import Table

from fwav_companion.camera import parse_calibration
from fwav_companion.cli.output import written
from fwav_companion.errors import InputFileError, UserError
from fwav_companion.tools.calibrate.board_spec import CalibrationBoard
from fwav_companion.tools.calibrate.board_views import BoardSearch
from fwav_companion.tools.calibrate.calibration_summary import (
    PictureRow,
    camera_file,
    file_comments,
    picture_rows,
    result_lines,
    result_object,
)
from fwav_companion.tools.calibrate.calibration_verdict import Grade, calibration_verdict
from fwav_companion.tools.calibrate.lens_comparison import PreviousLens, comparisons
from fwav_companion.tools.calibrate.lens_fit.lens_fit import FailedFit, FitFailure, FittedLens

EXIT_BAD = 1
WIDTH_IN_A_PIPE = 140
"""Width of the table where stdout is not a terminal, characters."""


def show_pictures(names: Sequence[str], search: BoardSearch, result: FittedLens | FailedFit) -> list[PictureRow]:
    """The rows of the table of pictures, after printing it."""
    rows = picture_rows(names, search, result)
    console = Console(width=None if sys.stdout.isatty() else WIDTH_IN_A_PIPE)
    table = Table(box=box.SIMPLE_HEAD, pad_edge=False)
    table.add_column("picture", overflow="fold")
    for heading in ("corners", "RMS px", "tilted", "out to"):
        table.add_column(heading, justify="right", no_wrap=True)
    table.add_column("used")
    for row in rows:
        used = (
            f"[green]yes[/]{', ' + row.why if row.why else ''}" if row.used else f"[red]no[/]: {row.why or 'no lens'}"
        )
        rms = "" if row.reprojection_rms_px is None else f"{row.reprojection_rms_px:.2f}"
        table.add_row(row.name, str(row.corners), rms, _degrees(row.tilt_deg), _degrees(row.reached_deg), used)
    console.print(table)
    return rows


def report_failure(failure: FailedFit, search: BoardSearch, rows: Sequence[PictureRow], *, as_json: bool) -> int:
    """Report a failed fit; exit status 1 if no lens fits. UserError, one line, if the pictures show too little."""
    reasons = f"; board not found: {search.reasons}" if search.reasons else ""
    why = f"{failure.why.value}: {failure.detail}{reasons}"
    if as_json:
        print(json.dumps({"ok": False, "why": why, "pictures": [row._asdict() for row in rows]}))
    if failure.why is not FitFailure.MISFIT:
        raise UserError(f"calibrate: {why}")
    print(f"nothing is written: {why}", file=sys.stderr)
    return EXIT_BAD


def report_lens(
    arguments: argparse.Namespace,
    board: CalibrationBoard,
    *,
    search: BoardSearch,
    fitted: FittedLens,
    rows: list[PictureRow],
    previous: Sequence[PreviousLens],
) -> int:
    """Exit status 0, or 1 for a poor calibration, after writing the files and printing the verdict."""
    verdict = calibration_verdict(fitted)
    for line in result_lines(search, fitted, verdict):
        print(line)
    text = camera_file(fitted, file_comments(board, search, fitted, verdict))
    compared = list(comparisons(parse_calibration(text, str(arguments.out)).lens, previous))
    for line, _ in compared:
        print(line)
    if arguments.out.exists() and not arguments.overwrite:  # another program wrote it meanwhile
        raise InputFileError(f"{arguments.out}: exists already; accepted: another name, or --overwrite")
    with written(str(arguments.out)) as file:
        file.write(text.encode())
    following = "; next: [camera] calibration of the configuration, then `check --shake` for the mount"
    print(f"wrote {arguments.out}{'' if verdict.grade is Grade.POOR else following}")
    try:
        if arguments.report is not None:
            from fwav_companion.tools.calibrate.calibration_figure import draw_calibration

            title = _title(board, search, fitted)
            print(f"wrote {draw_calibration(arguments.report, title, fitted, rows)}")
    finally:  # the verdict and the JSON object do not depend on the figure
        for line in verdict.lines(fitted):
            print(line)
        if arguments.json:
            result = result_object(board, rows, fitted, verdict)
            print(json.dumps({**result, "compared": [entry for _, entry in compared]}))
    return EXIT_BAD if verdict.grade is Grade.POOR else 0


def _title(board: CalibrationBoard, search: BoardSearch, fitted: FittedLens) -> str:
    of = f"{len(fitted.views)} of {search.pictures} pictures"
    rms = f"reprojection error, RMS: {fitted.reprojection_rms_px:.3f} px"
    return f"{board.text}: {of}, {rms}, {fitted.coefficients} coefficients"


def _degrees(value: float | None) -> str:
    return "" if value is None else f"{value:.0f}°"
