"""``sitl-mock``: the mock autopilot by hand, as a second process."""

from __future__ import annotations

import argparse
import ast
import signal
import sys
from pathlib import Path
from typing import Any

from sitl_mock import live, recording
from sitl_mock.options import Options, TargetOptions
from sitl_mock.scenarios import SCENARIOS, scenario

FOREVER_S = 1e8
RECORDED_S = 60.0
TARGET_NUMBERS = ("north", "east", "up", "speed_m_s", "course_deg", "leg_m")


def main(arguments: list[str] | None = None) -> int:
    """0 at the end of the flight or when told to stop; 2 for what cannot be understood or opened."""
    chosen = _parser().parse_args(arguments)
    try:
        options = _options(chosen)
        if chosen.record:
            recording.record(options, Path(chosen.record))
            print(f"sitl-mock: {options.seconds:g} s of {options.scenario} recorded in {chosen.record}")  # noqa: T201
        else:
            _fly(options, chosen)
    except (KeyError, ValueError, OSError) as error:
        text = error.args[0] if isinstance(error, KeyError) else error
        print(f"sitl-mock: {text}", file=sys.stderr)  # noqa: T201
        return 2
    return 0


def _fly(options: Options, chosen: argparse.Namespace) -> None:
    signals: list[int] = []
    for number in (signal.SIGTERM, signal.SIGINT):
        signal.signal(number, lambda received, _frame: signals.append(received))
    plan = live.Plan(chosen.connect, chosen.detections, chosen.detections_file, chosen.truth, chosen.truth_csv)
    live.run(options, plan, stopped=lambda: bool(signals), say=lambda text: print(text, flush=True))  # noqa: T201


def _options(chosen: argparse.Namespace) -> Options:
    endless_s = RECORDED_S if chosen.record else FOREVER_S
    options = scenario(chosen.scenario).but({"seed": chosen.seed, "seconds": chosen.seconds or endless_s})
    if chosen.target:
        options = options.but({"targets": tuple(_target(text) for text in chosen.target)})
    return options.but(dict(_pair(text) for text in chosen.set))


def _target(text: str) -> TargetOptions:
    label, *numbers = text.split(",")
    if not 2 <= len(numbers) <= len(TARGET_NUMBERS):
        raise ValueError(f"--target {text!r}: expected LABEL,NORTH,EAST[,UP[,SPEED[,COURSE[,LEG]]]]")
    return TargetOptions(label=label, **dict(zip(TARGET_NUMBERS, map(float, numbers), strict=False)))


def _pair(text: str) -> tuple[str, Any]:
    key, equals, value = text.partition("=")
    if not equals:
        raise ValueError(f"--set {text!r}: expected key=value")
    try:
        return key, ast.literal_eval(value)
    except (ValueError, SyntaxError):
        return key, {"true": True, "false": False}.get(value, value)


def _parser() -> argparse.ArgumentParser:
    width = max(map(len, SCENARIOS)) + 2
    scenarios = "\n".join(f"  {name:{width}}{told}" for name, (told, _) in SCENARIOS.items())
    parser = argparse.ArgumentParser(
        prog="sitl-mock",
        description="A mock autopilot with a camera: MAVLink on a link, detections as datagrams, the truth in a file.",
        epilog=f"scenarios:\n{scenarios}\n\nexample:\n  sitl-mock --connect udpout:127.0.0.1:14540 "
        "--detections 127.0.0.1:14601 --scenario late_camera --set flight.height_m=10 --truth truth.jsonl",
        formatter_class=argparse.RawDescriptionHelpFormatter,
    )
    add = parser.add_argument
    add("--connect", metavar="URL", default="udpout:127.0.0.1:14540", help="udpout|udpin|tcpin|tcpout:HOST:PORT, "
        "serial:/dev/NAME, or pty; default %(default)s")  # fmt: skip
    add("--detections", metavar="ADDRESS", default="", help="HOST:PORT or unix:PATH; none by default")
    add("--detections-file", metavar="FILE", default="", help="the same as lines of a .jsonl")
    add("--scenario", metavar="NAME", default="default", help="one of those below")
    add("--seed", type=int, default=1, help="of everything that is drawn; default 1")
    add("--seconds", type=float, default=0.0, help="length of the flight; default: until stopped, 60 with --record")
    add("--target", metavar="LABEL,N,E[,...]", action="append", default=[], help="instead of the scenario's: metres "
        "from the flight centre, then up, speed, course, leg; may be repeated")  # fmt: skip
    add("--set", metavar="KEY=VALUE", action="append", default=[], help="one option, such as flight.height_m=10")
    add("--truth", metavar="FILE", default="", help="biases, targets, frames, landing results (.jsonl); "
        "with --set truth_hz=50 the vehicle too")  # fmt: skip
    add("--truth-csv", metavar="FILE", default="", help="label, lat, lon, alt_amsl, time_unix")
    add("--record", metavar="DIR", default="", help="no link: the whole flight into files, as fast as it goes")
    return parser


if __name__ == "__main__":
    sys.exit(main())
