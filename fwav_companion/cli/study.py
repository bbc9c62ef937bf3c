"""``fwav-companion study``: accuracy over many flights, drawn or recorded, its limits, and what to change first."""

from __future__ import annotations

import argparse
from pathlib import Path
from typing import TYPE_CHECKING

from fwav_companion.cli.seed import seed
from fwav_companion.cli.signals import as_by_ctrl_c
from fwav_companion.errors import UserError
from fwav_companion.libraries import require

if TYPE_CHECKING:
    from argparse import _SubParsersAction

EXAMPLES = """examples:
  fwav-companion study --config fwav-companion.toml
  fwav-companion study --config fwav-companion.toml --vary flight.height_m=5:40 --flights 200
  fwav-companion study --config fwav-companion.toml --vary uncertainty.position_bias_m=0.02,0.3,1
  fwav-companion study --recordings flights --set uncertainty.mount_bias_deg=0.5 --set tracking.filter=lowpass

KEY is a key of the configuration, in dots: both what is drawn and what is claimed; truth.KEY only what is drawn,
claim.KEY only what is claimed. Or one of the flight: flight.height_m, radius_m, speed_m_s, pitch_deg, flap_hz,
flap_deg, wind_m_s, miss_rate. Without them the body flaps, at 37 degrees of mean pitch: for a copter
--set flight.flap_deg=0 flight.pitch_deg=0. A scheduler executes what it is sent: use --scheduler in trusted networks
only."""
PATTERNS = ("eight", "hover", "orbit", "survey", "straight")
MOST_FLIGHTS = 1_000_000
LONGEST_S = 3600.0


def add_parser(subparsers: _SubParsersAction[argparse.ArgumentParser]) -> None:
    """Register the command."""
    parser = subparsers.add_parser(
        "study",
        description="Flies a configuration many times in simulated time, or replays recorded flights under other "
        "settings, on all cores or a Dask cluster: how accurate, what limits it, what to change first.",
        epilog=EXAMPLES,
        formatter_class=argparse.RawDescriptionHelpFormatter,
    )
    add = parser.add_argument
    add("--config", metavar="FILE", help="the configuration whose priors are drawn from")
    add("--flights", type=_flights, default=60, metavar="N", help="number of flights; default: 60")
    add("--vary", action="append", default=[], metavar="KEY=LO:HI", help="draw a key uniformly from a range, or "
        "KEY=A,B from choices; may be repeated")  # fmt: skip
    add("--set", action="append", nargs="+", default=[], metavar="KEY=VALUE", help="set a key; may be repeated. With "
        "--recordings each --set is a setting of its own, of one or several keys")  # fmt: skip
    add("--pattern", choices=PATTERNS, help="the flight's path about the target; default: eight")
    add("--preset", choices=("paper",), default="", help="paper: the paper's case in these terms")
    add("--seconds", type=_seconds, help="duration of a flight; default: 60")
    add("--recordings", metavar="DIR", help="replay every recorded flight in this folder under each --set, paired")
    add("--scheduler", metavar="ADDRESS", default="", help="a running Dask scheduler, tcp:// or tls://HOST:8786; "
        "default: one worker a core of this machine")  # fmt: skip
    add("--workers", type=_workers, default=None, metavar="N", help="workers of this machine; default: one a core")
    add("--out", metavar="DIR", type=Path, default=Path("study-out"), help="folder for results; default: study-out")
    add("--seed", type=seed, default=1, help="seed of all draws; default: 1")
    add("--resume", action="store_true", help="go on with an interrupted study")
    add("--report-only", action="store_true", help="write the report of the flights in --out again")
    add("--only", metavar="INDEX", default="", help="fly one flight of the study alone, and keep its recording in "
        "--out")  # fmt: skip
    add("--json", action="store_true", help="end with the answer as one JSON object")
    parser.set_defaults(run=run)


def run(arguments: argparse.Namespace) -> int:
    """Run the study and return the exit status."""
    require("study", "numpy", "scipy", "pyarrow", "distributed")
    with as_by_ctrl_c():
        if arguments.report_only:
            return _report_again(arguments)
        if arguments.recordings is not None:
            from fwav_companion.cli.study_recordings import compare_settings

            return compare_settings(arguments)
        return _study(arguments)


def _study(arguments: argparse.Namespace) -> int:
    from fwav_companion.cli.study_output import ShownProgress, show_answer
    from fwav_companion.cli.study_plans import plan_from
    from fwav_companion.tools.study.cluster import WorkersDiedError, workers
    from fwav_companion.tools.study.engine import run_study
    from fwav_companion.tools.study.mock_process import MockError

    plan = plan_from(arguments)
    if arguments.only:
        from fwav_companion.cli.study_single import fly_alone

        return fly_alone(plan, arguments.only, arguments.out)
    try:
        with workers(arguments.scheduler, arguments.workers) as flying, ShownProgress(plan.flights) as progress:
            finished = run_study(plan, arguments.out, flying, progress, resume=arguments.resume)
    except (MockError, WorkersDiedError) as error:
        raise UserError(f"study: {error}") from None
    return show_answer(finished, arguments.out, as_json=arguments.json)


def _report_again(arguments: argparse.Namespace) -> int:
    from fwav_companion.cli.study_output import show_answer
    from fwav_companion.tools.study.engine import FinishedStudy
    from fwav_companion.tools.study.record_file import FILE, read_records

    records, plan, environment = read_records(arguments.out / FILE)
    finished = FinishedStudy(plan=plan, environment=environment, records=records, is_complete=True)
    return show_answer(finished, arguments.out, as_json=arguments.json)


def _flights(text: str) -> int:
    if not (text.isascii() and text.isdecimal() and 1 <= int(text) <= MOST_FLIGHTS):
        raise argparse.ArgumentTypeError(f"{text}: accepted: a whole number from 1 to {MOST_FLIGHTS}")
    return int(text)


def _workers(text: str) -> int:
    if not (text.isascii() and text.isdecimal() and 1 <= int(text) <= 1024):
        raise argparse.ArgumentTypeError(f"{text}: accepted: a whole number from 1")
    return int(text)


def _seconds(text: str) -> float:
    try:
        value = float(text)
    except ValueError:
        value = 0.0
    if not 1.0 <= value <= LONGEST_S:
        raise argparse.ArgumentTypeError(f"{text}: accepted: seconds from 1 to {LONGEST_S:g}")
    return value
