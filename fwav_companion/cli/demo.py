"""``fwav-companion demo``: the main job with nothing attached."""

from __future__ import annotations

import argparse
import json
from importlib.util import find_spec
from os.path import realpath
from pathlib import Path
from typing import TYPE_CHECKING

from fwav_companion.cli.seed import seed
from fwav_companion.cli.signals import as_by_ctrl_c
from fwav_companion.errors import UserError

if TYPE_CHECKING:
    from argparse import _SubParsersAction

    from rich.console import Console

    from fwav_companion.tools.demo.flight import Demonstration, Outcome
    from fwav_companion.tools.demo.setting import Setting

SECONDS = (3.0, 3600.0)
SCENARIOS = ("demo", "demo_blur")


def add_parser(subparsers: _SubParsersAction[argparse.ArgumentParser]) -> None:
    """Register the command."""
    parser = subparsers.add_parser(
        "demo",
        description="A mock flapping-wing vehicle flies over AprilTags; its camera's pictures are rendered, and the "
        "service finds the tags, tells a ground station where they are and how sure it is. All on this machine. The "
        "report adds a second flight, in invented time: a late camera on a crooked mount, which finds both out.",
        epilog="example:\n  fwav-companion demo --seed 7 && xdg-open demo-out/report.html",
        formatter_class=argparse.RawDescriptionHelpFormatter,
    )
    add = parser.add_argument
    add("--seconds", type=float, default=30.0, help="length of the flight; default %(default)g")
    add("--seed", type=seed, default=1, help="of everything that is wrong with the vehicle; default %(default)d")
    add("--out", metavar="DIR", default="demo-out", help="recording and report.html; default %(default)s")
    add("--scenario", choices=SCENARIOS, default=SCENARIOS[0], help="demo_blur: an exposure so long that mostly the "
        "moments of low rate leave a tag readable")  # fmt: skip
    add("--json", action="store_true", help="end with the result as one JSON object")
    parser.set_defaults(run=run)


def run(arguments: argparse.Namespace) -> int:
    """0: every target found, each within what was claimed; 1: not so."""
    if not SECONDS[0] <= arguments.seconds <= SECONDS[1]:
        raise UserError(f"--seconds {arguments.seconds:g}: accepted: {SECONDS[0]:g} to {SECONDS[1]:g}")
    for module, package in (("cv2", "fwav-companion[demo]"), ("sitl_mock", "fwav-companion[demo]")):
        if find_spec(module) is None:
            raise UserError(f"demo: {module} is not installed; accepted: pip install '{package}'")
    from fwav_companion.tools.demo.alone import alone_in
    from fwav_companion.tools.demo.flight import Demonstration
    from fwav_companion.tools.demo.setting import Setting
    from fwav_companion.tools.demo.table import LiveTable, UnpipedConsole, show_outcome

    out = Path(realpath(arguments.out))
    console = UnpipedConsole()
    setting = Setting(arguments.seed, arguments.seconds, arguments.scenario)
    demonstration = Demonstration(setting, out)
    with as_by_ctrl_c(), alone_in(out):
        with LiveTable(console, arguments.seconds) as table:
            outcome = demonstration.fly(table.watch)
        report = _report(console, demonstration, setting, out, outcome)
    show_outcome(console, outcome, report)
    if arguments.json:
        print(json.dumps(outcome.as_json()))
    return 1 if outcome.troubles else 0


def _report(
    console: Console, demonstration: Demonstration, setting: Setting, out: Path, outcome: Outcome
) -> tuple[Path, str] | None:
    """Where it was written, and what the second flight showed; None where there is nothing to tell."""
    from fwav_companion.tools.demo.table import working
    from fwav_companion.tools.demo.telling import write_report

    if outcome.recording is None:
        return None
    with working(console) as told:
        return write_report(setting, demonstration.flight_arguments, out, outcome.recording, told)
