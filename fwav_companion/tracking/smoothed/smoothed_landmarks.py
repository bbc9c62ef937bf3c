"""Landmarks as the smoother's targets: a track with a landmark's label has the survey as the prior of its place."""

from __future__ import annotations

from collections.abc import Sequence
from math import hypot

import msgspec

from fwav_companion.estimation.estimator import Estimator
from fwav_companion.estimation.ground import TargetPrior
from fwav_companion.types import Landmark, LandmarkRecord, LandmarkSight, LandmarkState

LEFT_OUT_WEIGHT = 0.5
"""Weight of a survey below which the landmark is reported as left out."""


class SurveyedTarget(msgspec.Struct, frozen=True):
    """The track of a landmark."""

    track: int
    used: int
    """Number of sights that were handed to the smoother."""


class SmoothedLandmarks:
    """The configured landmarks, and which track is of which."""

    __slots__ = ("_found", "_landmarks")

    def __init__(self, landmarks: Sequence[Landmark], found: dict[int, SurveyedTarget] | None = None) -> None:
        self._landmarks = tuple(landmarks)
        self._found = dict(found or {})

    def copy(self) -> SmoothedLandmarks:
        """A snapshot."""
        return SmoothedLandmarks(self._landmarks, self._found)

    def add(self, sight: LandmarkSight, track: int, estimator: Estimator) -> None:
        """Take a sight of a confirmed track. Its first one gives the track's target the survey as its prior.

        A later track of the same landmark continues it: one survey is one measurement.
        """
        before = self._found.get(sight.landmark)
        if before is None or before.track != track:
            prior = self._prior(sight)
            if prior is None:
                return
            if before is not None:
                estimator.rename(before.track, track)
            estimator.targets[track] = prior
        self._found[sight.landmark] = SurveyedTarget(track, 1 + (0 if before is None else before.used))

    def _prior(self, sight: LandmarkSight) -> TargetPrior | None:
        """The survey, its height above home by the camera's two heights; None without one of them."""
        sighting, sigma_m = sight.fix.sighting, self._landmarks[sight.landmark].sigma_m
        if sighting.camera_height_above_home_m is None:
            return None
        height_m = sighting.camera_height_above_home_m - sight.fix.drop_m
        return TargetPrior((sight.north_m, sight.east_m), sigma_m, height_m, hypot(sigma_m, sighting.anchor_sigma_m))

    def records(self, estimator: Estimator) -> tuple[LandmarkRecord, ...]:
        """The record of each landmark."""
        return tuple(self._record(index, landmark.label, estimator) for index, landmark in enumerate(self._landmarks))

    def _record(self, index: int, label: str, estimator: Estimator) -> LandmarkRecord:
        found, estimate = self._found.get(index), estimator.estimate
        if found is None or found.track not in estimate.targets:
            return LandmarkRecord(label)
        if estimate.surveys.get(found.track, 1.0) >= LEFT_OUT_WEIGHT:
            return LandmarkRecord(label, LandmarkState.USED, found.used)
        place, survey = estimate.targets[found.track], estimator.targets[found.track].place
        off_m = hypot(float(place[0]) - survey[0], float(place[1]) - survey[1])
        return LandmarkRecord(label, LandmarkState.LEFT_OUT, 0, found.used, off_m)
