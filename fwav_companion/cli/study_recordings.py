"""``study --recordings DIR``: compares every recorded flight as recorded and under each --set, in pairs."""

from __future__ import annotations

import argparse
import json
import sys
from pathlib import Path

import msgspec

from fwav_companion import __version__
from fwav_companion.cli.study_output import REPORT, ShownProgress
from fwav_companion.errors import UserError
from fwav_companion.on_disk import write_page
from fwav_companion.tools.study.cluster import SchedulerLostError, Workers, WorkersDiedError, decoded, workers
from fwav_companion.tools.study.keys import CLAIM, FLIGHT, TRUTH, parse_setting
from fwav_companion.tools.study.paired_settings import compared
from fwav_companion.tools.study.recorded_flights import RecordedWorker, recorded_flights, replay_on_worker
from fwav_companion.tools.study.setting_record import SettingRecord
from fwav_companion.tools.study.settings_answer import lines, sentence, setting_names, settings_page


def compare_settings(arguments: argparse.Namespace) -> int:
    """Replay, compare, print and write the report; returns the exit status."""
    settings = tuple(tuple(map(_setting, group)) for group in arguments.set)
    if not settings:
        raise UserError("study --recordings: no setting to compare; accepted: one --set KEY=VALUE or more")
    folder = Path(arguments.recordings)
    flights = recorded_flights(folder)
    config = "" if arguments.config is None else str(Path(arguments.config).resolve())
    state = (str(folder.resolve()), config, settings)
    tasks = [(flight, number) for flight in flights for number in range(len(settings) + 1)]
    try:
        with workers(arguments.scheduler, arguments.workers) as flying, ShownProgress(len(tasks)) as progress:
            records = _replayed(flying, tasks, state, progress)
    except WorkersDiedError as error:
        raise UserError(f"study: {error}") from None
    return _answer(arguments, records, setting_names(settings), len(tasks))


def _replayed(
    flying: Workers, tasks: list[tuple[str, int]], state: tuple[object, ...], progress: ShownProgress
) -> list[SettingRecord]:
    """The records of all tasks; after Ctrl-C, of the finished tasks."""
    records: list[SettingRecord] = []
    progress.total(len(tasks))
    try:
        for result in flying.run(replay_on_worker, tasks, RecordedWorker, state):
            records.append(decoded(result, SettingRecord))
            progress.flown()
    except (KeyboardInterrupt, SchedulerLostError) as error:
        why = str(error) or "interrupted"
        print(f"study: {why}; {len(records)} of {len(tasks)} replays are compared", file=sys.stderr)
    return sorted(records, key=lambda record: (record.flight, record.setting))


def _answer(arguments: argparse.Namespace, records: list[SettingRecord], names: list[str], total: int) -> int:
    for flight, damage in {record.flight: record.damage for record in records if record.damage}.items():
        print(f"{flight}: left out: {damage}", file=sys.stderr)
    comparisons = compared(records, len(names) - 1)
    flights = len({record.flight for record in records})
    page = settings_page(comparisons, names, records, arguments.recordings, version=__version__)
    path = write_page(arguments.out / REPORT, page)
    print(sentence(comparisons, names, flights))
    print()
    for each in lines(comparisons, names):
        print(each)
    print(path)
    if arguments.json:
        found = {"settings": names, "comparisons": comparisons, "flights": records, "report": str(path)}
        print(json.dumps(msgspec.to_builtins(found)))
    return 0 if comparisons and len(records) == total else 1


def _setting(text: str) -> str:
    """A --set of a replay. UserError if the key does not exist, or belongs to a simulated flight."""
    key, value = parse_setting(text)
    if key.startswith((FLIGHT, TRUTH, CLAIM)):
        raise UserError(f"--set: {key}: of a simulated flight; accepted with --recordings: a key of the configuration")
    return f"{key}={value}"
