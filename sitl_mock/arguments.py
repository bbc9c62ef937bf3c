"""What every program of the mock is told about the flight: scenario, seed, targets and single options."""

from __future__ import annotations

import argparse
import ast
import dataclasses
import struct
from functools import reduce
from math import inf, isfinite
from typing import Any, NoReturn, get_type_hints

import msgspec

from sitl_mock.options import Options, TargetOptions
from sitl_mock.scenarios import SCENARIOS, scenario

TARGET_NUMBERS = ("north", "east", "up", "speed_m_s", "course_deg", "leg_m")
LONGEST_S = 1e8
"""Three years: further, clocks in nanoseconds lose their microseconds."""
LONGEST_INSTANT = 18
"""Digits: thirty years in nanoseconds."""
MISTAKES = (KeyError, ValueError, OSError, OverflowError, struct.error)
"""What wrong arguments end in."""
_WIDTH = max(map(len, SCENARIOS)) + 2
SCENARIOS_TOLD = "scenarios:\n" + "\n".join(f"  {name:{_WIDTH}}{told}" for name, (told, _) in SCENARIOS.items())


class OneLineParser(argparse.ArgumentParser):
    """Says what is wrong in one line."""

    def error(self, message: str) -> NoReturn:
        """And ends with status 2."""
        self.exit(2, f"{self.prog}: {message} (see --help)\n")


def add_flight_arguments(parser: argparse.ArgumentParser) -> None:
    """--scenario, --seed, --seconds, --target, --set."""
    add = parser.add_argument
    add("--scenario", metavar="NAME", default="default", help="one of those below")
    add("--seed", type=int, default=1, help="of everything that is drawn; default 1")
    add("--seconds", type=float, default=0.0,
        help="length of the flight; default: until stopped; with --record the scenario's own, else 60")  # fmt: skip
    add("--target", metavar="LABEL,N,E[,...]", action="append", default=[], help="instead of the scenario's: metres "
        "from the flight centre, then up, speed, course, leg; may be repeated")  # fmt: skip
    add("--set", metavar="KEY=VALUE", action="append", default=[], help="one option, such as flight.height_m=10")


def instant_ns(text: str) -> int:
    """What argparse takes for an instant of the monotonic clock."""
    if not (text.isascii() and text.isdecimal() and len(text) <= LONGEST_INSTANT):
        raise argparse.ArgumentTypeError(f"{text}: expected nanoseconds of the monotonic clock")
    return int(text)


def options_from(chosen: argparse.Namespace, endless_s: float | None) -> Options:
    """The flight that was asked for; without --seconds it lasts ``endless_s``, or as long as its scenario says.

    Raises KeyError or ValueError, which say what cannot be understood.
    """
    if not 0.0 <= chosen.seconds <= LONGEST_S:
        raise ValueError(f"--seconds {chosen.seconds:g}: expected a length of time, at most {LONGEST_S:g}")
    options = scenario(chosen.scenario).but({"seed": chosen.seed})
    options = options.but({"seconds": chosen.seconds or endless_s or options.seconds})
    if chosen.target:
        options = options.but({"targets": tuple(_target(text) for text in chosen.target)})
    for key, value in (_pair(text) for text in chosen.set):
        options = options.but({key: _of_its_kind(options.but({key: value}), key, value)})
    return options


def told(error: Exception) -> str:
    """What a user is told of a mistake of his."""
    if isinstance(error, (OverflowError, struct.error)):
        return f"an option is beyond what can be flown, or said in MAVLink: {error}"
    if isinstance(error, OSError) and error.strerror:
        return f"{error.filename or 'output'}: {error.strerror}"
    return str(error.args[0]) if error.args else str(error)


def _of_its_kind(options: Options, key: str, value: Any) -> Any:
    """The value as the option has it. ValueError where it is of another kind. The key is known."""
    *path, last = key.split(".")
    kind = get_type_hints(type(reduce(getattr, path, options)), include_extras=True)[last]
    if dataclasses.is_dataclass(kind) or key == "targets":
        raise ValueError(f"--set {key}={value!r}: expected one of its own options, or --target")
    try:
        return msgspec.convert(value, kind)
    except msgspec.ValidationError as error:
        raise ValueError(f"--set {key}={value!r}: {str(error)[0].lower()}{str(error)[1:]}") from None


def _target(text: str) -> TargetOptions:
    label, *numbers = text.split(",")
    if not 2 <= len(numbers) <= len(TARGET_NUMBERS):
        raise ValueError(f"--target {text!r}: expected LABEL,NORTH,EAST[,UP[,SPEED[,COURSE[,LEG]]]]")
    try:
        values = [float(number) for number in numbers]
    except ValueError:
        values = [inf]
    if not all(map(isfinite, values)):
        raise ValueError(f"--target {text!r}: expected finite numbers behind the label")
    return TargetOptions(label=label, **dict(zip(TARGET_NUMBERS, values, strict=False)))


def _pair(text: str) -> tuple[str, Any]:
    key, equals, value = text.partition("=")
    if not equals:
        raise ValueError(f"--set {text!r}: expected key=value")
    try:
        return key, ast.literal_eval(value)
    except (ValueError, SyntaxError):
        return key, {"true": True, "false": False}.get(value, value)
