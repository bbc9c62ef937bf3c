"""``fwav-companion install``: installs the service on this board, in one command that prints each step."""

from __future__ import annotations

import argparse
import sys
from pathlib import Path
from typing import TYPE_CHECKING

from fwav_companion.errors import UserError

if TYPE_CHECKING:
    from argparse import _SubParsersAction


def add_parser(subparsers: _SubParsersAction[argparse.ArgumentParser]) -> None:
    """Register the command."""
    parser = subparsers.add_parser(
        "install",
        description="Installs the service on this board: user, environment, unit, udev rule, configuration. What is "
        "there already stays, and so does a configuration that was edited.",
        epilog="example:\n  sudo fwav-companion install --dry-run && sudo fwav-companion install --with terrain",
        formatter_class=argparse.RawDescriptionHelpFormatter,
    )
    parser.add_argument("--with", dest="extras", metavar="EXTRAS", default="", help="extras, as terrain,ulog")
    parser.add_argument("--root", metavar="DIR", default="/", help="install below this folder, as for an image")
    parser.add_argument("--dry-run", action="store_true", help="say the steps and change nothing")
    parser.add_argument(
        "--upgrade",
        action="store_true",
        help="make the environment again; without a first heartbeat the old one comes back",
    )
    parser.add_argument("--uninstall", action="store_true", help="remove it; configuration and recordings stay")
    parser.add_argument("--boot", action="store_true", help="free a Raspberry Pi's serial port in its boot files")
    parser.set_defaults(run=run)


def run(arguments: argparse.Namespace) -> int:
    """Decide the steps and do them; 1 if one fails."""
    from fwav_companion.tools.install import execution, observing, plan, source, system

    root = Path(arguments.root).resolve()
    if not root.is_dir():
        raise UserError(f"--root {arguments.root}: no such folder; accepted: a folder")
    if arguments.uninstall and (arguments.upgrade or arguments.boot):
        raise UserError("--uninstall goes with --root and --dry-run alone (see fwav-companion install --help)")
    execution.require_root(root, dry=arguments.dry_run)
    extras = tuple(sorted({extra.strip() for extra in arguments.extras.split(",") if extra.strip()}))
    request = system.Request(
        extras=extras, upgrade=arguments.upgrade, uninstall=arguments.uninstall, boot=arguments.boot
    )
    steps = plan.plan(observing.observed(root), source.source(), request)
    if arguments.dry_run:
        print(*steps, sep="\n")
        return 0
    try:
        execution.Execution(root).do(steps)
    except execution.StepError as failure:
        print(f"fwav-companion: install: {failure}", file=sys.stderr)
        return 1
    return 0
