"""The notice of solves that were late: the board is overloaded. Pure."""

from __future__ import annotations

from fwav_companion.types import Notice, NoticeCode, Severity
from fwav_companion.types.flight_status import SolveReport

REPORTED_AT = (1, 10, 100, 1000)
"""Numbers of late solves at which they are reported: one may be a chance, ten are not."""


class SolveNotices:
    """Reports late solves, each time that they are ten times as many."""

    def __init__(self) -> None:
        self._reported = 0

    def notices(self, solves: SolveReport) -> list[Notice]:
        """The notice that is due now."""
        due = sum(solves.late >= count for count in REPORTED_AT)
        if due <= self._reported:
            return []
        self._reported = due
        text = (
            f"estimator: {solves.late} of {solves.taken + 1} solves came late, the board is overloaded: targets become"
            " accurate later; reduce the camera's rate or other work"
        )
        return [Notice(NoticeCode.SOLVES_LATE, Severity.WARNING, text)]
