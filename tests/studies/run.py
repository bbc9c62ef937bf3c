"""Flies studies over random configurations, and keeps the flights whose claims are wrong beyond 99.9 %.

``python tests/studies/run.py --flights 2000 --seed 1 --out studies-out``. Each flight has a configuration of its own,
drawn within what users set. A kept flight has its configuration, its lens and the command line that flies it alone; one
in a thousand is chance. ``flights.jsonl`` has a line for each flight; a run with the same folder goes on behind it.
"""

from __future__ import annotations

import argparse
import json
import sys
from collections import Counter
from math import log
from pathlib import Path
from typing import Any

sys.path.insert(0, str(Path(__file__).parents[2]))

from fwav_companion.cli.study_single import camera_text
from fwav_companion.recording.error_statistics import wilson
from fwav_companion.tools.study.engine import command_line
from fwav_companion.tools.study.flight_draw import CONFIGURED, draw_flight
from fwav_companion.tools.study.flight_record import FlightRecord
from fwav_companion.tools.study.mock_process import MockError, MockProcess
from fwav_companion.tools.study.study_flight import fly_one, record_of
from fwav_companion.tools.study.study_plan import StudyPlan
from tests.studies.drawn_configurations import drawn_plan

LEVELS = (0.5, 0.9, 0.95, 0.999)
LINES = "flights.jsonl"


def main() -> int:
    """Fly, keep what is wrong, and print the shares of claims that hold."""
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("--flights", type=int, default=2000)
    parser.add_argument("--seed", type=int, default=1)
    parser.add_argument("--only", type=int, default=None, metavar="INDEX", help="fly one flight again")
    parser.add_argument("--out", type=Path, default=Path("studies-out"))
    arguments = parser.parse_args()
    arguments.out.mkdir(parents=True, exist_ok=True)
    path = arguments.out / LINES
    before = [] if arguments.only is not None else _lines_of(path)
    first = arguments.only if arguments.only is not None else len(before)
    last = first + 1 if arguments.only is not None else arguments.flights
    with MockProcess() as mock, path.open("a") as file:
        for index in range(first, last):
            found = flown(drawn_plan(arguments.seed, index), index, mock, arguments.out)
            if arguments.only is None:
                file.write(json.dumps(found) + "\n")
                file.flush()
            before.append(found)
            if found["fault"]:
                print(f"{index}: {found['fault']}: {found['command']}", flush=True)
    for line in summary(before):
        print(line)
    return 0


def flown(plan: StudyPlan, index: int, mock: MockProcess, out: Path) -> dict[str, Any]:
    """The result of one flight; its files are kept where the claim is wrong, or the flight ends in an error."""
    try:
        record = fly_one(plan, index, CONFIGURED, mock.fly)
    except MockError as error:
        return _kept(plan, index, out, fault=f"mock: {error}")
    except Exception as error:  # noqa: BLE001  # every fault is kept, whatever it is
        return _kept(plan, index, out, fault=f"{type(error).__name__}: {error}")
    found = _result(plan, record)
    if not record.is_wrong:
        return found
    return found | _kept(plan, index, out, fault=f"{_words(record)}; {_without_false_ones(plan, index, mock)}")


def _without_false_ones(plan: StudyPlan, index: int, mock: MockProcess) -> str:
    """The same flight without false detections: a claim holds for the target that was associated, if it is it."""
    draw = draw_flight(plan, index)
    request = {**draw.request, "set": {**draw.request["set"], "camera.clutter": 0.0}}
    record = record_of(draw, plan, mock.fly(request))
    return "without false detections " + ("no answer" if record.normalised2 is None else f"{record.normalised2:.4g}")


def _result(plan: StudyPlan, record: FlightRecord) -> dict[str, Any]:
    config = plan.parsed(plan.claim_settings())
    return {
        "index": record.index,
        "pattern": plan.pattern,
        "filter": f"{config.tracking.filter} {config.tracking.motion}",
        "self_calibration": record.calibration,
        "state": record.state,
        "no_answer": record.no_answer,
        "error_m": record.error_m,
        "claimed95_m": record.claimed95_m,
        "normalised2": record.normalised2,
        "fault": "",
    }


def _words(record: FlightRecord) -> str:
    return f"{record.error_m:.3g} m off, claimed {record.claimed95_m:.3g} m, normalised square {record.normalised2:.4g}"


def _kept(plan: StudyPlan, index: int, out: Path, *, fault: str) -> dict[str, Any]:
    """The files of a fault, and the line that flies it alone."""
    (out / plan.config_name).write_text(plan.config)
    (out / f"camera-{index}.yaml").write_text(camera_text(plan.lens))
    line = command_line(plan).replace(plan.config_name, str(out / plan.config_name))
    return {"index": index, "fault": fault, "command": f"{line} --only {index}"}


def _lines_of(path: Path) -> list[dict[str, Any]]:
    return [json.loads(line) for line in path.read_text().splitlines()] if path.exists() else []


def summary(found: list[dict[str, Any]]) -> list[str]:
    """Shares of claims that hold, over all flights and by filter."""
    answered = [each for each in found if each.get("normalised2") is not None]
    lines = [f"{len(found)} flights, {len(answered)} with an answer, {sum(bool(each['fault']) for each in found)} kept"]
    reasons = Counter(each["no_answer"] for each in found if each.get("no_answer"))
    lines.append("without an answer: " + ", ".join(f"{reason} {n}" for reason, n in reasons.most_common()))
    groups = {"all": answered}
    for name in ("filter", "pattern", "self_calibration"):
        for each in answered:
            groups.setdefault(f"{name} {each[name] or 'off'}", []).append(each)
    lines += [f"{name}: {_shares(flights)}" for name, flights in groups.items() if flights]
    return lines


def _shares(flights: list[dict[str, Any]]) -> str:
    parts = []
    for level in LEVELS:
        inside = sum(each["normalised2"] <= -2.0 * log(1.0 - level) for each in flights)
        low, high = wilson(inside / len(flights), len(flights))
        parts.append(f"{100 * level:g} %: {inside} ({100 * low:.1f} to {100 * high:.1f} %)")
    return f"{len(flights)} claims; inside {', '.join(parts)}"


if __name__ == "__main__":
    sys.exit(main())
