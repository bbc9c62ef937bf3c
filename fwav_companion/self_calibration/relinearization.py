"""Passes over the kept measurements: the estimate that is served, and the one that is to follow it.

A measurement is linear only about a point, and the first point is a poor one. So measurements are kept, and passes over
them are repeated, each about the end of the last one (iterated, relinearized estimation: Bell & Cathey 1993). Meanwhile
the last one is served, and takes the new measurements.
"""

from __future__ import annotations

from collections.abc import Collection, Mapping

import msgspec

from fwav_companion.geometry.stamps import NS_PER_MS, NS_PER_S
from fwav_companion.self_calibration.arrays import Array
from fwav_companion.self_calibration.calibration_context import CalibrationContext
from fwav_companion.self_calibration.calibration_report import SharedParameter
from fwav_companion.self_calibration.filter_pass import PHOTOGRAPH_NS, FilterPass
from fwav_companion.self_calibration.pixel_measurement import SHARED_COUNT, MeasurementBatch, joined
from fwav_companion.self_calibration.position_smoother import moved, smoothed_back
from fwav_companion.self_calibration.reassociation import near_places, reassociated

MOST_KEPT = 1200
"""Frames: 40 s at 30 frames/s, 1 megabyte of one target and 5 of ten. They settle the linearization."""
JOINED_NS, MOST_JOINED = 400 * NS_PER_MS, 64
"""Time and measurements of kept batches that a pass takes as one: an update of a few costs the same as one of many. The
vehicle's position error, if of the quick kind, moves by 0.08 m meanwhile, a third of the noise of one report."""
SERVED_NS, MOST_SERVED = 100 * NS_PER_MS, 36
"""The same of new ones that the served estimate takes: it is as much older."""
PASSES_AT = (60, 120, 240, 480)
"""Measurements kept of each target, at which a new pass begins."""
GROWTH = 1.6
"""Measurements over those of the last pass, at which another begins while the mount is not known. Linearized 40 sights
ago, a figure-eight that is seen for a few seconds at a time showed innovations that drift by a factor of 3.6, and no
mount; linearized at its end it showed 1.7, and the mount."""
STEP = 2
"""Batches that a pass (of joined ones), or a trial of the delay search, takes in each frame, so that it overtakes the
new ones."""
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
    fresh: tuple[MeasurementBatch, ...] = ()
    """Batches that it has not taken yet."""
    coming: FilterPass | None = None
    """Pass in progress, to be served next."""
    cursor: int = 0
    """Kept batches that it has taken."""
    done: int = 0
    """Passes of PASSES_AT begun after the first."""
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
    """Changes (3) of the vehicle's positions of kept batches by later ones, at the begin of the last pass."""

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
            fresh=() if self.served is None else (*self.fresh, batch),
        )

    def serving(self, due_ns: int) -> Relinearization:
        """The state after the served estimate took the new batches, when they are many or begin before ``due_ns``."""
        served, fresh = self.served, self.fresh
        if served is None or not fresh:
            return self
        if due_ns < fresh[0].host_ns + SERVED_NS and sum(len(batch.tracks) for batch in fresh) < MOST_SERVED:
            return self
        return msgspec.structs.replace(self, served=served.fed(joined(fresh)), fresh=())

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
            fresh=tuple(batch for each in self.fresh if (batch := each.without(gone)).tracks),
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
        delay_s = float(point[SharedParameter.DELAY])
        kept = tuple([batch.at_delay(delay_s) for batch in self.kept])
        coming = context.served_pass(point)
        near = self._near(places or {})
        passed = self._measured_of(self.tracks)
        return msgspec.structs.replace(
            self,
            kept=kept,
            shifts=tuple(smoothed_back(kept)),
            delay_s=delay_s,
            coming=coming,
            cursor=0,
            passed=passed,
            point=point,
            places=near,
        )

    def advanced(self, context: CalibrationContext, steps: int = STEP, *, settled: bool = True) -> Relinearization:
        """The state after the next steps of the pass, which is served when it has taken all.

        ``settled``: whether the mount is known, so that passes may be rare.
        """
        coming, cursor = self.coming, self.cursor
        if coming is None:
            return self._begun_again(context, settled=settled)
        for _ in range(steps):
            if near := self._near_in_time(cursor):
                smooth = [moved(b, shift) for b, shift in zip(near, self.shifts[cursor:], strict=False)]
                coming = coming.fed(self._associated(joined([*smooth, *near[len(smooth) :]])))
                cursor += len(near)
        if cursor < len(self.kept):
            return msgspec.structs.replace(self, coming=coming, cursor=cursor)
        return msgspec.structs.replace(self, served=coming, fresh=(), coming=None, cursor=0)

    def _near(self, places: Mapping[int, Array]) -> dict[int, Array]:
        return near_places(places, self.kinds, float(self.kept[-1].drop_m.max())) if self.kept else {}

    def _near_in_time(self, cursor: int) -> list[MeasurementBatch]:
        """The kept batches from ``cursor`` on that a pass takes as one."""
        near = list(self.kept[cursor : cursor + 1])
        count = len(near[0].tracks) if near else 0
        for batch in self.kept[cursor + 1 : cursor + MOST_JOINED]:
            count += len(batch.tracks)
            if count > MOST_JOINED or batch.host_ns - near[0].host_ns > JOINED_NS:
                break
            near.append(batch)
        return near

    def _associated(self, batch: MeasurementBatch) -> MeasurementBatch:
        return batch if self.point is None else reassociated(batch, self.point, self.places, self.kinds)

    def _measured_of(self, tracks: Collection[int]) -> float:
        """Kept measurements over the number of these targets."""
        return sum(len(batch.tracks) for batch in self.kept) / max(1, len(tracks))

    def _begun_again(self, context: CalibrationContext, *, settled: bool) -> Relinearization:
        if self.served is None or not self.complete or (settled and self.done >= len(PASSES_AT)):
            return self
        joint = self.served.best
        measured_each = self._measured_of(joint.tracks)
        planned = self.done < len(PASSES_AT) and measured_each >= PASSES_AT[self.done]
        if not planned and (settled or measured_each < GROWTH * self.passed):
            return self
        point = joint.mean[0, :SHARED_COUNT].copy()
        coming = context.served_pass(point, joint.targets)
        delay_s = float(point[SharedParameter.DELAY])
        places = self._near({track: place[0] for track, place in joint.targets.items()})
        return msgspec.structs.replace(
            self,
            shifts=tuple(smoothed_back(self.kept)),
            coming=coming,
            cursor=0,
            done=self.done + planned,
            passed=measured_each,
            delay_s=delay_s,
            point=point,
            places=places,
        )
