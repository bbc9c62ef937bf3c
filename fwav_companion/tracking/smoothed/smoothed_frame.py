"""One frame of the smoothing tracker: its live filter predicts, gates and begins targets.

A fix beyond the gate of a static target that the frame missed may be its displaced one, of a camera later than its
prior: it begins no track, and the solve decides. One near a missed moving target begins a branch: it may have turned.
"""

from __future__ import annotations

from collections.abc import Callable
from math import inf

import msgspec
import numpy as np

from fwav_companion.estimation.frame_prediction import GATE2
from fwav_companion.estimation.ground import TargetPrior
from fwav_companion.estimation.initiation import begin_target
from fwav_companion.estimation.kept_sightings import Sightings
from fwav_companion.tracking.clutter import clutter
from fwav_companion.tracking.frame_tracks import FrameTracks
from fwav_companion.tracking.lifecycle import are_photographs, is_steady
from fwav_companion.tracking.live_track import LiveTrack, new_track
from fwav_companion.tracking.pair_assignment import FramePairs
from fwav_companion.tracking.smoothed.smoothed_association import frame_pairs, label_pairs
from fwav_companion.tracking.smoothed.smoothed_state import SmoothedState
from fwav_companion.tracking.smoothed.smoothed_target import FrameAnswers, SmoothedTarget
from fwav_companion.types import FrameView, GroundFix

DISPLACED2 = 64.0
"""Squared distance up to which a fix may be one of a missed track that is displaced, by a camera late by three sigmas
more than its prior, or that has turned: a walker who turns around is as far away after three frames at 30 Hz."""


class SmoothedFrame(FrameTracks[LiveTrack]):
    """The tracks of one frame."""

    gate2 = GATE2

    def __init__(
        self, state: SmoothedState, view: FrameView, sights: Sightings | None, answers: FrameAnswers,
        moves: Callable[[str], bool], height: Callable[[GroundFix], tuple[float, float]],
        *, reports_innovations: bool,
    ) -> None:  # fmt: skip
        """``moves``: whether targets of a label may move.

        ``height``: height of a fix's target above the surface, and its one sigma, metres.
        """
        super().__init__(state.tracks, view, state.detector, state.next_id, reports_innovations=reports_innovations)
        self._state, self._sights, self._answers, self._moves, self._height = state, sights, answers, moves, height
        self._pairs: FramePairs | None = None
        self.displaced: dict[int, int] = {}
        """Static tracks without a fix, by the index of a fix beyond their gate that may be theirs: the solve decides,
        whose weights are robust."""
        if state.tracks and sights is not None:
            self._associate(sights)

    def _associate(self, sights: Sightings) -> None:
        state, view, tracks = self._state, self._view, self._tracks
        targets = np.array([track.id for track in tracks], np.int64)
        still = {track: each.number for track, each in state.still.items()}
        prediction = state.estimator.predict(sights, targets, label_pairs(tracks, view.fixes), still)
        steady = {t.id for t in tracks if is_steady(t.life, view.host_ns)}
        pairs = frame_pairs(view.fixes, prediction, steady, clutter(state.detector, view.image_px2))
        self._pairs, self._answers.gates = pairs, pairs.alone
        self._assign(pairs)
        if not are_photographs(state.detector):
            self._find_displaced(pairs)

    def _find_displaced(self, pairs: FramePairs) -> None:
        """Find the fixes that may be displaced ones of confirmed static tracks without a fix, the nearest first.

        A tentative track may have taken such a fix: it is then no evidence of another target.
        """
        confirmed = {track.id for track in self._tracks if track.confirmed}
        missed = {t.id for t in self._tracks if t.confirmed and not t.moving and t.id not in self.taken}
        taken = {took.index for number, took in self.taken.items() if number in confirmed}
        near = sorted(
            (gate.nis, number, fix)
            for (number, fix), gate in pairs.alone.items()
            if number in missed and fix not in taken and GATE2 <= gate.nis < DISPLACED2
        )
        for _, number, fix in near:
            if number in missed and fix not in self.displaced:
                self.displaced[fix] = number
                missed.discard(number)

    def _target(self, track: LiveTrack) -> SmoothedTarget | None:
        return self._answers.target(track)

    def _accepts(self, track: LiveTrack, fix: int) -> bool:
        return self._pairs is not None and self._answers.gate(track.id, fix).nis < GATE2

    def _margin_m(self, track: LiveTrack) -> float:
        return self._answers.displaced_m(track)

    def _is_displaced(self, fix: int) -> bool:
        return fix in self.displaced

    def _is_stray(self, j: int) -> bool:
        return j in self.displaced or super()._is_stray(j)

    def _branched_from(self, fix: int) -> tuple[LiveTrack | None, float]:
        return self._branchings.get(fix) or (self._turned(fix), 0.0)

    def _turned(self, fix: int) -> LiveTrack | None:
        """The moving track, missed by the frame, that may have turned to this fix; the nearest."""
        alone = {} if self._pairs is None else self._pairs.alone
        near = [(alone[t.id, fix].nis, t.id, t) for t in self.missed if t.moving and (t.id, fix) in alone]
        nis, _, track = min(near, default=(inf, 0, None))
        return track if nis < DISPLACED2 else None

    def updated(self) -> list[LiveTrack]:
        """The tracks after the frame's fixes, with the ids of those of one label that it shows: they are not one."""
        tracks, by_label = super().updated(), dict[str, set[int]]()
        for track in tracks:
            if track.fix is not None and track.id > 0 and track.confirmed:
                by_label.setdefault(track.label, set()).add(track.id)
        for k, track in enumerate(tracks):
            together = by_label.get(track.label, set())
            if track.id in together and not track.together >= together:
                tracks[k] = msgspec.structs.replace(track, together=track.together | together)
        return tracks

    def _begin(self, fix: int, number: int, _coasting: LiveTrack | None) -> LiveTrack | None:
        """A tentative track from a fix; None where its ray has no foot at the present calibration."""
        state, seen, sights = self._state, self._view.fixes[fix], self._sights
        live, moving = state.estimator.live, self._moves(seen.sighting.detection.label)
        if live is None or sights is None:
            return None
        height_m, sigma_m = self._height(seen)
        if height_m or sigma_m:
            state.estimator.targets[number] = TargetPrior(height_m=height_m, height_sigma_m=sigma_m)
        own = sights.select(np.array([fix])).with_targets(np.array([number]))
        if not begin_target(live, number, own, moving=moving):
            return None
        state.waiting[number] = ()
        return new_track(number, seen, self._view.host_ns, moving=moving)

    def _renumber(self, branch: LiveTrack, new: int) -> None:
        """Count a branch's sightings as its track's. A moving target goes on as the branch, which opened its velocity;
        a static one is where it was.
        """
        state, old = self._state, branch.id
        live = state.estimator.live
        if live is not None and branch.moving:
            live.forget(new)
            live.rename(old, new)
        state.estimator.rename(old, new)
        if old in state.estimator.targets:
            state.estimator.targets.setdefault(new, state.estimator.targets.pop(old))
        state.waiting[new] = tuple(s.with_targets(np.full(len(s), new)) for s in state.waiting.pop(old, ()))
