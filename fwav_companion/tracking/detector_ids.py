"""Evidence of the detector's own track ids: weak, and only as far as places do not contradict it. PURE.

An id says that two detections are one thing. Trackers exchange ids where things meet, begin new ones after a miss, or
give all things one id. So an id never opens or closes a gate: it changes the choice among pairs that the gates accept.

Each track has a trust in its id: twice the log-odds that the id is of its target. It is a filter of two hypotheses, id
kept or exchanged. An exchange is one event in two pairs: each counts half of it. Where two tracks may take two fixes,
the places of each frame add their evidence to the trust or subtract it. So one exchange counts once, not again in each
later frame, and ids that places contradict lose their weight. Where one track alone may take a fix, the place is
certain of its id.
"""

from __future__ import annotations

from collections.abc import Iterable
from math import log
from typing import TypeAlias

import msgspec

KEPT_PRIOR, CHANGED_PRIOR = 4.0, 1.0
"""Beta prior of the probability that an id persists from fix to fix: 0.8 on average, worth five fixes."""
SURVIVED_PRIOR = 9.0
"""Prior number of survived encounters to one exchange. Of 80 drawn encounters 18 had swaps without ids, 2 with ids that
persist, 8 to 14 with ids exchanged in one of five, 18 in every second one. Of 80 others, 13 without ids, 5.9 for each
pair in each frame, as if frames were independent, gave 0, 12 to 14, and 38."""
FIXES_OF_ENCOUNTER = 2.0
"""Number of fixes that count as one survived encounter: the fixes of one are not independent. An exchange counts whole.
Fixes of things apart show nothing about encounters, where trackers exchange ids."""
REMEMBERED = 0.25
"""Share of the fixes over which a track averages after which it still has most of its place: exp(-0.25), 78 %."""
CERTAIN_TRUST = 16.0
"""Largest trust: odds of 3000 to one, as rare as a true fix outside the gate."""
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
    met_kept: float = 0.0
    """Number of the kept ones that another track might have taken."""
    met_changed: float = 0.0
    """Number of the changed ones that another track might have taken."""

    @property
    def persistence(self) -> float:
        """Posterior mean of the probability that an id persists."""
        return (KEPT_PRIOR + self.kept) / (KEPT_PRIOR + CHANGED_PRIOR + self.kept + self.changed)

    @property
    def encounter_persistence(self) -> float:
        """Posterior mean of the probability that an id survives an encounter of two things in one place."""
        kept = SURVIVED_PRIOR + self.met_kept / FIXES_OF_ENCOUNTER
        return min(self.persistence, kept / (kept + CHANGED_PRIOR + self.met_changed))

    def most_trust(self, separation2: float, averaged: float = 1.0) -> float:
        """Largest trust in an id between two detections in one frame.

        ``separation2``: the squared distance of both in sigmas of their noise. A detector's tracker sees the same
        places as we do, so the probability that it exchanges two ids falls as the likelihood of the exchanged places.
        ``averaged``: number of fixes over which the track averages. For a part of as many frames the track remembers
        its place, which can still contradict the id: one frame has only that share of the encounter's risk.
        """
        p = self.encounter_persistence
        if p <= 0.5:
            return 0.0
        return min(CERTAIN_TRUST, 2.0 * log(p / (1.0 - p) * max(1.0, REMEMBERED * averaged)) + separation2)

    def distinguish(self, one: Id, other: Id) -> bool:
        """Whether two ids say that their things are two."""
        return None not in (one, other) and one != other and self.persistence >= DISTINGUISHING

    def after(self, fixes: Iterable[tuple[Id, Id, bool]]) -> IdEvidence:
        """The evidence after the fixes of a frame: id before, id now, and whether another track might take the fix."""
        counts = [0, 0, 0, 0]
        for before, now, met in fixes:
            if before is not None and now is not None:
                counts[before != now] += 1
                counts[2 + (before != now)] += met
        if not (counts[0] or counts[1]):
            return self
        share = 0.5 if self.kept + self.changed > MEMORY else 1.0
        old = (self.kept, self.changed, self.met_kept, self.met_changed)
        return IdEvidence(*(share * before + count for before, count in zip(old, counts, strict=True)))


class IdTrust(msgspec.Struct, frozen=True, gc=False):
    """Trust in the id of a track after a frame with a fix of it."""

    trust: float
    """Twice the log-odds that the id is of the track's target."""
    met: bool
    """Whether another track in the same place might have taken the fix."""


CERTAIN = IdTrust(CERTAIN_TRUST, met=False)
"""The trust in the id of a fix that no other track might have taken."""
NO_IDS = IdEvidence()
"""The evidence before a flight."""
