"""``fwav-companion COMMAND``: runs the command, and turns errors into one line and an exit status.

0: done. 1: the command ran and the result is bad. 2: wrong usage, configuration or input file.
"""

from __future__ import annotations

import argparse
import os
import sys
from collections.abc import Sequence
from contextlib import suppress
from errno import ENOSPC
from importlib import import_module
from importlib.util import find_spec
from io import TextIOWrapper
from pathlib import Path
from typing import NamedTuple, NoReturn

from fwav_companion import __version__
from fwav_companion.errors import UserError
from fwav_companion.libraries import advice, is_known

EXIT_BAD, EXIT_USAGE = 1, 2
EXIT_INTERRUPTED = 130
"""128 + SIGINT, as in shells."""
EXIT_PIPE_CLOSED = 141
"""128 + SIGPIPE."""


class CommandModule(NamedTuple):
    """One command. A module is imported only for its own command, so that ``run`` does not load the other modules."""

    name: str
    help: str

    @property
    def module(self) -> str:
        """Module with ``add_parser(subparsers)``, which sets ``run``: a function from the arguments to the status."""
        return f"fwav_companion.cli.{self.name}"


COMMANDS = (
    CommandModule("run", "the daemon: links, detections in, targets out"),
    CommandModule("demo", "a flight with nothing attached, against the mock autopilot"),
    CommandModule("replay", "the same pipeline over a recording"),
    CommandModule("export", "a recording for other programs: MCAP, KML, KMZ, GeoJSON, CSV, GPX"),
    CommandModule("study", "many flights, drawn or recorded: how accurate, and what limits it"),
    CommandModule("detect", "the configured detector over recorded pictures"),
    CommandModule("locate", "from a pixel in a picture to a place on the map"),
    CommandModule("paper", "the paper's experiment, its table and figures"),
    CommandModule("calibrate", "fit a camera to pictures of a board"),
    CommandModule("check", "what every link and stream delivers, and what to change"),
    CommandModule("ground", "the ground picture: vehicles and targets on a web page"),
    CommandModule("init", "write a commented configuration and the paper's camera file"),
    CommandModule("install", "the service on this board: user, environment, unit, udev rule, configuration"),
    CommandModule("bench", "the project's benchmarks, as ratios"),
)


BLAS_THREADS = ("OPENBLAS_NUM_THREADS", "OMP_NUM_THREADS", "MKL_NUM_THREADS")
"""Environment variables that numpy reads when it is imported. Threads slow down matrices of 30 rows, and the vision
process would wait for these threads."""


class OneLineParser(argparse.ArgumentParser):
    """Reports wrong arguments in one line, like every other user error."""

    def error(self, message: str) -> NoReturn:
        """Raise a UserError instead of printing a usage text and exiting."""
        raise UserError(f"{message} (see {self.prog} --help)")


def main(argv: Sequence[str] | None = None) -> int:
    """Run one command and return its exit status. A user error is one line on stderr, never a traceback."""
    if isinstance(sys.stdout, TextIOWrapper):
        sys.stdout.reconfigure(errors="replace")  # a terminal without a degree sign gets a question mark
    try:
        try:
            return _run(sys.argv[1:] if argv is None else argv)
        finally:
            if sys.stdout is not None:  # the parent process may have closed it
                sys.stdout.flush()
    except UserError as error:
        return _usage_error(str(error))
    except ModuleNotFoundError as error:
        if error.name is None or not is_known(error.name):
            raise
        return _usage_error(advice(error.name))
    except KeyboardInterrupt:
        return EXIT_INTERRUPTED
    except BrokenPipeError:  # the reader of the output has closed it
        _let_go_of_stdout()
        return EXIT_PIPE_CLOSED
    except OSError as error:
        if error.errno != ENOSPC:
            raise
        _let_go_of_stdout()
        print(f"fwav-companion: {error.filename or 'output'}: {error.strerror}", file=sys.stderr)
        return EXIT_BAD


def _usage_error(text: str) -> int:
    print(f"fwav-companion: {' '.join(text.splitlines())}", file=sys.stderr)  # a name may have several lines
    return EXIT_USAGE


def _let_go_of_stdout() -> None:
    """Redirect stdout to the null device, so that the interpreter does not flush into it again."""
    os.dup2(os.open(os.devnull, os.O_WRONLY), sys.stdout.fileno())


def _run(argv: Sequence[str]) -> int:
    os.environ.update({name: "1" for name in BLAS_THREADS if name not in os.environ})
    _require_utf8(argv)
    arguments, unknown = _parser(argv).parse_known_args(argv)
    if unknown:
        raise UserError(f"unrecognized arguments: {' '.join(unknown)} (see fwav-companion {_called(argv)} --help)")
    status: int = arguments.run(arguments)
    return status


def _require_utf8(argv: Sequence[str]) -> None:
    """Refuse file names that are not UTF-8, also of the working folder: JSON could not hold them. UserError."""
    names = list(argv)
    with suppress(OSError):  # the working folder was removed
        names.append(str(Path.cwd()))
    for name in names:
        readable = os.fsencode(name).decode(errors="replace")
        if readable != name:
            raise UserError(f"{readable}: it has bytes that are not UTF-8; accepted: a name in UTF-8")


def _parser(argv: Sequence[str]) -> argparse.ArgumentParser:
    """The parser: all installed commands by name, and the arguments of the called one."""
    parser = OneLineParser(
        prog="fwav-companion",
        description="Turns camera detections into ground positions with honest uncertainty, sent as MAVLink.",
        epilog="example:\n  fwav-companion init && fwav-companion run --config fwav-companion.toml",
        formatter_class=argparse.RawDescriptionHelpFormatter,
    )
    parser.add_argument("-V", "--version", action="version", version=f"fwav-companion {__version__}")
    subparsers = parser.add_subparsers(metavar="COMMAND", required=True)
    called = _called(argv)
    for command in COMMANDS:
        if find_spec(command.module) is None:
            continue
        if command.name == called:
            import_module(command.module).add_parser(subparsers)
        else:
            subparsers.add_parser(command.name, help=command.help)
    return parser


def _called(argv: Sequence[str]) -> str:
    """The name of the called command; "" if there is none."""
    return next((argument for argument in argv if not argument.startswith("-")), "")
