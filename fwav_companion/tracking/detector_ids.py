"""Evidence of the detector's own track ids: weak, and only as far as this flight has shown them to persist. PURE.

An id says that two detections are one thing. Trackers swap ids where things cross, begin new ones after a miss, or give
all things one id. So an id never opens or closes a gate: it changes the choice among pairs that the gates accept, by
the log-odds that an id persists from one fix of a track to the next. Only ids that persist keep two tracks apart.
"""

from __future__ import annotations

from collections.abc import Iterable
from math import log
from typing import TypeAlias

import msgspec

KEPT_PRIOR, CHANGED_PRIOR = 4.0, 1.0
"""Beta prior of the probability that an id persists: 0.8 on average, worth five fixes."""
MOST_PERSISTENT = 0.95
"""Bound of that probability: an id is worth 5.9 in units of the NIS at most, a displacement of 2.4 sigmas."""
DISTINGUISHING = 0.9
"""Persistence from which different ids say that two tracks are two things."""
MEMORY = 400.0
"""Number of fixes beyond which older ones count half: ids become unstable where things crowd."""

Id: TypeAlias = int | None


class IdEvidence(msgspec.Struct, frozen=True, gc=False):
    """How often the detector's ids persisted. Immutable."""

    kept: float = 0.0
    """Number of fixes with the id of the track's fix before."""
    changed: float = 0.0
    """Number of fixes with another id than the track's fix before."""

    @property
    def persistence(self) -> float:
        """Posterior mean of the probability that an id persists."""
        mean = (KEPT_PRIOR + self.kept) / (KEPT_PRIOR + CHANGED_PRIOR + self.kept + self.changed)
        return min(MOST_PERSISTENT, mean)

    @property
    def bonus(self) -> float:
        """Reduction of the cost of a pair of equal ids: twice the log-odds that an id persists, at least 0."""
        p = self.persistence
        return max(0.0, 2.0 * log(p / (1.0 - p)))

    def distinguish(self, one: Id, other: Id) -> bool:
        """Whether two ids say that their things are two."""
        return None not in (one, other) and one != other and self.persistence >= DISTINGUISHING

    def after(self, pairs: Iterable[tuple[Id, Id]]) -> IdEvidence:
        """The evidence with the ids of some tracks before a fix, and of their fixes; None: no id."""
        kept = changed = 0
        for before, now in pairs:
            if before is not None and now is not None:
                kept, changed = kept + (before == now), changed + (before != now)
        if not (kept or changed):
            return self
        share = 0.5 if self.kept + self.changed > MEMORY else 1.0
        return IdEvidence(share * self.kept + kept, share * self.changed + changed)


NO_IDS = IdEvidence()
"""The evidence before a flight."""
