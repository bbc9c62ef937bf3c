"""Flight arguments of every program of the mock: scenario, seed, targets and single options."""

from __future__ import annotations

import argparse
import ast
import dataclasses
import struct
from functools import cache, reduce
from math import inf, isfinite
from typing import Any, NoReturn, get_type_hints

import msgspec

from sitl_mock.autopilots import AUTOPILOTS
from sitl_mock.options import Options
from sitl_mock.scenarios import SCENARIOS, scenario
from sitl_mock.target_options import TargetOptions

TARGET_NUMBERS = ("north", "east", "up", "speed_m_s", "course_deg", "leg_m")
LONGEST_OFF_S = 10.0
LONGEST_S = 1e8
"""Longest flight, seconds (three years): beyond it, clocks in nanoseconds lose their microseconds."""
LONGEST_INSTANT = 18
"""Longest instant, digits: thirty years in nanoseconds."""
MISTAKES = (KeyError, ValueError, OSError, OverflowError, struct.error)
"""Exceptions that wrong arguments raise."""
_WIDTH = max(map(len, SCENARIOS)) + 2
SCENARIO_LIST = "scenarios:\n" + "\n".join(
    f"  {name:{_WIDTH}}{description}" for name, (description, _) in SCENARIOS.items()
)
AUTOPILOT_LIST = "autopilots:\n" + "\n".join(
    f"  {name:{_WIDTH}}{description}" for name, (description, _) in AUTOPILOTS.items()
)


class OneLineParser(argparse.ArgumentParser):
    """Argument parser that reports an error in one line."""

    def error(self, message: str) -> NoReturn:
        """Prints the error and exits with status 2."""
        self.exit(2, f"{self.prog}: {message} (see --help)\n")


def add_flight_arguments(parser: argparse.ArgumentParser) -> None:
    """Adds --scenario, --autopilot, --seed, --seconds, --target, --first-timesync-off and --set."""
    add = parser.add_argument
    add(
        "--scenario",
        metavar="NAME",
        default="default",
        help="scenario from the list below; the default is its first",
    )
    add("--autopilot", metavar="NAME", default="", help="autopilot from the list below; default: the scenario's")
    add("--seed", type=int, default=1, help="seed of all drawn values; default %(default)s")
    add("--seconds", type=float, default=0.0,
        help="duration of the flight; default: until stopped; with --record the scenario's own, else 60")  # fmt: skip
    add("--target", metavar="LABEL,N,E[,...]", action="append", default=[], help="target that replaces the "
        "scenario's: metres from the flight centre, then up, speed, course, leg; may be repeated")  # fmt: skip
    add("--first-timesync-off", metavar="SECONDS", type=float, action="append", default=[],
        help="error of the first answer's stamp to TIMESYNC; again for the second, and so on")  # fmt: skip
    add(
        "--set",
        metavar="KEY=VALUE",
        action="append",
        default=[],
        help="set one option, such as flight.height_m=10; may be repeated",
    )


def instant_ns(text: str) -> int:
    """Instant of the monotonic clock from a command-line argument, nanoseconds."""
    if not (text.isascii() and text.isdecimal() and len(text) <= LONGEST_INSTANT):
        raise argparse.ArgumentTypeError(f"{text}: expected nanoseconds of the monotonic clock")
    return int(text)


def options_from(chosen: argparse.Namespace, endless_s: float | None) -> Options:
    """Options of the flight given by the arguments; without --seconds it lasts ``endless_s``, or the scenario's
    duration.

    Raises KeyError or ValueError, whose message names the invalid argument.
    """
    if not 0.0 <= chosen.seconds <= LONGEST_S:
        raise ValueError(f"--seconds {chosen.seconds:g}: expected a duration in seconds, at most {LONGEST_S:g}")
    options = scenario(chosen.scenario).but({"seed": chosen.seed}).but(_autopilot(chosen.autopilot))
    options = options.but({"seconds": chosen.seconds or endless_s or options.seconds})
    if chosen.target:
        options = options.but({"targets": tuple(_target(text) for text in chosen.target)})
    if chosen.first_timesync_off:
        if not all(abs(off_s) < LONGEST_OFF_S for off_s in chosen.first_timesync_off):
            raise ValueError(f"--first-timesync-off: expected seconds, at most {LONGEST_OFF_S:g}")
        options = options.but({"autopilot.first_timesync_off_s": tuple(chosen.first_timesync_off)})
    for key, value in (_pair(text) for text in chosen.set):
        options = options.but({key: _of_its_kind(options.but({key: value}), key, value)})
    return options


def with_settings(options: Options, settings: dict[str, Any]) -> Options:
    """The options with settings as JSON has them. KeyError or ValueError, whose message names the invalid key."""
    for key, value in settings.items():
        options = options.but({key: value})
        options = options.but({key: _targets(value) if key == "targets" else _of_its_kind(options, key, value)})
    return options


def _targets(value: Any) -> tuple[TargetOptions, ...]:
    try:
        return msgspec.convert(value, tuple[TargetOptions, ...])
    except msgspec.ValidationError as error:
        raise ValueError(f"targets: {error}") from None


def message_for_user(error: Exception) -> str:
    """Message for the user about a wrong argument."""
    if isinstance(error, (OverflowError, struct.error)):
        return f"an option is beyond what can be flown, or said in MAVLink: {error}"
    if isinstance(error, OSError) and error.strerror:
        return f"{error.filename or 'output'}: {error.strerror}"
    return str(error.args[0]) if error.args else str(error)


def _of_its_kind(options: Options, key: str, value: Any) -> Any:
    """Value converted to the type of the option. Raises ValueError where the type does not fit. The key is known."""
    *path, last = key.split(".")
    kind = _kinds_of(type(reduce(getattr, path, options)))[last]  # type: ignore[arg-type]  # a type is hashable
    if dataclasses.is_dataclass(kind) or key == "targets":
        raise ValueError(f"--set {key}={value!r}: expected one of its own options, or --target")
    try:
        return msgspec.convert(value, kind)
    except msgspec.ValidationError as error:
        raise ValueError(f"--set {key}={value!r}: {str(error)[0].lower()}{str(error)[1:]}") from None


@cache
def _kinds_of(options: type[Any]) -> dict[str, Any]:
    return get_type_hints(options, include_extras=True)


def _autopilot(name: str) -> dict[str, Any]:
    """Differences of the named autopilot; none for "". Raises KeyError for an unknown name."""
    if name and name not in AUTOPILOTS:
        raise KeyError(f"--autopilot {name}: expected one of {', '.join(AUTOPILOTS)}")
    return AUTOPILOTS[name][1] if name else {}


def _target(text: str) -> TargetOptions:
    label, *numbers = text.split(",")
    if not 2 <= len(numbers) <= len(TARGET_NUMBERS):
        raise ValueError(f"--target {text!r}: expected LABEL,NORTH,EAST[,UP[,SPEED[,COURSE[,LEG]]]]")
    try:
        values = [float(number) for number in numbers]
    except ValueError:
        values = [inf]
    if not all(map(isfinite, values)):
        raise ValueError(f"--target {text!r}: expected finite numbers after the label")
    placed: dict[str, Any] = dict(zip(TARGET_NUMBERS, values, strict=False))
    return TargetOptions(label=label, **placed)


def _pair(text: str) -> tuple[str, Any]:
    key, equals, value = text.partition("=")
    if not equals:
        raise ValueError(f"--set {text!r}: expected key=value")
    try:
        return key, ast.literal_eval(value)
    except (ValueError, SyntaxError):
        return key, {"true": True, "false": False}.get(value, value)
