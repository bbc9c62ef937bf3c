"""``fwav-companion calibrate``: a camera file from pictures of a printed board."""

from __future__ import annotations

import argparse
import os
from pathlib import Path
from typing import TYPE_CHECKING

from fwav_companion.cli.foreign_files import LARGE_HELP, foreign_files
from fwav_companion.cli.signals import as_by_ctrl_c
from fwav_companion.errors import InputFileError
from fwav_companion.libraries import require

if TYPE_CHECKING:
    from argparse import _SubParsersAction
    from collections.abc import Sequence

DESCRIPTION = """Fits the fisheye model r = k1 θ + k2 θ³ + ... to pictures of a printed board, says how accurate it is,
and ends with a verdict: good, usable up to an angle, or poor with the pictures to take. It needs 15 to 30 pictures from
the camera as it will fly (its resolution, its focus): the board flat, near to the edges and corners of the image too,
and tilted by 30° to 45° to all sides."""
EPILOG = """boards (SPEC), lengths in mm, cm or m, measured on the print:
  chessboard:9x6:25mm                  inner corners across x down (10 x 7 squares), side of a square; seen whole
  charuco:7x5:30mm:22mm:DICT_4X4_50    squares across x down, side of a square, of a marker, OpenCV's dictionary; a part
                                       is enough, so it is the best for the edges of the image
  aprilgrid:6x6:88mm:26.4mm            Kalibr's: tags across x down, side of a tag, gap; a part is enough

exit status: 0 good or usable; 1 poor, or no lens fits; 2 wrong arguments, or pictures that do not show the board

example:
  fwav-companion calibrate pictures/ --board chessboard:9x6:25mm --out camera.yaml --report calibration"""


def add_parser(subparsers: _SubParsersAction[argparse.ArgumentParser]) -> None:
    """Register the command."""
    parser = subparsers.add_parser(
        "calibrate",
        description=DESCRIPTION,
        epilog=EPILOG,
        formatter_class=argparse.RawDescriptionHelpFormatter,
    )
    add = parser.add_argument
    add("images", metavar="IMAGES", nargs="+", help="pictures, folders of them, or one video")
    add("--board", metavar="SPEC", required=True, help="what is printed: see below")
    add("--out", metavar="camera.yaml", type=Path, required=True, help="where the camera file goes")
    add("--overwrite", action="store_true", help="replace an existing file; it is compared with the new one")
    add(
        "--compare",
        metavar="FILE",
        type=Path,
        help="another camera file of this camera: how far its rays are from ours",
    )
    add("--report", metavar="DIR", type=Path, help="a folder for calibration.png: residuals, coverage, the lens")
    add("--large", action="store_true", help=LARGE_HELP)
    add("--json", action="store_true", help="end with the result as one JSON object")
    parser.set_defaults(run=run)


def run(arguments: argparse.Namespace) -> int:
    """Calibrate; exit status 0: good or usable, 1: poor or no lens. UserError: wrong arguments or pictures."""
    with as_by_ctrl_c(), foreign_files("calibrate", large=arguments.large):
        return _calibrated(arguments)


def _calibrated(arguments: argparse.Namespace) -> int:
    require("calibrate", "numpy", "cv2")
    if arguments.report:
        require("calibrate --report", "matplotlib")
    from fwav_companion.cli.calibrate_output import report_failure, report_lens, show_pictures
    from fwav_companion.cli.progress import described_steps, steps
    from fwav_companion.tools.calibrate.board_spec import parse_board
    from fwav_companion.tools.calibrate.board_views import find_board
    from fwav_companion.tools.calibrate.lens_comparison import read_previous
    from fwav_companion.tools.calibrate.lens_fit.lens_fit import FailedFit, fit_lens
    from fwav_companion.tools.calibrate.pictures import pictures_of, silence_opencv

    board = parse_board(arguments.board)
    _require_writable(arguments.out, arguments.images, overwrite=arguments.overwrite)
    previous = read_previous(arguments.compare, arguments.out)
    silence_opencv()
    pictures, left_out = pictures_of(arguments.images, steps)
    if left_out:
        print(left_out)
    with described_steps("searching for the board", len(pictures)) as on_step:
        search = find_board(pictures, board, on_step)
    result = fit_lens(search.views, search.size)
    rows = show_pictures([picture.name for picture in pictures], search, result)
    if isinstance(result, FailedFit):
        return report_failure(result, search, rows, as_json=arguments.json)
    return report_lens(arguments, board, search=search, fitted=result, rows=rows, previous=previous)


def _require_writable(out: Path, images: Sequence[str], *, overwrite: bool) -> None:
    """InputFileError, before the work, unless ``out`` can be written; one of the pictures is never overwritten."""
    if str(out) == "-":
        raise InputFileError("--out -: stdout takes the table of pictures; accepted: a file")
    if out.exists() and (not (overwrite and out.is_file()) or any(out.samefile(name) for name in images if name)):
        raise InputFileError(f"{out}: exists already; accepted: another name, or --overwrite")
    if not out.parent.is_dir():
        raise InputFileError(f"{out.parent}: no such folder; accepted: a folder to write to")
    if not os.access(out.parent, os.W_OK):
        raise InputFileError(f"{out.parent}: no permission to write; accepted: a folder to write to")
