"""One pass over glimpses: a joint estimate that takes them one by one, and says how well they fit."""

from __future__ import annotations

from math import hypot, log
from statistics import median

import msgspec

from fwav_companion.self_calibration.innovation_consistency import InnovationConsistency
from fwav_companion.self_calibration.joint_filter import GATE, JointFilter
from fwav_companion.self_calibration.pixel_measurement import COMMON_COUNT, PixelMeasurement, camera_pose

FIRST_GLIMPSES = 8
"""A new target waits for so many: its point of linearization is their median, not one noisy, perhaps shallow, first."""
MOST_WAITING = 20 * FIRST_GLIMPSES
WORST = 25.0
"""Squared distance that a glimpse counts at most: what is gross is gross."""


class FilterPass(msgspec.Struct, frozen=True):
    """A joint estimate on its way. Immutable."""

    joint: JointFilter
    hints: dict[int, tuple[float, float]] = {}
    """Where targets are known to stand already, by track: where to linearize."""
    waiting: tuple[PixelMeasurement, ...] = ()
    """Of targets that are not in the estimate yet."""
    score: float = 0.0
    """Log-likelihood, up to a constant."""
    luck: float = 0.0
    """Variance of the score against that of another delay at which the vehicle moves alike (``Innovation``)."""
    used: int = 0
    refused: int = 0
    """Glimpses that did not fit at all."""
    distance2: float = 0.0
    """Sum over the used and refused, each at most WORST; its mean is 2 where all is well."""
    drift: InnovationConsistency | None = None
    """Of the used; None where nobody asks."""

    def fed(self, glimpse: PixelMeasurement) -> FilterPass:
        """With one more glimpse."""
        joint = self.joint.predict(glimpse.host_ns)
        if glimpse.track in joint.tracks:
            return self._taken(joint, glimpse)
        waiting = (*self.waiting, glimpse)[-MOST_WAITING:]
        own = [each for each in waiting if each.track == glimpse.track]
        if len(own) < FIRST_GLIMPSES:
            return msgspec.structs.replace(self, joint=joint, waiting=waiting)
        others = tuple(each for each in waiting if each.track != glimpse.track)
        return msgspec.structs.replace(self, joint=joint, waiting=others)._begun(own)

    @property
    def fits(self) -> bool:
        """Most glimpses agree with it."""
        return self.refused <= max(FIRST_GLIMPSES, self.used // 2)

    def without(self, track: int) -> FilterPass:
        """With a target forgotten; what it taught about the common unknowns stays."""
        waiting = tuple(each for each in self.waiting if each.track != track)
        return msgspec.structs.replace(self, joint=self.joint.without(track), waiting=waiting)

    def _begun(self, own: list[PixelMeasurement]) -> FilterPass:
        """With a target: the glimpse nearest to the middle of all is the first, for any one of them may be gross."""
        common = self.joint.around[:COMMON_COUNT]
        stood = [(camera_pose(glimpse, common).ground_point(glimpse.ray), glimpse) for glimpse in own]
        points = [(point, glimpse) for point, glimpse in stood if point is not None]
        if not points:
            return self
        middle = (median(n for (n, _), _ in points), median(e for (_, e), _ in points))
        at = self.hints.get(own[0].track, middle)
        _, first = min(points, key=lambda each: hypot(each[0][0] - middle[0], each[0][1] - middle[1]))
        joint = self.joint.with_target(first, at)
        if joint is None:
            return self
        fit = msgspec.structs.replace(self, joint=joint)
        for glimpse in own:
            if glimpse is not first:
                fit = fit._taken(fit.joint, glimpse)
        return fit

    def _taken(self, joint: JointFilter, glimpse: PixelMeasurement) -> FilterPass:
        seen = joint.innovation(glimpse.track, glimpse)
        if seen is None:  # charged as the worst there is: what cannot be seen at all must not win a search
            su, sv = glimpse.pixel_sigma
            score = self.score - 0.5 * (WORST + 2.0 * log(su * sv))
            return msgspec.structs.replace(
                self, joint=joint, score=score, refused=self.refused + 1, distance2=self.distance2 + WORST
            )
        fits = seen.distance2 < GATE
        worst = min(seen.distance2, WORST)
        return FilterPass(
            joint.updated(seen) if fits else joint,
            self.hints,
            self.waiting,
            self.score - 0.5 * (worst + log(seen.determinant)),
            self.luck + seen.luck,
            self.used + fits,
            self.refused + (not fits),
            self.distance2 + worst,
            self.drift.seen(glimpse.host_ns, seen, joint.priors) if fits and self.drift is not None else self.drift,
        )
