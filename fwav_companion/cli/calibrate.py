"""``fwav-companion calibrate``: a camera file from pictures of a printed board."""

from __future__ import annotations

import argparse
import os
from importlib.util import find_spec
from pathlib import Path
from typing import TYPE_CHECKING

from fwav_companion.cli.signals import as_by_ctrl_c
from fwav_companion.errors import InputFileError, UserError

if TYPE_CHECKING:
    from argparse import _SubParsersAction
    from collections.abc import Sequence

DESCRIPTION = """Fits the fisheye model r = k1 θ + k2 θ³ + ... to pictures of a printed board, and says how sure it is.
It takes 15 to 30 pictures from the camera as it will fly (its resolution, its focus), the board flat, near to the
edges and corners of the image too, and tilted by 30° to 45° to all sides."""
EPILOG = """boards (SPEC), lengths in mm, cm or m, measured on the print:
  chessboard:9x6:25mm                  inner corners across x down (10 x 7 squares), side of a square; seen whole
  charuco:7x5:30mm:22mm:DICT_4X4_50    squares across x down, side of a square, of a marker; a part is enough, so it
                                       is the best for the edges of the image
  aprilgrid:6x6:88mm:26.4mm            Kalibr's: tags across x down, side of a tag, gap; a part is enough

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
    add("--overwrite", action="store_true", help="even where one stands; it is compared with the new one")
    add(
        "--compare",
        metavar="FILE",
        type=Path,
        help="another camera file of this camera: how far its rays are from ours",
    )
    add("--report", metavar="DIR", type=Path, help="a folder for calibration.png: residuals, coverage, the lens")
    add("--json", action="store_true", help="end with the result as one JSON object")
    parser.set_defaults(run=run)


def run(arguments: argparse.Namespace) -> int:
    """0: written. 1: no lens fits. UserError: what was given, or what the pictures show, does not do."""
    with as_by_ctrl_c():
        return _calibrated(arguments)


def _calibrated(arguments: argparse.Namespace) -> int:
    for module, extra in (("cv2", "vision"), *([("matplotlib", "demo")] if arguments.report else [])):
        if find_spec(module) is None:
            raise UserError(f"calibrate: {module} is not installed; accepted: pip install 'fwav-companion[{extra}]'")
    from fwav_companion.cli.calibrate_output import failed, kept, show_table
    from fwav_companion.cli.progress import steps
    from fwav_companion.tools.calibrate.boards.spec import parse_board
    from fwav_companion.tools.calibrate.lens_fit.fit import Unfitted, fit_lens
    from fwav_companion.tools.calibrate.looking import look
    from fwav_companion.tools.calibrate.pictures import shots, silence
    from fwav_companion.tools.calibrate.previous import read_previous

    board = parse_board(arguments.board)
    _require_writable(arguments.out, arguments.images, overwrite=arguments.overwrite)
    previous = read_previous(arguments.compare, arguments.out)
    silence()
    taken, left_out = shots(arguments.images, steps)
    if left_out:
        print(left_out)
    with steps("looking for the board", len(taken)) as on_step:
        looked = look(taken, board, on_step)
    result = fit_lens(looked.views, looked.size)
    told = show_table([shot.name for shot in taken], looked, result)
    if isinstance(result, Unfitted):
        return failed(arguments, result, told, looked.hint)
    return kept(arguments, board, looked, result, told, previous)


def _require_writable(out: Path, images: Sequence[str], *, overwrite: bool) -> None:
    """Before the work, not after it; and never over what it is made of."""
    if str(out) == "-":
        raise InputFileError("--out -: on stdout stands what is said about the pictures; accepted: a file")
    if out.exists() and (not (overwrite and out.is_file()) or any(out.samefile(name) for name in images if name)):
        raise InputFileError(f"{out}: stands there already; accepted: another name, or --overwrite")
    if not out.parent.is_dir():
        raise InputFileError(f"{out.parent}: no such folder; accepted: a folder to write to")
    if not os.access(out.parent, os.W_OK):
        raise InputFileError(f"{out.parent}: may not be written to; accepted: a folder to write to")
