"""``fwav-companion paper``: repeats the paper's experiment, and compares its Table I and its figures."""

from __future__ import annotations

import argparse
import json
from pathlib import Path
from typing import TYPE_CHECKING

from fwav_companion.cli.seed import seed
from fwav_companion.cli.signals import as_by_ctrl_c
from fwav_companion.libraries import require

if TYPE_CHECKING:
    from argparse import _SubParsersAction


def add_parser(subparsers: _SubParsersAction[argparse.ArgumentParser]) -> None:
    """Register the command."""
    parser = subparsers.add_parser(
        "paper",
        description="Repeats the paper's experiment from its constants and says which results of Table I hold.",
        epilog="example:\n  fwav-companion paper --out paper-out --seed 1",
        formatter_class=argparse.RawDescriptionHelpFormatter,
    )
    parser.add_argument(
        "--out", metavar="DIR", type=Path, default="paper-out", help="folder for the figures; default: paper-out"
    )
    parser.add_argument("--seed", type=seed, default=1, help="seed of all noise; default: 1")
    parser.add_argument("--json", action="store_true", help="end with the result as one JSON object")
    parser.set_defaults(run=run)


def run(arguments: argparse.Namespace) -> int:
    """Compute, print and draw; the exit status."""
    with as_by_ctrl_c():
        return _repeated(arguments)


def _repeated(arguments: argparse.Namespace) -> int:
    require("paper", "numpy")
    from fwav_companion.cli.progress import steps
    from fwav_companion.tools.paper.comparison import RUNS, STEPS, compare
    from fwav_companion.tools.paper.figures import draw_figures
    from fwav_companion.tools.paper.report import as_object, as_text

    with steps("repeating the experiment", STEPS) as on_step:
        comparison = compare(arguments.seed, on_step=on_step)
    print(as_text(comparison, arguments.seed, RUNS))
    try:
        for path in draw_figures(arguments.out, arguments.seed, comparison):
            print(f"wrote {path}")
    finally:  # the numbers need neither matplotlib nor the folder
        if arguments.json:
            print(json.dumps(as_object(comparison, arguments.seed, RUNS)))
    return 0
