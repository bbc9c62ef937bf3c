"""``fwav-companion demo``: demonstrates the main function without any hardware."""

from __future__ import annotations

import argparse
import json
import sys
from os.path import realpath
from pathlib import Path
from typing import TYPE_CHECKING

from fwav_companion.cli.seed import seed
from fwav_companion.cli.signals import as_by_ctrl_c
from fwav_companion.errors import UserError
from fwav_companion.libraries import require

if TYPE_CHECKING:
    from argparse import _SubParsersAction

    from rich.console import Console

    from fwav_companion.tools.demo.flight import Demonstration, DemoResult
    from fwav_companion.tools.demo.flight_setup import FlightSetup

SECONDS = (3.0, 3600.0)
FLEETS = (2, 6)
"""Limits of the number of vehicles of --fleet: each takes two processes of this machine."""
SHORTEST_CLICK_S = 12.0
"""Shortest flight with a click, seconds: adoption, a settled clock, a click and some seconds of pictures after it."""
SCENARIOS = ("demo", "demo_blur")


def add_parser(subparsers: _SubParsersAction[argparse.ArgumentParser]) -> None:
    """Register the command."""
    parser = subparsers.add_parser(
        "demo",
        description="Runs the service with a mock flapping-wing vehicle, all on this machine. The mock flies over "
        "AprilTags and renders the camera's pictures. The service finds the tags and sends their latitude, longitude "
        "and accuracy to a ground station. The report adds a second flight in simulated time, on which the service "
        "finds the delay of its camera and the rotation of its mount.",
        epilog="example:\n  fwav-companion demo --seed 7 && xdg-open demo-out/report.html",
        formatter_class=argparse.RawDescriptionHelpFormatter,
    )
    add = parser.add_argument
    add("--seconds", type=float, default=30.0, help="length of the flight; default %(default)g")
    add("--seed", type=seed, default=1, help="draws the errors of the vehicle; default %(default)d")
    add(
        "--out", metavar="DIR", default="demo-out", help="folder for the recording and report.html; default %(default)s"
    )
    add("--scenario", choices=SCENARIOS, default=SCENARIOS[0], help="demo_blur: a long exposure; tags are readable "
        "mostly while the body turns slowly")  # fmt: skip
    add(
        "--fleet",
        metavar="N",
        type=int,
        default=0,
        help="N vehicles, 2 to 6, that look at the same targets, and one ground process that fuses what they see; its "
        "address is printed",
    )
    add(
        "--click",
        action="store_true",
        help="a flight in simulated time on which an operator clicks on a place in the picture, which is then followed",
    )
    add(
        "--photographs",
        action="store_true",
        help="no flight: a drone's photographs with poses in their tags, in which the tags are located",
    )
    add("--json", action="store_true", help="end with the result as one JSON object")
    parser.set_defaults(run=run)


def run(arguments: argparse.Namespace) -> int:
    """Run the demonstration; exit status 0: every target found, within its claimed 99.9 % radius; 1: otherwise."""
    if not SECONDS[0] <= arguments.seconds <= SECONDS[1]:
        raise UserError(f"--seconds {arguments.seconds:g}: accepted: {SECONDS[0]:g} to {SECONDS[1]:g}")
    if arguments.photographs:
        return _locate_photographs(arguments)
    if arguments.click and arguments.fleet:
        raise UserError("--click and --fleet are two demonstrations: accepted: one of them")
    if arguments.fleet:
        return _fly_fleet(arguments)
    if arguments.click:
        return _fly_with_click(arguments)
    require("demo", "numpy", "cv2", "sitl_mock")
    from fwav_companion.tools.demo.flight import Demonstration
    from fwav_companion.tools.demo.flight_setup import FlightSetup
    from fwav_companion.tools.demo.live_table import LiveTable, UnpipedConsole, show_result
    from fwav_companion.tools.demo.processes import locked_folder

    out = Path(realpath(arguments.out))
    console = UnpipedConsole()
    setup = FlightSetup(arguments.seed, arguments.seconds, arguments.scenario)
    demonstration = Demonstration(setup, out)
    with as_by_ctrl_c(), locked_folder(out):
        with LiveTable(console, arguments.seconds) as table:
            result = demonstration.fly(table.watch)
        report = _report(console, demonstration, setup, out=out, result=result)
    show_result(console, result, report)
    if arguments.json:
        print(json.dumps(result.as_json()))
    return 1 if result.troubles else 0


