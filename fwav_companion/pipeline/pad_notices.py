"""Pads in the pipeline: their tags joined to one sighting, and a notice about a tag that contradicts its pad. Pure."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from typing import Final, Protocol, TypeAlias

import msgspec

from fwav_companion.geometry.vectors import Vector3
from fwav_companion.pairing import PairedFrame
from fwav_companion.types import Notice, NoticeCode, PadContradiction, Reason, Severity, Sighting

FEWEST: Final = 5
"""Number of pictures in which a tag contradicts its pad, before it is reported."""

CouldSee: TypeAlias = Callable[[Vector3], bool]


class PadJoiner(Protocol):
    """The pads of a flight; :mod:`fwav_companion.pads.pad_sights` has them, in numpy."""

    @property
    def contradictions(self) -> Sequence[PadContradiction]:
        """The tags that are not where their pads have them."""

    def joined(
        self, sightings: Sequence[Sighting]
    ) -> tuple[tuple[Sighting, ...], list[tuple[int, Reason, float | None]]]:
        """The sightings with each pad once, and the detections without a sighting of their own."""

    def could_see(self, could_see: CouldSee) -> CouldSee:
        """Whether a place is in view; that of a pad, whether one of its tags is."""


def with_pads(paired: PairedFrame, pads: PadJoiner) -> PairedFrame:
    """The frame with one sighting of each pad in place of those of its tags."""
    sightings, others = pads.joined(paired.sightings)
    return msgspec.structs.replace(paired, sightings=sightings, refused=(*paired.refused, *others))


class PadNotices:
    """Reports each contradicting tag once."""

    def __init__(self, pads: PadJoiner | None) -> None:
        self._pads = pads
        self._reported: set[tuple[str, str]] = set()

    def notices(self) -> tuple[Notice, ...]:
        """Notices about tags that have contradicted their pads in several pictures."""
        if self._pads is None:
            return ()
        news = [
            each
            for each in self._pads.contradictions
            if each.pictures >= FEWEST and (each.pad, each.tag) not in self._reported
        ]
        self._reported.update((each.pad, each.tag) for each in news)
        return tuple(map(_notice, news))


def _notice(found: PadContradiction) -> Notice:
    if found.off_m > 0.5 * found.corner_off_m:
        text = f"{found.tag} lies {found.off_m:.2f} m from where {found.pad} has it, and is left out: check at_m"
    else:
        text = f"{found.tag} is turned, or of another size than {found.pad} has it, and is left out"
    return Notice(NoticeCode.PAD_CONTRADICTED, Severity.WARNING, text, to_ground=True)
