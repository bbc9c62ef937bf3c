"""Output of a study: progress while it runs, then the answer, and the report."""

from __future__ import annotations

import json
import sys
from pathlib import Path
from types import TracebackType
from typing import Any, Self

from fwav_companion.on_disk import write_page
from fwav_companion.tools.study.answer_text import as_object, lines, sentence, wrong_lines
from fwav_companion.tools.study.conclusions import answer_of
from fwav_companion.tools.study.engine import FinishedStudy, replay_line
from fwav_companion.tools.study.flight_draw import CONFIGURED
from fwav_companion.tools.study.study_page import study_page

REPORT = "report.html"


class ShownProgress:
    """A bar with the time left on a terminal; in a pipe only the expected duration of a long study."""

    def __init__(self, flights: int) -> None:
        self._flights = flights
        self._bar: Any = None
        self._task: Any = None

    def __enter__(self) -> Self:
        if sys.stderr.isatty():
            from rich.console import Console
            from rich.progress import BarColumn, MofNCompleteColumn, Progress, TextColumn, TimeRemainingColumn

            columns = (TextColumn("flights"), BarColumn(), MofNCompleteColumn(), TimeRemainingColumn())
            self._bar = Progress(*columns, console=Console(stderr=True), transient=True)
            self._bar.start()
        return self

    def __exit__(
        self, kind: type[BaseException] | None, error: BaseException | None, traceback: TracebackType | None
    ) -> None:
        if self._bar is not None:
            self._bar.stop()

    def total(self, flights: int) -> None:
        """Show a bar of this number of flights."""
        if self._bar is not None:
            self._task = self._bar.add_task("flights", total=flights)

    def flown(self) -> None:
        """Advance by one flight."""
        if self._bar is not None:
            self._bar.advance(self._task)

    def expected(self, seconds: float) -> None:
        """Print the expected duration."""
        print(f"{self._flights} flights will take about {_duration(seconds)}", file=sys.stderr)


def show_answer(finished: FinishedStudy, out: Path, *, as_json: bool) -> int:
    """Print the answer and write the report; returns 1 if the study ended early."""
    plan, records = finished.plan, finished.records
    if finished.trouble:
        print(f"study: {finished.trouble}; {_kept(finished)}", file=sys.stderr)
    if not any(record.arm == CONFIGURED for record in records):
        return 1
    answer = answer_of(plan, records)
    commands = [replay_line(plan, record) for record in answer.wrong]
    notes = [] if finished.is_complete else [f"The study ended early: {finished.trouble}. {_kept(finished)}."]
    print(sentence(plan, answer))
    print()
    for each in (*lines(plan, answer), *wrong_lines(answer.wrong, commands)):
        print(each)
    if finished.flown and finished.cpu_s:
        print(f"CPU: {finished.cpu_s / finished.flown:.1f} s a flight, {finished.flown} flights flown now")
    page = study_page(plan, records, answer, finished.environment, notes=notes, commands=commands)
    path = write_page(out / REPORT, page)
    print(path)
    if as_json:
        print(json.dumps(as_object(plan, answer, str(path), commands)))
    return 0 if finished.is_complete else 1


def _kept(finished: FinishedStudy) -> str:
    own = sum(record.arm == CONFIGURED for record in finished.records)
    return f"{own} of {finished.plan.flights} flights are kept; --resume goes on, to the same result"


def _duration(seconds: float) -> str:
    if seconds < 120.0:
        return f"{seconds:.0f} s"
    return f"{seconds / 60.0:.0f} min" if seconds < 7200.0 else f"{seconds / 3600.0:.1f} h"
