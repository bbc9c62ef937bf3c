"""SHELL: runs a study to its end, keeps the finished flights, and resumes an interrupted study."""

from __future__ import annotations

import time
from collections.abc import Callable, Iterator, Sequence
from pathlib import Path
from typing import Final, Protocol

import msgspec

from fwav_companion.errors import InputFileError
from fwav_companion.on_disk import made_folder
from fwav_companion.tools.study.cluster import SchedulerLostError, Workers, decoded
from fwav_companion.tools.study.flight_draw import CONFIGURED
from fwav_companion.tools.study.flight_ranking import (
    configured_tasks,
    confirming_flights,
    confirming_tasks,
)
from fwav_companion.tools.study.flight_record import FlightRecord
from fwav_companion.tools.study.flight_worker import FlightWorker, fly_on_worker
from fwav_companion.tools.study.record_file import (
    FILE,
    JOURNAL,
    Environment,
    FlightJournal,
    ordered,
    read_journal,
    read_records,
    write_records,
)
from fwav_companion.tools.study.study_plan import StudyPlan

MANY: Final = 500
"""Flights from which the first one is timed alone, so that the whole time is known before the others begin."""


class StudyProgress(Protocol):
    """Receiver of a study's progress while it runs."""

    def total(self, flights: int) -> None:
        """The number of flights that remain is known."""

    def flown(self) -> None:
        """A flight has finished."""

    def expected(self, seconds: float) -> None:
        """The whole study will take about this long."""


class FinishedStudy(msgspec.Struct, frozen=True, kw_only=True):
    """The flights of a study."""

    plan: StudyPlan
    environment: Environment
    records: list[FlightRecord]
    is_complete: bool
    """False after Ctrl-C, and where the disk was full."""
    trouble: str = ""
    """Why it ended early."""
    flown: int = 0
    """Flights of this run, without those of an earlier one."""
    cpu_s: float = 0.0
    """CPU time of the workers for them, seconds; 0 where it is not known."""


def run_study(
    plan: StudyPlan, out: Path, workers: Workers, progress: StudyProgress, *, resume: bool = False
) -> FinishedStudy:
    """Fly the flights that are missing, and write the file.

    InputFileError if the folder cannot be written, or has flights and ``resume`` is false.
    """
    if not resume:
        _require_no_flights(out)
    known = earlier_records(plan, out) if resume else []
    try:
        made_folder(out)
        journal = _fresh_journal(out, plan, known)
    except OSError as error:
        raise InputFileError(f"{error.filename or out}: {error.strerror}; accepted: a folder to write to") from None
    return StudyRun(plan, workers, progress, known).run(out, journal)


def _require_no_flights(out: Path) -> None:
    """InputFileError if the folder has the flights of an earlier study, which a new one would replace."""
    for path in (out / FILE, out / JOURNAL):
        if path.exists():
            raise InputFileError(f"{path}: flights of an earlier study; accepted: --resume, or another --out")


def earlier_records(plan: StudyPlan, out: Path) -> list[FlightRecord]:
    """The flights that an interrupted study kept in the folder. InputFileError if they belong to another study."""
    records = read_journal(out, plan)
    path = out / FILE
    if path.exists():
        written, earlier, _ = read_records(path)
        if earlier.digest != plan.digest:
            raise InputFileError(
                f"{path}: of another study ({_difference(plan, earlier)}); accepted: the same options as before, or "
                "another --out"
            )
        records += written
    unique = {(record.index, record.arm): record for record in records if record.index < plan.flights}
    return ordered(unique.values())


