"""What every program of the mock is told about the flight: scenario, seed, targets and single options."""

from __future__ import annotations

import argparse
import ast
from typing import Any

from sitl_mock.options import Options, TargetOptions
from sitl_mock.scenarios import SCENARIOS, scenario

TARGET_NUMBERS = ("north", "east", "up", "speed_m_s", "course_deg", "leg_m")
_WIDTH = max(map(len, SCENARIOS)) + 2
SCENARIOS_TOLD = "scenarios:\n" + "\n".join(f"  {name:{_WIDTH}}{told}" for name, (told, _) in SCENARIOS.items())


def add_flight_arguments(parser: argparse.ArgumentParser) -> None:
    """--scenario, --seed, --seconds, --target, --set."""
    add = parser.add_argument
    add("--scenario", metavar="NAME", default="default", help="one of those below")
    add("--seed", type=int, default=1, help="of everything that is drawn; default 1")
    add("--seconds", type=float, default=0.0, help="length of the flight; default: until stopped, 60 with --record")
    add("--target", metavar="LABEL,N,E[,...]", action="append", default=[], help="instead of the scenario's: metres "
        "from the flight centre, then up, speed, course, leg; may be repeated")  # fmt: skip
    add("--set", metavar="KEY=VALUE", action="append", default=[], help="one option, such as flight.height_m=10")


def options_from(chosen: argparse.Namespace, endless_s: float) -> Options:
    """The flight that was asked for. KeyError or ValueError says what cannot be understood."""
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