def _locate_photographs(arguments: argparse.Namespace) -> int:
    """Locate tags in photographs; exit status 0: every tag found, within its claimed 99.9 %; 1: otherwise."""
    if arguments.click or arguments.fleet:
        raise UserError("--photographs, --click and --fleet are three demonstrations: accepted: one of them")
    require("demo --photographs", "numpy", "cv2", "PIL", "sitl_mock")
    from fwav_companion.tools.photograph_demo.photograph_demonstration import draw_photographs, locate_photographs

    out = Path(realpath(arguments.out))
    with as_by_ctrl_c():
        draw_photographs(out, arguments.seed)
        scores = locate_photographs(out)
    for score in scores:
        print("\n".join(score.lines()))
    troubles = [score.trouble for score in scores if score.trouble]
    for trouble in troubles:
        print(f"demo: {trouble}", file=sys.stderr)
    print(f"pictures   {out}; click in them: fwav-companion locate {arguments.out} --http 127.0.0.1:8090")
    if arguments.json:
        print(json.dumps({"ok": not troubles, "targets": [score.as_json() for score in scores]}))
    return 1 if troubles else 0


def _fly_fleet(arguments: argparse.Namespace) -> int:
    """Fly a fleet; exit status 0: every target fused once, within its claimed 99.9 %; 1: otherwise."""
    if not FLEETS[0] <= arguments.fleet <= FLEETS[1]:
        raise UserError(f"--fleet {arguments.fleet}: accepted: {FLEETS[0]} to {FLEETS[1]}")
    require("demo --fleet", "numpy", "aiohttp", "zenoh", "sitl_mock")
    from fwav_companion.tools.demo.fleet_flight import FleetDemonstration
    from fwav_companion.tools.demo.processes import locked_folder

    out = Path(realpath(arguments.out))
    demonstration = FleetDemonstration(arguments.fleet, arguments.seconds, arguments.seed, out)
    with as_by_ctrl_c(), locked_folder(out):
        print(f"ground picture: {demonstration.address}", flush=True)
        result = demonstration.fly(lambda _flown_s, _targets: None)
    for score in result.scores:
        error = "not found" if score.error_m is None else f"error {score.error_m:.2f} m"
        claim = "" if score.claimed95_m is None else f", claimed {score.claimed95_m:.2f} m (95 %)"
        seen = f", seen by vehicles {', '.join(score.vehicles)}" if score.vehicles else ""
        print(f"{score.label} at {score.north:.0f} m north, {score.east:.0f} m east: {error}{claim}{seen}")
    for trouble in result.troubles:
        print(f"demo: {trouble}", file=sys.stderr)
    (out / "fleet.json").write_text(json.dumps(result.as_json(), indent=1) + "\n", encoding="utf-8")
    print(f"report     {out / 'fleet.json'}")
    if arguments.json:
        print(json.dumps(result.as_json()))
    return 1 if result.troubles else 0


def _fly_with_click(arguments: argparse.Namespace) -> int:
    """Fly with a click; exit status 0: the clicked spot, and no other, was followed; 1: otherwise."""
    if arguments.seconds < SHORTEST_CLICK_S:
        raise UserError(f"--click --seconds {arguments.seconds:g}: accepted: {SHORTEST_CLICK_S:g} to {SECONDS[1]:g}")
    require("demo --click", "numpy", "cv2", "sitl_mock")
    from fwav_companion.tools.click_flight.click_demonstration import ClickDemonstration
    from fwav_companion.tools.demo.live_table import UnpipedConsole, report_progress
    from fwav_companion.tools.demo.processes import locked_folder

    out = Path(realpath(arguments.out))
    with as_by_ctrl_c(), locked_folder(out), report_progress(UnpipedConsole()) as progress:
        score, report = ClickDemonstration(out, arguments.seed, arguments.seconds).fly(progress)
    if score.added95_m is not None:
        print(
            f"click      found in {score.sharp_found} of {score.sharp} frames that show it sharply, in {score.passes} "
            f"passes; the tracker adds {score.added95_m:.2f} m (95 %)"
        )
    if score.error_m is not None:
        print(f"target     {score.error_m:.2f} m from the spot on the map, claimed {score.claimed95_m:.2f} m (95 %)")
    for trouble in score.troubles:
        print(f"demo: {trouble}", file=sys.stderr)
    print(f"report     {report}")
    if arguments.json:
        print(json.dumps(score.as_json()))
    return 1 if score.troubles else 0


def _report(
    console: Console, demonstration: Demonstration, setup: FlightSetup, *, out: Path, result: DemoResult
) -> tuple[Path, list[str]] | None:
    """The report's path and its results as sentences; None without a recording."""
    from fwav_companion.tools.demo.demo_report import write_report
    from fwav_companion.tools.demo.live_table import report_progress

    if result.recording is None:
        return None
    with report_progress(console) as progress:
        return write_report(
            setup, demonstration.flight_arguments, out=out, recording=result.recording, progress=progress
        )
