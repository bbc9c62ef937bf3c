"""``fwav-companion check``: reports what every link and stream delivers, what is wrong, and what to change."""

from __future__ import annotations

import argparse
import json
import sys
import threading
from math import nan
from pathlib import Path
from typing import TYPE_CHECKING

import msgspec

from fwav_companion.cli.shake import WAIT_S, run_shake
from fwav_companion.cli.signals import as_by_ctrl_c
from fwav_companion.errors import UserError

if TYPE_CHECKING:
    from argparse import _SubParsersAction
    from collections.abc import Callable, Mapping
    from typing import Any

    from fwav_companion.config import Config
    from fwav_companion.tools.doctor.evidence import Files
    from fwav_companion.tools.doctor.finding import Finding
    from fwav_companion.tools.doctor.gathering import HeardStatus
    from fwav_companion.types.status import RunStatus

SECONDS = 12.0
"""Seconds of listening: four until the autopilot is adopted, two to settle the clock, the rest to measure rates."""
EXIT_ERROR = 1


def add_parser(subparsers: _SubParsersAction[argparse.ArgumentParser]) -> None:
    """Register the command."""
    parser = subparsers.add_parser(
        "check",
        description=(
            "Reports what every link and stream delivers and what to change, the most important first. If a `run` is "
            "active it reads its status file; else it opens what the configuration names, and steers and records "
            "nothing. Exit status 1: an ERROR was found, the service does not do its work."
        ),
        epilog=(
            "examples:\n"
            "  fwav-companion check --config fwav-companion.toml\n"
            "  fwav-companion check --config fwav-companion.toml --shake --tag-size 0.16\n"
            "  fwav-companion check --config fwav-companion.toml --pad pad.pdf\n"
            "  fwav-companion check --config fwav-companion.toml --click-delay\n\n"
            "--shake: lay a printed tag (AprilTag 36h11, or what [vision] names) on level ground, hold the vehicle\n"
            "half a metre to a metre above it so that the camera sees it, and follow the instructions: shake it for\n"
            "10 s, turn it by 90 deg, shake it for 10 s more. It prints the camera's delay and mount, and the lines\n"
            "to paste into the configuration.\n\n"
            "--click-delay: let something that the detector finds blink evenly before the camera, once in 1 to 2 s: a\n"
            "lamp for `color`, a tag on a telephone's screen. In the ground station's video, click on it each time\n"
            "that it appears, in its rhythm, ten times. It prints [publish] video_delay_s."
        ),
        formatter_class=argparse.RawDescriptionHelpFormatter,
    )
    parser.add_argument("--config", metavar="FILE", required=True, help="the configuration, as `init` writes one")
    parser.add_argument(
        "--seconds",
        type=_number(0.1, 3600.0, "seconds"),
        help=f"seconds to listen if no `run` is active, default {SECONDS:g}; with --shake, seconds to wait for vehicle "
        f"and tag, default {WAIT_S:g}; with --click-delay, seconds for the clicks, default 60",
    )
    parser.add_argument("--shake", action="store_true", help="find the camera's delay and mount with a printed tag")
    parser.add_argument(
        "--tag-size",
        metavar="M",
        type=_number(0.01, 10.0, "metres"),
        help="with --shake: the side of the tag's black square, metres",
    )
    parser.add_argument(
        "--pad",
        metavar="FILE",
        type=Path,
        help="write the sheets of the configured [[pad]] to a .pdf, or one to a .png, to print at true size",
    )
    parser.add_argument(
        "--click-delay",
        action="store_true",
        help="find the delay of the operator's video, who clicks on something that blinks",
    )
    parser.add_argument(
        "--json", action="store_true", help="end with everything as one JSON object: ok, how, findings, status"
    )
    parser.set_defaults(run=run)


def _number(low: float, high: float, unit: str) -> Callable[[str], float]:
    """Return the argparse type of a number between two limits."""

    def number(text: str) -> float:
        try:
            value = float(text)
        except ValueError:
            value = nan
        if not low <= value <= high:
            raise argparse.ArgumentTypeError(f"{text}: accepted: {low:g} to {high:g}, {unit}")
        return value

    return number


