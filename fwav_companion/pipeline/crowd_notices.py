"""Notices of labels whose new tracks wait, because most of their detections fit no track. Pure."""

from __future__ import annotations

from fwav_companion.tracking.crowd import Crowd
from fwav_companion.types import Notice, NoticeCode, Severity


class CrowdNotices:
    """Reports each label once a flight."""

    def __init__(self) -> None:
        self._reported: set[str] = set()

    def notices(self, crowd: Crowd) -> list[Notice]:
        """A notice of each label that waits for the first time."""
        waiting = [label for label in crowd.labels if crowd.is_crowded(label) and label not in self._reported]
        self._reported.update(waiting)
        return [
            Notice(
                NoticeCode.CROWDED, Severity.WARNING, _text(label, crowd.labels[label].mean_unclaimed), to_ground=True
            )
            for label in waiting
        ]


def _text(label: str, per_frame: float) -> str:
    shown = f'"{label}"' if label else "no label"
    return (
        f"{per_frame:.0f} detections a frame of {shown} fit no track: new ones wait for their confirmation; raise the"
        " detector's threshold or [detections] min_score"
    )
