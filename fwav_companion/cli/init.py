"""``fwav-companion init``: writes a configuration to start from."""

from __future__ import annotations

import argparse
from contextlib import ExitStack
from importlib.resources import files
from pathlib import Path
from typing import TYPE_CHECKING

from fwav_companion.errors import InputFileError
from fwav_companion.on_disk import made_folder, whole

if TYPE_CHECKING:
    from argparse import _SubParsersAction

TEMPLATES = ("fwav-companion.toml", "camera.yaml")


def add_parser(subparsers: _SubParsersAction[argparse.ArgumentParser]) -> None:
    """Register the command."""
    parser = subparsers.add_parser(
        "init",
        description="Writes fwav-companion.toml with every default, and camera.yaml, the paper's camera.",
        epilog="example:\n  fwav-companion init ~/flight && fwav-companion run --config ~/flight/fwav-companion.toml",
        formatter_class=argparse.RawDescriptionHelpFormatter,
    )
    parser.add_argument("directory", metavar="DIR", nargs="?", default=".", help="where to write; default: here")
    parser.set_defaults(run=run)


def run(arguments: argparse.Namespace) -> int:
    """Write both files, or neither if one exists."""
    targets = [Path(arguments.directory) / name for name in TEMPLATES]
    try:
        for target in targets:
            if target.exists():
                raise InputFileError(f"{target}: it exists already; accepted: a folder without it")
        made_folder(targets[0].parent)
        with ExitStack() as both:
            for target in targets:
                file = both.enter_context(whole(target))
                file.write(template(target.name).encode())
                file.flush()  # a full disk fails here, before either has its name
    except OSError as error:
        raise InputFileError(f"{error.filename}: {error.strerror}; accepted: a folder to write to") from None
    print(f"wrote {targets[0]} and {targets[1]}; next: set [[link]] and [camera] in the first")
    return 0


def template(name: str) -> str:
    """The text of one of TEMPLATES."""
    return (files("fwav_companion.cli.templates") / name).read_text(encoding="utf-8")
