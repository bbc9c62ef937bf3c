"""Detections that fit no track: the clutter of a label now, where it is denser than the flight so far has shown.

The flight's own estimate (``detector_model``) is a mean over up to a thousand frames. A detector that begins to fail is
a hundred times worse from one frame to the next, and clutter is confirmed by a density that is a hundred times too low.
A new target fits no track once, in its first frame; clutter goes on. So the detections that fit no track are clutter
but for a few, and where they are most of what no confirmed track took, so is the rest: it fits by chance.
"""

from __future__ import annotations

from collections import Counter
from collections.abc import Mapping, Sequence

import msgspec

from fwav_companion.types import GroundFix

NEW_TARGETS = 3
"""Number of targets that come into view in one frame, or are detected again, without being taken for clutter."""
RECENT = 0.5
"""Weight of the newest frame in the recent numbers, where they fall; they rise at once."""
LASTING = 1.0
"""Mean number that fits no track, beyond which clutter lasts. Below it, one frame in which all fit ends the crowd: ten
targets that come into view together were new for one frame."""
MEAN_S = 1.0
"""Time constant of the slow means, seconds."""
SLOWEST_S = 0.25
"""Frame interval beyond which frames are photographs: each shows other ground, with new targets."""
CROWDED = 32.0
"""Detections a frame that fit no track, from which on new tracks are not confirmed: an eighth of the most that a frame
may have. The threshold of fewer ones is right, and a table of 200 tracks has room for their chains."""
MOST = 0.5
"""Share of a label's detections that fit no track, beyond which the others fit by chance."""


class LabelCrowd(msgspec.Struct, frozen=True, gc=False):
    """Detections a frame of one label that no confirmed track took."""

    unclaimed: float = 0.0
    """Their recent number."""
    unfit: float = 0.0
    """The recent number of those that fit no track."""
    mean_unclaimed: float = 0.0
    mean_unfit: float = 0.0

    def after_frame(self, unclaimed: int, unfit: int, elapsed_s: float) -> LabelCrowd:
        """The numbers after one more frame."""
        share = min(1.0, elapsed_s / MEAN_S)
        mean_unfit = self.mean_unfit + share * (unfit - self.mean_unfit)
        recent = RECENT if mean_unfit > LASTING else 1.0
        return LabelCrowd(
            max(unclaimed, self.unclaimed + recent * (unclaimed - self.unclaimed)),
            max(unfit, self.unfit + recent * (unfit - self.unfit)),
            self.mean_unclaimed + share * (unclaimed - self.mean_unclaimed),
            mean_unfit,
        )

    @property
    def false_per_frame(self) -> float:
        """Number of false detections a frame; not positive where new targets explain all."""
        return (self.unclaimed if self.unfit > MOST * self.unclaimed else self.unfit) - NEW_TARGETS

    @property
    def is_crowded(self) -> bool:
        """Whether most of the detections of the last second fit no track."""
        return self.mean_unfit > max(CROWDED, MOST * self.mean_unclaimed)


class Crowd(msgspec.Struct, frozen=True):
    """The labels of which more detections fit no track than new targets explain. Immutable."""

    labels: Mapping[str, LabelCrowd] = {}

    def false_per_frame(self, label: str) -> float:
        """Number of false detections a frame of this label, where it is known to be high; else at most 0."""
        crowd = self.labels.get(label)
        return 0.0 if crowd is None else crowd.false_per_frame

    def is_crowded(self, label: str) -> bool:
        """Whether new tracks of this label wait for their confirmation."""
        crowd = self.labels.get(label)
        return crowd is not None and crowd.is_crowded

    def after_frame(self, unfit: Sequence[GroundFix], tentative: Sequence[GroundFix], elapsed_s: float | None) -> Crowd:
        """The crowd after one more frame.

        ``unfit``: fixes that no track took. ``tentative``: fixes that tentative tracks took. ``elapsed_s``: time since
        the frame before; None in the first frame, in which nothing can fit.
        """
        if elapsed_s is None or elapsed_s > SLOWEST_S:
            return NO_CROWD
        if not self.labels and len(unfit) <= NEW_TARGETS:
            return self
        new = Counter([fix.sighting.detection.label for fix in unfit])
        fit = Counter([fix.sighting.detection.label for fix in tentative])
        labels = {}
        for label in {*self.labels, *new}:
            before = self.labels.get(label, LabelCrowd())
            after = before.after_frame(new[label] + fit[label], new[label], elapsed_s)
            if after.unfit > NEW_TARGETS or after.mean_unfit > LASTING:
                labels[label] = after
        return Crowd(labels) if labels else NO_CROWD


NO_CROWD = Crowd()
"""Of a detector whose detections fit the tracks."""