def run(arguments: argparse.Namespace) -> int:
    """Gather the evidence, judge it and print the report; or guide a shake session."""
    with as_by_ctrl_c():
        if arguments.pad is not None:
            return _printed(arguments)
        if arguments.shake or arguments.tag_size is not None:
            return _shaken(arguments)
        return _clicked(arguments) if arguments.click_delay else _checked(arguments)


def _printed(arguments: argparse.Namespace) -> int:
    from fwav_companion.cli.pad_sheet import run_pad_sheet
    from fwav_companion.config import load

    if arguments.shake or arguments.tag_size is not None or arguments.click_delay:
        raise UserError("--pad only writes a file: accepted: without --shake, --tag-size and --click-delay")
    return run_pad_sheet(load(arguments.config), arguments.pad, as_json=arguments.json)


def _clicked(arguments: argparse.Namespace) -> int:
    from fwav_companion.cli.click_delay import WAIT_S, run_click_delay
    from fwav_companion.config import load

    config = load(arguments.config)
    config.require_links()
    return run_click_delay(config, WAIT_S if arguments.seconds is None else arguments.seconds, as_json=arguments.json)


def _checked(arguments: argparse.Namespace) -> int:
    seconds = SECONDS if arguments.seconds is None else arguments.seconds
    from fwav_companion.config import load
    from fwav_companion.tools.doctor.board import Probe
    from fwav_companion.tools.doctor.evidence import Evidence
    from fwav_companion.tools.doctor.examination import examine
    from fwav_companion.tools.doctor.finding import Level, worst
    from fwav_companion.tools.doctor.gathering import load_files, running_status
    from fwav_companion.tools.doctor.model_report import model_report
    from fwav_companion.tools.doctor.report_text import report_lines

    config = load(arguments.config)
    config.require_links()
    files, key = load_files(config)
    files = msgspec.structs.replace(files, model=model_report(config))
    status = running_status(config)
    how = "by the status of the service that runs"
    if status is None:
        how = f"listened for {seconds:g} s"
        status = _listened(config, files, key, seconds)
    board = Probe().board(config, _unopened(status.typed))
    evidence = Evidence(config=config, board=board, files=files, status=status.typed)
    findings = examine(evidence)
    for line in report_lines(evidence, findings, how):
        print(line)
    ok = worst(findings) is not Level.ERROR
    if arguments.json:
        print(json.dumps(_object(ok, how, findings, status.written)))
    if status.typed.acting is not None and status.typed.acting.follow_id_heard:
        raise config.heard_follow_id()
    return 0 if ok else EXIT_ERROR


def _shaken(arguments: argparse.Namespace) -> int:
    from fwav_companion.config import load

    if arguments.click_delay:
        raise UserError("--shake and --click-delay are two sessions: accepted: one of them")
    if not arguments.shake or arguments.tag_size is None:
        raise UserError(
            "--shake and --tag-size go together: --shake --tag-size 0.16, metres of the black square's side"
        )
    config = load(arguments.config)
    config.require_links()
    wait_s = WAIT_S if arguments.seconds is None else arguments.seconds
    return run_shake(config, arguments.tag_size, wait_s, as_json=arguments.json)


def _listened(config: Config, files: Files, key: bytes | None, seconds: float) -> HeardStatus:
    from fwav_companion.tools.doctor.gathering import listen

    done = threading.Event()
    bar = threading.Thread(target=_progress, args=(seconds, done), daemon=True)
    if sys.stderr.isatty():
        bar.start()
    try:
        return listen(config, files, key, seconds)
    finally:
        done.set()
        if bar.is_alive():
            bar.join(1.0)


def _progress(seconds: float, done: threading.Event) -> None:
    from rich.console import Console
    from rich.progress import Progress

    step_s = 0.2
    with Progress(console=Console(stderr=True), transient=True) as progress:
        task = progress.add_task("listening", total=seconds)
        while not done.wait(step_s):
            progress.advance(task, step_s)


def _unopened(status: RunStatus) -> dict[str, str]:
    """Return why links, and the port of the detections, are not open, by their names."""
    links = {name: link.why for name, link in status.links.items() if link.state == "down"}
    return links | {"detections": status.intake.why}


def _object(ok: bool, how: str, findings: list[Finding], status: Mapping[str, Any]) -> dict[str, Any]:
    from msgspec import to_builtins

    return {"ok": ok, "how": how, "findings": to_builtins(findings), "status": status}
