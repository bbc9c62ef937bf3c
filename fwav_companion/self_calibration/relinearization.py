"""Passes over the kept measurements: the estimate that is served, and the one that is to follow it.

A measurement is linear only about a point, and the first point is a poor one. So measurements are kept, and passes over
them are repeated, each about the end of the last one (iterated, relinearized estimation: Bell & Cathey 1993). Meanwhile
the last one is served, and takes the new measurements.
"""

from __future__ import annotations

from collections.abc import Collection, Mapping

import msgspec

from fwav_companion.geometry.stamps import NS_PER_S
from fwav_companion.self_calibration.arrays import Array
from fwav_companion.self_calibration.calibration_context import CalibrationContext
from fwav_companion.self_calibration.calibration_report import SharedParameter
from fwav_companion.self_calibration.filter_pass import PHOTOGRAPH_NS, FilterPass
from fwav_companion.self_calibration.measurement_batch import MeasurementBatch
from fwav_companion.self_calibration.pixel_measurement import SHARED_COUNT
from fwav_companion.self_calibration.position_smoother import moved, smoothed_back
from fwav_companion.self_calibration.reassociation import near_places, reassociated

MOST_KEPT = 1200
"""Frames: 40 s at 30 frames/s, 1 megabyte of one target and 5 of ten. They settle the linearization."""
GROWTH, SETTLED_GROWTH = 1.6, 2.0
"""Measurements of each target over those of the last pass, at which another begins, while the mount is not known and
once it is. Linearized 40 sights ago, a figure-eight that is seen for a few seconds at a time showed innovations that
drift by a factor of 3.6, and no mount; linearized at its end it showed 1.7, and the mount."""
ENOUGH = 400
"""Measurements of each target in a pass after which no other begins once the mount is known."""
STEP = 2
"""Batches that a pass, or a trial of the delay search, takes in each frame, so that it overtakes the new ones."""
STEPS_PER_S = 60.0
"""The same between two photographs, for which there is as much time as for frames at 30/s."""


def steps_within(elapsed_ns: int) -> int:
    """Number of kept batches to be taken in a frame, by the time since the one before it."""
    return STEP if elapsed_ns < PHOTOGRAPH_NS else min(MOST_KEPT, int(STEPS_PER_S * elapsed_ns / NS_PER_S))


class Relinearization(msgspec.Struct, frozen=True):
    """The kept frames and the passes over them. Immutable."""

    kept: tuple[MeasurementBatch, ...] = ()
    complete: bool = True
    """Whether every measurement of the live targets is kept."""
    delay_s: float | None = None
    """Delay of the poses of new measurements, once it was found."""
    served: FilterPass | None = None
    coming: FilterPass | None = None
    """Pass in progress, to be served next."""
    cursor: int = 0
    """Kept batches that it has taken."""
    passed: float = 0.0
    """Measurements of each target when the last pass began."""
    tracks: frozenset[int] = frozenset()
    """All tracks in this state."""
    kinds: dict[int, str] = {}
    """Label of each track."""
    point: Array | None = None
    """Linearization point of the pass in progress."""
    places: dict[int, Array] = {}
    """Apparent places (2) about it of targets near to one another."""
    shifts: tuple[Array, ...] = ()
    """Changes (S, 3) of the paths of kept batches by later ones, at the begin of the last pass."""

    def with_batch(self, batch: MeasurementBatch, kinds: Mapping[int, str] | None = None) -> Relinearization:
        """The state after one more batch; when there are too many to keep, the last pass stays. ``kinds``: labels."""
        few = sum(each.frames for each in self.kept) < MOST_KEPT
        keeping = self.complete and (few or self.coming is not None)
        return msgspec.structs.replace(
            self,
            kept=(*self.kept, batch) if keeping else (),
            complete=keeping,
            tracks=self.tracks.union(batch.tracks),
            kinds=self.kinds if kinds is None else {**self.kinds, **kinds},
            served=None if self.served is None else self.served.fed(batch),
        )

    def only(self, alive: Collection[int]) -> Relinearization:
        """The state without the tracks that ended: most were no targets."""
        gone = self.tracks.difference(alive)
        served, coming = self.served, self.coming
        for track in sorted(gone):
            served = None if served is None else served.without(track)
            coming = None if coming is None else coming.without(track)
        left = [batch.without(gone) for batch in self.kept]
        taken = sum(bool(batch.tracks) for batch in left[: self.cursor])
        kept = tuple(batch for batch in left if batch.tracks)
        shifts = tuple(shift for batch, shift in zip(left, self.shifts, strict=False) if batch.tracks)
        return msgspec.structs.replace(
            self,
            served=served,
            coming=coming,
            kept=kept,
            shifts=shifts,
            cursor=taken,
            tracks=self.tracks - gone,
            kinds={track: kind for track, kind in self.kinds.items() if track not in gone},
        )

    def begun(
        self, context: CalibrationContext, point: Array, places: Mapping[int, Array] | None = None
    ) -> Relinearization:
        """The state after the delay was found: kept poses shrink to it, and the first pass begins.

        ``places``: apparent places (2) of the targets, by which measurements are associated again.
        """
        point = point[:SHARED_COUNT]
        kept = tuple([batch.at_delay(float(point[SharedParameter.DELAY])) for batch in self.kept])
        state = msgspec.structs.replace(self, kept=kept)
        return state._beginning(context.served_pass(point), point, places or {}, self.tracks)

    def _beginning(
        self, coming: FilterPass, point: Array, places: Mapping[int, Array], tracks: Collection[int]
    ) -> Relinearization:
        """The state at the begin of a pass about a point, by the measurements of these targets."""
        return msgspec.structs.replace(
            self,
            shifts=tuple(smoothed_back(self.kept)),
            delay_s=float(point[SharedParameter.DELAY]),
            coming=coming,
            cursor=0,
            passed=self._measured_of(tracks),
            point=point,
            places=near_places(places, self.kinds, float(self.kept[-1].drop_m.max())) if self.kept else {},
        )

    def advanced(self, context: CalibrationContext, steps: int = STEP, *, settled: bool = True) -> Relinearization:
        """The state after the next steps of the pass, which is served when it has taken all.

        ``settled``: whether the mount is known, so that passes may be rare.
        """
        coming, cursor = self.coming, self.cursor
        if coming is None:
            return self._begun_again(context, settled=settled)
        for batch in self.kept[cursor : cursor + steps]:
            smooth = moved(batch, self.shifts[cursor]) if cursor < len(self.shifts) else batch
            coming = coming.fed(self._associated(smooth))
            cursor += 1
        if cursor < len(self.kept):
            return msgspec.structs.replace(self, coming=coming, cursor=cursor)
        return msgspec.structs.replace(self, served=coming, coming=None, cursor=0)

    def _associated(self, batch: MeasurementBatch) -> MeasurementBatch:
        return batch if self.point is None else reassociated(batch, self.point, self.places, self.kinds)

    def _measured_of(self, tracks: Collection[int]) -> float:
        """Kept measurements over the number of these targets."""
        return sum(len(batch.tracks) for batch in self.kept) / max(1, len(tracks))

    def _begun_again(self, context: CalibrationContext, *, settled: bool) -> Relinearization:
        if self.served is None or not self.complete or (settled and self.passed >= ENOUGH):
            return self
        joint = self.served.best
        if self._measured_of(joint.tracks) < (SETTLED_GROWTH if settled else GROWTH) * self.passed:
            return self
        point = joint.mean[0, :SHARED_COUNT].copy()
        places = {track: place[0] for track, place in joint.targets.items()}
        return self._beginning(context.served_pass(point, joint.targets), point, places, joint.tracks)
