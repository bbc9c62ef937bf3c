"""What `calibrate` shows and writes when the pictures have been looked at."""

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
from fwav_companion.tools.calibrate.boards.spec import Board
from fwav_companion.tools.calibrate.lens_fit.fit import Fitted, Unfitted, WhyNot
from fwav_companion.tools.calibrate.lens_fit.writing import camera_file
from fwav_companion.tools.calibrate.looking import Looked
from fwav_companion.tools.calibrate.previous import Previous, apart
from fwav_companion.tools.calibrate.telling import Row, as_object, comments, lines, rows

EXIT_BAD = 1
WIDTH_IN_A_PIPE = 140
"""Where nobody's window says."""


def show_table(names: Sequence[str], looked: Looked, result: Fitted | Unfitted) -> list[Row]:
    """A row a picture, and what is in it."""
    told = rows(names, looked, result)
    console = Console(width=None if sys.stdout.isatty() else WIDTH_IN_A_PIPE)
    table = Table(box=box.SIMPLE_HEAD, pad_edge=False)
    table.add_column("picture", overflow="fold")
    for heading in ("corners", "miss px", "tilted", "out to"):
        table.add_column(heading, justify="right", no_wrap=True)
    table.add_column("used")
    for row in told:
        used = (
            f"[green]yes[/]{', ' + row.why if row.why else ''}" if row.used else f"[red]no[/]: {row.why or 'no lens'}"
        )
        table.add_row(
            row.name, str(row.corners), _number(row.rms_px, 2), _deg(row.tilt_deg), _deg(row.reached_deg), used
        )
    console.print(table)
    return told


def failed(arguments: argparse.Namespace, result: Unfitted, told: Sequence[Row], hint: str) -> int:
    """One line: of what the pictures lack an error of the user's, of what fits no lens a bad result."""
    why = f"{result.why.value}: {hint or result.told}"
    if arguments.json:
        print(json.dumps({"ok": False, "why": why, "pictures": [row._asdict() for row in told]}))
    if result.why is not WhyNot.MISFIT:
        raise UserError(f"calibrate: {why}")
    print(f"nothing is written: {why}", file=sys.stderr)
    return EXIT_BAD


def kept(
    arguments: argparse.Namespace,
    board: Board,
    looked: Looked,
    fitted: Fitted,
    told: list[Row],
    previous: Sequence[Previous],
) -> int:
    """The file, the picture, and all that is to say."""
    for line in lines(looked, fitted):
        print(line)
    text = camera_file(fitted, comments(board, looked, fitted))
    compared = list(apart(parse_calibration(text, str(arguments.out)).lens, previous))
    for line, _ in compared:
        print(line)
    if arguments.out.exists() and not arguments.overwrite:  # somebody else's, of meanwhile
        raise InputFileError(f"{arguments.out}: stands there already; accepted: another name, or --overwrite")
    with written(str(arguments.out)) as file:
        file.write(text.encode())
    print(f"wrote {arguments.out}; next: [camera] calibration of the configuration, then `check --shake` for the mount")
    try:
        if arguments.report is not None:
            from fwav_companion.tools.calibrate.figure import draw

            print(f"wrote {draw(arguments.report, _title(board, looked, fitted), fitted, told)}")
    finally:  # the camera file needs no picture of how good it is
        if arguments.json:
            print(json.dumps({**as_object(board, told, fitted), "compared": [entry for _, entry in compared]}))
    return 0


def _title(board: Board, looked: Looked, fitted: Fitted) -> str:
    of = f"{len(fitted.seen)} of {looked.pictures} pictures"
    return f"{board.text}: {of}, {fitted.noise_px:.3f} px, {fitted.coefficients} coefficients"


def _number(value: float | None, digits: int) -> str:
    return "" if value is None else f"{value:.{digits}f}"


def _deg(value: float | None) -> str:
    return "" if value is None else f"{value:.0f}°"
