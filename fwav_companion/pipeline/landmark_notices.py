"""Reports of landmarks: a notice when one is used, left out, or not applied, once each, and the status. Pure."""

from __future__ import annotations

from collections.abc import Sequence

from fwav_companion.types import LandmarkRecord, LandmarkState, Notice, NoticeCode, Severity
from fwav_companion.types.flight_status import LandmarkReport

FEWEST = 5
"""Number of used sights from which a landmark is reported as used."""
NOT_APPLIED = (
    'landmarks are not used: they correct by [tracking] filter = "kalman" alone, where no target has motion = "moving"'
)


class LandmarkNotices:
    """Makes the notices about landmarks, each once."""

    def __init__(self) -> None:
        self._reported: set[tuple[str, LandmarkState]] = set()
        self._contradicting: set[str] = set()
        self._said_unapplied = False

    def notices(self, records: Sequence[LandmarkRecord]) -> tuple[Notice, ...]:
        """Notices of landmarks that are used, left out, or in contradiction, and one where the filter uses none."""
        if not self._said_unapplied and any(record.state is LandmarkState.NOT_APPLIED for record in records):
            self._said_unapplied = True
            return (Notice(NoticeCode.LANDMARKS_NOT_APPLIED, Severity.WARNING, NOT_APPLIED),)
        contradicting = [record for record in records if record.contradicts]
        if contradicting and not self._contradicting.issuperset(record.label for record in contradicting):
            self._contradicting.update(record.label for record in contradicting)
            return (_contradiction(contradicting),)
        news = [
            record
            for record in records
            if (record.label, record.state) not in self._reported
            and not record.contradicts
            and (record.state is LandmarkState.LEFT_OUT or record.used >= FEWEST)
        ]
        self._reported.update((record.label, record.state) for record in news)
        return tuple(map(_notice, news))


def landmark_reports(records: Sequence[LandmarkRecord]) -> list[LandmarkReport]:
    """The landmarks' part of the status."""
    return [
        LandmarkReport(
            label=record.label,
            state=record.state.value,
            used=record.used,
            refused=record.refused,
            off_m=record.off_m,
            contradicts=record.contradicts,
        )
        for record in records
    ]


def _contradiction(records: Sequence[LandmarkRecord]) -> Notice:
    labels = sorted({label for record in records for label in (record.label, *record.contradicts)})
    text = f"landmarks {', '.join(labels)} contradict one another: check lat, lon and alt_amsl of each"
    return Notice(NoticeCode.LANDMARKS_CONTRADICT, Severity.WARNING, text, to_ground=True)


def _notice(record: LandmarkRecord) -> Notice:
    if record.state is LandmarkState.LEFT_OUT:
        text = (
            f"landmark {record.label} is left out: it appears {record.off_m:.1f} m from its place, "
            "check its lat, lon and alt_amsl"
        )
        return Notice(NoticeCode.LANDMARK_LEFT_OUT, Severity.WARNING, text, to_ground=True)
    return Notice(NoticeCode.LANDMARK_USED, Severity.INFO, f"landmark {record.label} is seen and used")
