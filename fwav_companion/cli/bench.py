"""``fwav-companion bench``: runs the project's benchmarks, as ratios to other implementations."""

from __future__ import annotations

import argparse
import json
import sys
from collections.abc import Callable, Iterator
from importlib import import_module
from pathlib import Path
from typing import TYPE_CHECKING, Any

from fwav_companion.errors import UserError

if TYPE_CHECKING:
    from argparse import _SubParsersAction

FOLDER = Path("tests", "benchmarks")
"""Folder of the benchmarks in a checkout; an installed package does not have them."""


def add_parser(subparsers: _SubParsersAction[argparse.ArgumentParser]) -> None:
    """Register the command."""
    parser = subparsers.add_parser(
        "bench",
        description="Runs the project's benchmarks, about five minutes, from a checkout with the test extra.",
        epilog="example:\n  git clone ... && cd fwav-companion && pip install '.[test]' && fwav-companion bench",
        formatter_class=argparse.RawDescriptionHelpFormatter,
    )
    parser.add_argument(
        "--only", metavar="NAME", action="append", default=[], help="run this benchmark; may be repeated"
    )
    parser.add_argument("--json", action="store_true", help="end with the figures as one JSON object")
    parser.set_defaults(run=run)


def run(arguments: argparse.Namespace) -> int:
    """Run each benchmark in turn; 1 if one misses its budget."""
    figures = []
    try:
        for name, measure in _chosen(arguments.only):
            for figure in _measured(name, measure):
                figures.append(figure)
                print(figure, flush=True)
    except ModuleNotFoundError as error:
        raise UserError(f"bench: {error.name} is not installed; accepted: pip install '.[test]'") from None
    ok = all(figure.ok for figure in figures)
    if arguments.json:
        objects = [{**figure._asdict(), "ok": figure.ok} for figure in figures]
        print(json.dumps({"ok": ok, "figures": objects}))
    return 0 if ok else 1


def _chosen(only: list[str]) -> Iterator[tuple[str, Callable[[], Any]]]:
    sys.path.append(str(_checkout()))
    everything = import_module("tests.benchmarks.everything")
    unknown = [name for name in only if name not in everything.BENCHMARKS]
    if unknown:
        raise UserError(f"bench --only {unknown[0]}: accepted: {', '.join(everything.BENCHMARKS)}")
    chosen: Iterator[tuple[str, Callable[[], Any]]] = everything.benchmarks(
        [name for name in everything.BENCHMARKS if name in only or not only]
    )
    return chosen


def _checkout() -> Path:
    """The nearest folder with the benchmarks, upward from the working directory, otherwise from this package."""
    here, package = Path.cwd(), Path(__file__).resolve()
    for folder in (here, *here.parents, *package.parents):
        if (folder / FOLDER / "everything.py").is_file():
            return folder
    raise UserError(f"bench: no {FOLDER} here; accepted: a checkout of the project, which has the benchmarks")


def _measured(name: str, measure: Callable[[], Any]) -> Any:
    """Run one benchmark, with its name on a terminal, since it may take half a minute."""
    if not sys.stderr.isatty():
        return measure()
    from rich.console import Console

    with Console(stderr=True).status(f"measuring {name}"):
        return measure()
