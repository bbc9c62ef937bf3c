"""``sitl-mock``: the mock autopilot as a separate process, started by hand."""

from __future__ import annotations

import argparse
import signal
import sys
from pathlib import Path

from sitl_mock import live, recording
from sitl_mock.arguments import (
    AUTOPILOT_LIST,
    LONGEST_S,
    MISTAKES,
    SCENARIO_LIST,
    OneLineParser,
    add_flight_arguments,
    instant_ns,
    message_for_user,
    options_from,
)
from sitl_mock.options import Options
from sitl_mock.service import serve, spare_garbage_collection


def main(arguments: list[str] | None = None) -> int:
    """Exit status: 0 at the end of the flight or after a stop signal; 2 for invalid arguments or an output that cannot
    be opened.
    """
    chosen = _parser().parse_args(arguments)
    if chosen.serve:
        signal.signal(signal.SIGINT, signal.SIG_IGN)  # Ctrl-C reaches every process of a terminal: the client decides
        spare_garbage_collection()
        serve(sys.stdin.buffer, sys.stdout.buffer)
        return 0
    try:
        options = options_from(chosen, None if chosen.record else LONGEST_S)
        if chosen.record:
            recording.record(options, Path(chosen.record))
            print(f"sitl-mock: {options.seconds:g} s of {options.scenario} recorded in {chosen.record}")  # noqa: T201
        else:
            _fly(options, chosen)
    except MISTAKES as error:
        print(f"sitl-mock: {message_for_user(error)}", file=sys.stderr)  # noqa: T201
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
        description="Mock autopilot with a camera: MAVLink over a link, detections as datagrams, the truth in a file.",
        epilog=f"{AUTOPILOT_LIST}\n\n{SCENARIO_LIST}\n\nexample:\n  sitl-mock --connect udpout:127.0.0.1:14540 "
        "--detections 127.0.0.1:14601 --scenario late_camera --set flight.height_m=10 --truth truth.jsonl",
        formatter_class=argparse.RawDescriptionHelpFormatter,
    )
    add = parser.add_argument
    add("--connect", metavar="URL", default="udpout:127.0.0.1:14540", help="udpout|udpin|tcpin|tcpout:HOST:PORT, "
        "serial:/dev/NAME, or pty; default %(default)s")  # fmt: skip
    add(
        "--detections",
        metavar="ADDRESS",
        default="",
        help="send detections to HOST:PORT or unix:PATH; default: not sent",
    )
    add("--detections-file", metavar="FILE", default="", help="write detections to a .jsonl file")
    add_flight_arguments(parser)
    add(
        "--start-ns",
        type=instant_ns,
        default=0,
        help="start of the flight on the host's monotonic clock, nanoseconds; default: now",
    )
    add("--truth", metavar="FILE", default="", help="write biases, targets, frames, landing results (.jsonl); "
        "with --set truth_hz=50 also the vehicle")  # fmt: skip
    add("--truth-csv", metavar="FILE", default="", help="write target positions: label, lat, lon, alt_amsl, time_unix")
    add(
        "--record",
        metavar="DIR",
        default="",
        help="write the whole flight to files, as fast as it can be computed, without a link",
    )
    add("--serve", action="store_true", help="fly one flight after the other: requests on stdin, flights on stdout; "
        "the format is in sitl_mock/service.py")  # fmt: skip
    return parser


if __name__ == "__main__":
    sys.exit(main())