class StudyRun:
    """One run of a study."""

    def __init__(
        self, plan: StudyPlan, workers: Workers, progress: StudyProgress, known: Sequence[FlightRecord]
    ) -> None:
        self._plan, self._workers, self._progress = plan, workers, progress
        self._records = list(known)
        self._done = {(record.index, record.arm) for record in known}

    def run(self, out: Path, journal: FlightJournal) -> FinishedStudy:
        """Fly, and write the file, also after Ctrl-C and with a full disk."""
        environment, not_written = self._workers.environment, "the study crashed"
        known, cpu_before_s = len(self._records), self._workers.cpu_s()
        try:
            trouble = self._trouble_of(lambda: self._fly_all(journal), journal.path)
            not_written = self._trouble_of(
                lambda: write_records(out / FILE, self._records, self._plan, environment), out / FILE
            )
        finally:
            journal.close(remove=not not_written)
        return FinishedStudy(
            plan=self._plan,
            environment=environment,
            records=ordered(self._records),
            is_complete=not (trouble or not_written),
            trouble=trouble or not_written,
            flown=len(self._records) - known,
            cpu_s=max(0.0, self._workers.cpu_s() - cpu_before_s),
        )

    def _trouble_of(self, work: Callable[[], None], path: Path) -> str:
        """Do the work; returns why it ended early, or an empty string."""
        try:
            work()
        except KeyboardInterrupt:
            return "interrupted"
        except SchedulerLostError as error:
            return str(error)
        except OSError as error:
            return f"{error.filename or path}: {error.strerror}"
        return ""

    def _fly_all(self, journal: FlightJournal) -> None:
        flights = self._plan.flights
        tasks = self._missing(configured_tasks(flights))
        confirming = confirming_flights(self._plan)
        self._progress.total(len(tasks) + confirming)
        if flights >= MANY and tasks:
            self._time_first(tasks[:1], len(tasks) + confirming, journal)
            tasks = tasks[1:]
        self._fly(tasks, journal)
        self._fly(self._missing(confirming_tasks(self._plan, self._records)), journal)

    def _time_first(self, first: list[tuple[int, str]], total: int, journal: FlightJournal) -> None:
        begun = time.monotonic()
        self._fly(first, journal)
        self._progress.expected((time.monotonic() - begun) * total / max(1, self._workers.count))

    def _missing(self, tasks: Sequence[tuple[int, str]]) -> list[tuple[int, str]]:
        return [task for task in tasks if task not in self._done]

    def _fly(self, tasks: Sequence[tuple[int, str]], journal: FlightJournal) -> None:
        for record in self._flown(tasks):
            journal.add(record)
            self._records.append(record)
            self._done.add((record.index, record.arm))
            self._progress.flown()

    def _flown(self, tasks: Sequence[tuple[int, str]]) -> Iterator[FlightRecord]:
        for result in self._workers.run(fly_on_worker, tasks, FlightWorker, (self._plan,)):
            yield decoded(result, FlightRecord)


def _fresh_journal(out: Path, plan: StudyPlan, known: Sequence[FlightRecord]) -> FlightJournal:
    """The journal of this run: continued if its flights are known, else begun."""
    if not known:
        (out / JOURNAL).unlink(missing_ok=True)
    return FlightJournal(out, plan)


def _difference(plan: StudyPlan, earlier: StudyPlan) -> str:
    """The first option in which two studies differ."""
    for name in ("seed", "seconds", "pattern", "preset", "settings", "variations", "config_name", "config", "lens"):
        ours, theirs = getattr(plan, name), getattr(earlier, name)
        if ours != theirs:
            shown = name if name in ("config", "lens", "settings", "variations") else f"{name} {theirs}, not {ours}"
            return f"other {shown}" if shown == name else shown
    return "other options"


def replay_line(plan: StudyPlan, record: FlightRecord) -> str:
    """The command line that flies one flight alone and keeps its recording."""
    arm = "" if record.arm == CONFIGURED else f"/{record.arm}"
    return f"{command_line(plan)} --only {record.index}{arm}"


def command_line(plan: StudyPlan) -> str:
    """The command line of a study, without its size and folder."""
    words = ["fwav-companion study", f"--preset {plan.preset}" if plan.preset else f"--config {plan.config_name}"]
    words += [f"--seed {plan.seed}", f"--pattern {plan.pattern}", f"--seconds {plan.seconds:g}"]
    words += [f"--set {key}={value}" for key, value in plan.settings]
    for each in plan.variations:
        values = f"{each.low:g}:{each.high:g}" if each.is_range else ",".join(map(str, each.choices))
        words.append(f"--vary {each.key}={values}")
    return " ".join(words)
