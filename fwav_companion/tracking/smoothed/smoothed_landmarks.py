"""Landmarks as the smoother's targets: a track with a landmark's label has the survey as the prior of its place."""

from __future__ import annotations

from collections.abc import Container, Sequence
from math import hypot

import msgspec
import numpy as np

from fwav_companion.estimation.estimator import Estimator
from fwav_companion.estimation.ground import TargetPrior
from fwav_companion.tracking.smoothed.flight_ground import surface_of
from fwav_companion.types import (
    GroundReference,
    HeightReference,
    Landmark,
    LandmarkAltitude,
    LandmarkRecord,
    LandmarkSight,
    LandmarkState,
)

ALTITUDE_SHARE = 2.0
"""Ratio of one sigma of the receiver's altitude above sea level to that of its horizontal position: 1.5 to 2. The
height above home is barometric, and does not know it."""
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

    @property
    def tracks(self) -> frozenset[int]:
        """Tracks whose place has a survey as its prior."""
        return frozenset(found.track for found in self._found.values())

    def add(
        self, sight: LandmarkSight, track: int, estimator: Estimator, reference: GroundReference,
        others: Container[int] = (),
    ) -> None:  # fmt: skip
        """Take a sight of a confirmed track, which gives the track's target the survey as its prior.

        A later track of the same landmark continues it: one survey is one measurement. While the earlier one is among
        the live tracks ``others``, two things have the landmark's label, and the second one waits without the survey.
        """
        before = self._found.get(sight.landmark)
        if before is not None and before.track != track:
            if before.track in others:
                return
            estimator.rename(before.track, track)
        estimator.targets[track] = self._prior(sight, reference, estimator.model.noise.position_wander_m)
        self._found[sight.landmark] = SurveyedTarget(track, 1 + (0 if before is None else before.used))

    def _prior(self, sight: LandmarkSight, reference: GroundReference, receiver_m: float) -> TargetPrior:
        """The survey, its height above the ground's surface by both altitudes, that of the vehicle by its receiver.

        Where heights count from the ground itself, a landmark lies on it: its altitude says nothing of them.
        ``receiver_m``: one sigma of the receiver's horizontal position, metres an axis.
        """
        sighting, sigma_m = sight.fix.sighting, self._landmarks[sight.landmark].sigma_m
        height_m, height_sigma_m = sighting.anchor_height_m, hypot(sigma_m, sighting.anchor_sigma_m)
        place = (sight.north_m, sight.east_m)
        if reference.height is HeightReference.ALTITUDE:
            ground, _ = surface_of(reference).height(np.array(place)[:, None])
            height_m = -sighting.camera_ned[2] - sight.fix.height_above_target_m - float(ground[0])
            height_sigma_m = hypot(height_sigma_m, ALTITUDE_SHARE * receiver_m)
        return TargetPrior(place, sigma_m, height_m, height_sigma_m)

    def altitude(self, estimator: Estimator, reference: GroundReference) -> LandmarkAltitude | None:
        """Error of the vehicle's altitude above sea level by the used landmark that shows it best; None without one.

        It is by how much the landmark is higher above the ground's surface than both altitudes say. The prior is
        removed with its information, because the error of an altitude may be more than twice that of the place.
        """
        live, counts = estimator.live, reference.height is HeightReference.ALTITUDE
        if live is None or not counts:
            return None
        shown = []
        for index, found in self._found.items():
            if estimator.estimate.surveys.get(found.track, 0.0) < LEFT_OUT_WEIGHT or found.track not in live:
                continue
            prior, (mean, covariance) = estimator.targets[found.track], live.place(found.track)
            before, after = prior.height_sigma_m**2, float(covariance[2, 2])
            if after < before:
                variance = 1.0 / (1.0 / after - 1.0 / before)
                shown.append((variance, index, (float(mean[2]) - prior.height_m) * variance / after))
        if not shown:
            return None
        variance, index, too_high_m = min(shown)
        return LandmarkAltitude(index, too_high_m, hypot(variance**0.5, self._landmarks[index].sigma_m))

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
