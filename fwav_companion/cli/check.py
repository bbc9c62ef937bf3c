"""``fwav-companion check``: the doctor."""

from __future__ import annotations

import argparse
import json
import sys
import threading
from math import nan
from typing import TYPE_CHECKING

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

SECONDS = 12.0
"""Three to know the autopilot, two to settle the clock, the rest to measure the rates that were then asked for."""
EXIT_STOPS = 1


def add_parser(subparsers: _SubParsersAction[argparse.ArgumentParser]) -> None:
    """Register the command."""
    parser = subparsers.add_parser(
        "check",
        description=(
            "Says what every link and stream delivers and what to change, the most important first. Beside a `run` it "
            "reads that one's status; else it opens what the configuration names, and steers and records nothing."
        ),
        epilog=(
            "examples:\n"
            "  fwav-companion check --config fwav-companion.toml\n"
            "  fwav-companion check --config fwav-companion.toml --shake --tag-size 0.16\n\n"
            "--shake: lay a printed tag (AprilTag 36h11, or what [vision] names) on level ground, hold the vehicle\n"
            "half a metre to a metre above it so that the camera sees it, and do as you are told: shake it for 10 s,\n"
            "turn it by 90 deg, shake it for 10 s more. It says the camera's delay and mount, and the lines to paste."
        ),
        formatter_class=argparse.RawDescriptionHelpFormatter,
    )
    parser.add_argument("--config", metavar="FILE", required=True, help="the configuration, as `init` writes one")
    parser.add_argument(
        "--seconds",
        type=_number(0.1, 3600.0, "seconds"),
        help=f"how long to listen where nothing runs, default {SECONDS:g}; with --shake, how long to wait for vehicle "
        f"and tag, default {WAIT_S:g}",
    )
    parser.add_argument("--shake", action="store_true", help="find the camera's delay and mount over a printed tag")
    parser.add_argument(
        "--tag-size",
        metavar="M",
        type=_number(0.01, 10.0, "metres"),
        help="with --shake: the side of the tag's black square, metres",
    )
    parser.add_argument("--json", action="store_true", help="end with everything as one JSON object")
    parser.set_defaults(run=run)


def _number(low: float, high: float, unit: str) -> Callable[[str], float]:
    """What argparse takes for a number between two."""

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
    """Look, listen, judge, tell; or have the vehicle shaken."""
    with as_by_ctrl_c():
        if arguments.shake or arguments.tag_size is not None:
            return _shaken(arguments)
        return _checked(arguments)


def _checked(arguments: argparse.Namespace) -> int:
    seconds = SECONDS if arguments.seconds is None else arguments.seconds
    from fwav_companion.config import load
    from fwav_companion.tools.doctor.board import Probe
    from fwav_companion.tools.doctor.evidence import Evidence
    from fwav_companion.tools.doctor.examine import examine
    from fwav_companion.tools.doctor.files import load_files
    from fwav_companion.tools.doctor.finding import Level
    from fwav_companion.tools.doctor.listening import running_status
    from fwav_companion.tools.doctor.telling import told

    config = load(arguments.config)
    config.require_links()
    files, key = load_files(config)
    status = running_status(config)
    how = "by the status of the service that runs"
    if status is None:
        how = f"listened for {seconds:g} s"
        status = _listened(config, files, key, seconds)
    board = Probe().board(config, _taken(status))
    evidence = Evidence(config=config, board=board, files=files, status=status)
    findings = examine(evidence)
    for line in told(evidence, findings, how):
        print(line)
    ok = all(finding.level is not Level.STOPS for finding in findings)
    if arguments.json:
        print(json.dumps(_object(ok, how, findings, status)))
    return 0 if ok else EXIT_STOPS


def _shaken(arguments: argparse.Namespace) -> int:
    from fwav_companion.config import load

    if not arguments.shake or arguments.tag_size is None:
        raise UserError(
            "--shake and --tag-size go together: --shake --tag-size 0.16, metres of the black square's side"
        )
    config = load(arguments.config)
    config.require_links()
    wait_s = WAIT_S if arguments.seconds is None else arguments.seconds
    return run_shake(config, arguments.tag_size, wait_s, as_json=arguments.json)


def _listened(config: Config, files: Files, key: bytes | None, seconds: float) -> Mapping[str, Any]:
    from fwav_companion.tools.doctor.listening import listen

    done = threading.Event()
    bar = threading.Thread(target=_progress, args=(seconds, done), daemon=True)
    if sys.stderr.isatty():
        bar.start()
    try:
        return listen(config, files.calibration, key, tuple(files.elevation), seconds)
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


def _taken(status: Mapping[str, Any]) -> dict[str, str]:
    """Why links, and the port of the detections, are not open."""
    links = status.get("links") or {}
    taken = {name: str(link.get("why") or "") for name, link in links.items() if link.get("state") == "down"}
    return taken | {"detections": str((status.get("intake") or {}).get("why") or "")}


def _object(ok: bool, how: str, findings: list[Finding], status: Mapping[str, Any]) -> dict[str, Any]:
    listed = [{name: str(getattr(finding, name)) for name in finding.__struct_fields__} for finding in findings]
    return {"ok": ok, "how": how, "findings": listed, "status": status}
