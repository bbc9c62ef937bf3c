"""Passes over what was glimpsed: the estimate that is served, and the one that is to follow it.

A glimpse is linear only about a point, and the first point is a poor one. So glimpses are kept, and passes over them
are repeated, each about where the last one ended. Meanwhile the last one is served, and fed with what goes on coming.
"""

from __future__ import annotations

from collections.abc import Collection

import msgspec

from fwav_companion.self_calibration.calibration_context import CalibrationContext
from fwav_companion.self_calibration.delayed_poses import DelayedPoses
from fwav_companion.self_calibration.filter_pass import FilterPass
from fwav_companion.self_calibration.pixel_measurement import COMMON_COUNT, PixelMeasurement, SharedParameter

MOST_KEPT = 1200
"""Glimpses, a megabyte: 40 s of one target at 30 frames/s. They settle the linearization."""
PASSES_AT = (60, 120, 240, 480)
"""Glimpses kept of each target, at which a new pass is begun."""
STEP = 8
"""Glimpses a frame, beside two for each target, so that a pass overtakes what goes on coming."""


class Relinearization(msgspec.Struct, frozen=True):
    """The glimpses that are kept and the passes over them. Immutable."""

    kept: tuple[PixelMeasurement, ...] = ()
    complete: bool = True
    """All that was seen of the targets there are is kept."""
    delay_s: float | None = None
    """About which glimpses are taken, once it was found."""
    served: FilterPass | None = None
    coming: FilterPass | None = None
    """On its way to be served."""
    cursor: int = 0
    """How many of the kept glimpses that has taken."""
    done: int = 0
    """Passes begun after the first."""

    def with_glimpse(self, glimpse: PixelMeasurement) -> Relinearization:
        """With one more; when there are too many to keep, the last pass stays."""
        keeping = self.complete and (len(self.kept) < MOST_KEPT or self.coming is not None)
        return msgspec.structs.replace(
            self,
            kept=(*self.kept, glimpse) if keeping else (),
            complete=keeping,
            served=None if self.served is None else self.served.fed(glimpse),
        )

    def only(self, alive: Collection[int]) -> Relinearization:
        """Tracks that ended leave the estimates, and their glimpses the passes: most were no targets."""
        gone = self.gone(alive)
        served, coming = self.served, self.coming
        for track in sorted(gone):
            served = None if served is None else served.without(track)
            coming = None if coming is None else coming.without(track)
        taken = sum(glimpse.track not in gone for glimpse in self.kept[: self.cursor])
        kept = tuple(glimpse for glimpse in self.kept if glimpse.track not in gone)
        return msgspec.structs.replace(self, served=served, coming=coming, kept=kept, cursor=taken)

    def gone(self, alive: Collection[int]) -> set[int]:
        """The tracks in all this that are no more."""
        gone = {glimpse.track for glimpse in self.kept}.difference(alive)
        return gone if self.served is None else gone | set(self.served.joint.tracks).difference(alive)

    def begun(self, shop: CalibrationContext, around: tuple[float, ...]) -> Relinearization:
        """The delay is settled enough: glimpses shrink to it, and the first pass begins."""
        around, delay_s = around[:COMMON_COUNT], around[SharedParameter.DELAY]
        kept = tuple(
            msgspec.structs.replace(glimpse, course=DelayedPoses((glimpse.course.at(delay_s),)))
            for glimpse in self.kept
        )
        return msgspec.structs.replace(self, kept=kept, delay_s=delay_s, coming=shop.fit(around), cursor=0)

    def advanced(self, shop: CalibrationContext) -> Relinearization:
        """A few glimpses further with the pass; served when it has them all."""
        coming, cursor = self.coming, self.cursor
        if coming is None:
            return self._begun_again(shop)
        step = STEP + 2 * len(coming.joint.tracks)
        for glimpse in self.kept[cursor : cursor + step]:
            coming = coming.fed(glimpse)
        cursor += step
        if cursor < len(self.kept):
            return msgspec.structs.replace(self, coming=coming, cursor=cursor)
        return msgspec.structs.replace(self, served=coming, coming=None, cursor=0)

    def _begun_again(self, shop: CalibrationContext) -> Relinearization:
        if self.served is None or not self.complete or self.done >= len(PASSES_AT):
            return self
        joint = self.served.joint
        if len(self.kept) < PASSES_AT[self.done] * max(1, len(joint.tracks)):
            return self
        around = (*joint.mean[: SharedParameter.NORTH], 0.0, 0.0)
        coming = shop.fit(around, hints=joint.places)
        return msgspec.structs.replace(self, coming=coming, cursor=0, done=self.done + 1, delay_s=around[0])
