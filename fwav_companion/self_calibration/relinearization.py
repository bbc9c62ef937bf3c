"""Passes over the kept measurements: the pass whose estimate is served, and the one that will replace it.

A measurement is linear only near the linearization point, and the first point is a poor one. So measurements are kept,
and passes over them are repeated, each about the estimate of the pass before (iterated, relinearized estimation: Bell &
Cathey 1993). Meanwhile the last complete pass is served and updated with the new measurements.
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
from fwav_companion.self_calibration.reassociation import near_places, reassociated
from fwav_companion.self_calibration.vehicle_motion import moved, smoothed_back

MOST_KEPT = 1200
"""Most frames that are kept: 40 s at 30 frames/s, 1 megabyte for one target and 5 for ten. They settle the
linearization."""
GROWTH, SETTLED_GROWTH = 1.6, 2.0
"""Kept measurements per target, relative to those of the last pass, at which another pass begins: while the mount is
not known, and once it is. With a linearization point 40 measurements old, a figure-eight whose targets are seen for a
few seconds at a time showed innovations that drift by a factor of 3.6, and no mount; linearized at its end, it showed
1.7, and the mount."""
ENOUGH = 400
"""Measurements per target in a pass, after which no further pass begins once the mount is known."""
STEP = 2
"""Batches that a pass, or a trial of the delay search, uses per frame, so that it catches up with the new batches."""
STEPS_PER_S = 60.0
"""Batches per second that a pass, or a trial, uses between two photographs: as many as with frames at 30/s."""


def steps_within(elapsed_ns: int) -> int:
    """Number of kept batches to be used in a frame, by the time since the previous frame."""
    return STEP if elapsed_ns < PHOTOGRAPH_NS else min(MOST_KEPT, int(STEPS_PER_S * elapsed_ns / NS_PER_S))


class Relinearization(msgspec.Struct, frozen=True):
    """The kept measurements and the passes over them. Immutable."""

    kept: tuple[MeasurementBatch, ...] = ()
    complete: bool = True
    """Whether every measurement of the live targets is kept."""
    delay_s: float | None = None
    """Delay at which the poses of new measurements are taken, s; None until it was found."""
    served: FilterPass | None = None
    """Last complete pass, whose estimate is used."""
    coming: FilterPass | None = None
    """Pass in progress, to be served next."""
    cursor: int = 0
    """Number of kept batches that the pass in progress has used."""
    passed: float = 0.0
    """Kept measurements per target when the last pass began."""
    tracks: frozenset[int] = frozenset()
    """All tracks in this state."""
    kinds: dict[int, str] = {}
    """Label of each track."""
    point: Array | None = None
    """Shared parameters (11) about which the last pass began."""
    places: dict[int, Array] = {}
    """Apparent places (2) at the start of the last pass of the targets near to one another, by track."""
    shifts: tuple[Array, ...] = ()
    """Changes (S, 3) of each kept batch's path by smoothing with later ones, at the start of the last pass, m."""

    def with_batch(self, batch: MeasurementBatch, kinds: Mapping[int, str] | None = None) -> Relinearization:
        """The passes after one more batch; with too many to keep, no further pass begins. ``kinds``: label by track."""
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
        """The passes without the tracks that ended, most of which were clutter."""
        gone = self.tracks.difference(alive)
        left = [batch.without(gone) for batch in self.kept]
        taken = sum(bool(batch.tracks) for batch in left[: self.cursor])
        kept = tuple(batch for batch in left if batch.tracks)
        shifts = tuple(shift for batch, shift in zip(left, self.shifts, strict=False) if batch.tracks)
        return msgspec.structs.replace(
            self,
            served=None if self.served is None else self.served.without(gone),
            coming=None if self.coming is None else self.coming.without(gone),
            kept=kept,
            shifts=shifts,
            cursor=taken,
            tracks=self.tracks - gone,
            kinds={track: kind for track, kind in self.kinds.items() if track not in gone},
        )

    def begun(
        self, context: CalibrationContext, point: Array, places: Mapping[int, Array] | None = None
    ) -> Relinearization:
        """The passes after the delay was found: kept batches reduce to the poses at it, and the first pass begins.

        ``places``: apparent places (2) of the targets, by which measurements are associated again.
        """
        point = point[:SHARED_COUNT]
        kept = tuple([batch.at_delay(float(point[SharedParameter.DELAY])) for batch in self.kept])
        state = msgspec.structs.replace(self, kept=kept)
        return state._beginning(context.served_pass(point), point, places or {}, self.tracks)

    def _beginning(
        self, coming: FilterPass, point: Array, places: Mapping[int, Array], tracks: Collection[int]
    ) -> Relinearization:
        """The passes with a new pass begun about a point. ``tracks``: its targets, to count measurements per target."""
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
        """The passes after the next ``steps`` batches of the pass in progress, which is served once it has used all.

        Without a pass in progress, a new one may begin. ``settled``: whether the mount is known, so that passes are
        rare.
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
        """Kept measurements per target, of these targets."""
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
