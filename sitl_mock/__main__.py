"""``sitl-mock``: the mock autopilot by hand, as a second process."""

from __future__ import annotations

import argparse
import signal
import sys
from pathlib import Path

from sitl_mock import live, recording
from sitl_mock.arguments import (
    LONGEST_S,
    MISTAKES,
    SCENARIOS_TOLD,
    OneLineParser,
    add_flight_arguments,
    instant_ns,
    options_from,
    told,
)
from sitl_mock.options import Options


def main(arguments: list[str] | None = None) -> int:
    """0 at the end of the flight or when told to stop; 2 for what cannot be understood or opened."""
    chosen = _parser().parse_args(arguments)
    try:
        options = options_from(chosen, None if chosen.record else LONGEST_S)
        if chosen.record:
            recording.record(options, Path(chosen.record))
            print(f"sitl-mock: {options.seconds:g} s of {options.scenario} recorded in {chosen.record}")  # noqa: T201
        else:
            _fly(options, chosen)
    except MISTAKES as error:
        print(f"sitl-mock: {told(error)}", file=sys.stderr)  # noqa: T201
        return 2
    return 0


def _fly(options: Options, chosen: argparse.Namespace) -> None:
    signals: list[int] = []
    for number in (signal.SIGTERM, signal.SIGINT):
        signal.signal(number, lambda received, _frame: signals.append(received))
    plan = live.Plan(chosen.connect, chosen.detections, chosen.detections_file, chosen.truth, chosen.truth_csv)
    live.run(options, plan, start_ns=chosen.start_ns, stopped=lambda: bool(signals), say=_say)


def _say(text: str) -> None:
    print(text, flush=True)  # noqa: T201


def _parser() -> argparse.ArgumentParser:
    parser = OneLineParser(
        prog="sitl-mock",
        description="A mock autopilot with a camera: MAVLink on a link, detections as datagrams, the truth in a file.",
        epilog=f"{SCENARIOS_TOLD}\n\nexample:\n  sitl-mock --connect udpout:127.0.0.1:14540 "
        "--detections 127.0.0.1:14601 --scenario late_camera --set flight.height_m=10 --truth truth.jsonl",
        formatter_class=argparse.RawDescriptionHelpFormatter,
    )
    add = parser.add_argument
    add("--connect", metavar="URL", default="udpout:127.0.0.1:14540", help="udpout|udpin|tcpin|tcpout:HOST:PORT, "
        "serial:/dev/NAME, or pty; default %(default)s")  # fmt: skip
    add("--detections", metavar="ADDRESS", default="", help="HOST:PORT or unix:PATH; none by default")
    add("--detections-file", metavar="FILE", default="", help="the same as lines of a .jsonl")
    add_flight_arguments(parser)
    add(
        "--start-ns",
        type=instant_ns,
        default=0,
        help="begin when the host's monotonic clock shows this; default: at once",
    )
    add("--truth", metavar="FILE", default="", help="biases, targets, frames, landing results (.jsonl); "
        "with --set truth_hz=50 the vehicle too")  # fmt: skip
    add("--truth-csv", metavar="FILE", default="", help="label, lat, lon, alt_amsl, time_unix")
    add("--record", metavar="DIR", default="", help="no link: the whole flight into files, as fast as it goes")
    return parser


if __name__ == "__main__":
    sys.exit(main())
