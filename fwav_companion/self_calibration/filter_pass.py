"""One pass over measurements: joint filters that are updated batch by batch, and the quality of their fit."""

from __future__ import annotations

from collections.abc import Collection, Sequence
from functools import cached_property

import msgspec
import numpy as np

from fwav_companion.self_calibration.arrays import Array, Mask
from fwav_companion.self_calibration.baseline import Baseline
from fwav_companion.self_calibration.innovation_consistency import InnovationConsistency
from fwav_companion.self_calibration.joint_filter import GATE, MOST_DISPLACED, JointFilter
from fwav_companion.self_calibration.measurement_batch import MeasurementBatch, joined
from fwav_companion.self_calibration.pixel_innovations import innovations
from fwav_companion.self_calibration.pixel_measurement import SHARED_COUNT, PixelInnovations, camera_pose
from fwav_companion.self_calibration.position_error import QUICK, SMOOTH
from fwav_companion.types import Bias

FIRST_MEASUREMENTS = 8
"""Measurements before a target joins the estimate: its linearization point is their median, because a single first
measurement is noisy and perhaps shallow."""
FIRST_PHOTOGRAPHS, PHOTOGRAPHED_NS = 3, 1_500_000_000
"""Measurements before a target is added if they span this time, ns: on photographs, eight measurements would span a
minute, in which the position wanders."""
PHOTOGRAPH_NS = 500_000_000
"""Mean interval of frames from which they are photographs, ns."""
WORST = 25.0
"""Largest normalised innovation squared that a measurement is charged with in the score."""

SMOOTH_MARGIN = 5.0
"""Log-likelihood ratio from which the vehicle's position is believed to wander smoothly."""


class FilterPass(msgspec.Struct, frozen=True, dict=True):
    """A pass in progress: joint estimates, one for each hypothesis (B), and statistics of their fit. Immutable."""

    joint: JointFilter
    score: Array
    """(B), log-likelihood up to a constant."""
    score_variance: Array
    """(B), variance of the score's difference from another delay at which the vehicle moves alike; only in a search."""
    used: Array
    """(B), number of measurements inside the gate."""
    refused: Array
    """(B), number of measurements outside the gate."""
    hints: dict[int, Array] = {}
    """(B, 2) linearization points of targets from an earlier pass, by track."""
    waiting: dict[int, tuple[MeasurementBatch, ...]] = {}
    """Measurements of targets that are not in the estimate yet, by track."""
    frames: int = 0
    """Frames so far."""
    sights: int = 0
    """Measurements so far."""
    first_ns: int | None = None
    last_ns: int = 0
    """Captures of the first and of the newest batch, host clock."""
    baseline: Baseline = Baseline()
    drift: InnovationConsistency | None = None
    """Consistency of the used innovations; None in a search, where the linearization point does not follow the mean."""

    @property
    def fits(self) -> Mask:
        """(B), whether most measurements agree with the estimate."""
        return self.refused <= np.maximum(FIRST_MEASUREMENTS, self.used // 2)

    @property
    def chosen(self) -> int:
        """Index of the hypothesis of the position's wander: QUICK, the wider one, until SMOOTH is much likelier."""
        return int(len(self.score) == 2 and self.score[SMOOTH] > self.score[QUICK] + SMOOTH_MARGIN)

    @property
    def wanders_quickly(self) -> bool:
        """Whether the vehicle's position is known not to wander smoothly."""
        return len(self.score) == 2 and bool(self.score[QUICK] > self.score[SMOOTH] + SMOOTH_MARGIN)

    @cached_property
    def best(self) -> JointFilter:
        """The joint estimate under the chosen hypothesis, copied once for the gates and the report of a frame."""
        return self.joint if len(self.score) == 1 else self.joint.take([self.chosen])

    @property
    def photographs(self) -> bool:
        """Whether frames are so slow that each has telemetry samples, and motion, of its own."""
        spanned_ns = self.last_ns - (self.first_ns or 0)
        return self.frames > 1 and spanned_ns >= PHOTOGRAPH_NS * (self.frames - 1)

    def take(self, hypotheses: Sequence[int]) -> FilterPass:
        """The pass with some of the hypotheses."""
        i = list(hypotheses)
        return msgspec.structs.replace(
            self,
            joint=self.joint.take(i),
            score=self.score[i],
            score_variance=self.score_variance[i],
            used=self.used[i],
            refused=self.refused[i],
            hints={track: hint[i] for track, hint in self.hints.items()},
        )

    def without(self, tracks: Collection[int]) -> FilterPass:
        """The pass without some targets. Their contribution to the shared parameters stays."""
        joint = self.joint
        for track in sorted(tracks):
            joint = joint.without(track)
        waiting = {track: batches for track, batches in self.waiting.items() if track not in tracks}
        return msgspec.structs.replace(self, joint=joint, waiting=waiting)

    def predicted(self, host_ns: int) -> FilterPass:
        """The pass predicted to a later instant."""
        joint = self.joint.predict(host_ns)
        return self if joint is self.joint else msgspec.structs.replace(self, joint=joint)

    def fed(self, batch: MeasurementBatch) -> FilterPass:
        """The pass after one more batch."""
        baseline, joint = self.baseline.with_batch(batch), self.joint.predict(batch.host_ns)
        if not joint.shows_height and baseline.shows_height(joint.priors.sigma(Bias.POSITION_NORTH)):
            joint = msgspec.structs.replace(joint, shows_height=True)
        after = msgspec.structs.replace(
            self,
            joint=joint,
            baseline=baseline,
            frames=self.frames + batch.frames,
            sights=self.sights + len(batch.tracks),
            first_ns=batch.host_ns if self.first_ns is None else self.first_ns,
            last_ns=batch.host_ns,
        )
        known = [k for k, track in enumerate(batch.tracks) if track in self.joint.tracks]
        if known:
            after = after._updated(batch if len(known) == len(batch.tracks) else batch.take(known))
        for track in dict.fromkeys(batch.tracks):
            if track not in self.joint.tracks:
                after = after._waited(track, batch.take([k for k, each in enumerate(batch.tracks) if each == track]))
        return after

    def _waited(self, track: int, new: MeasurementBatch) -> FilterPass:
        own = (*self.waiting.get(track, ()), new)
        sparse = own[-1].host_ns - own[0].host_ns >= PHOTOGRAPHED_NS
        needed = FIRST_PHOTOGRAPHS if sparse else FIRST_MEASUREMENTS
        if sum(len(batch.tracks) for batch in own) < needed:
            return msgspec.structs.replace(self, waiting=self.waiting | {track: own})
        others = {each: batches for each, batches in self.waiting.items() if each != track}
        return msgspec.structs.replace(self, waiting=others)._begun(track, joined(own))

    def _begun(self, track: int, own: MeasurementBatch) -> FilterPass:
        """The pass with a new target, updated with all its waiting measurements.

        The measurement nearest to the median is used first and ungated, because any measurement may be a gross error.
        """
        shared = self.joint.linearization_point[:, :SHARED_COUNT]
        points, hits = camera_pose(own, shared).ground_points(own.ray)
        met = np.asarray(hits.any(axis=1))
        if not met.any():
            return self
        middle = median_of(np.moveaxis(points, 1, -1), hits[:, None, :])
        middle = np.where(met[:, None], middle, middle[met.argmax()])
        apart = np.where(hits, np.hypot(*np.moveaxis(points - middle[:, None], -1, 0)), np.inf)
        first = np.arange(len(own.tracks)) == apart.argmin(1)[:, None]
        joint = self.joint.with_target(track, self._hint(track, middle))
        joint, *_ = joint.update((seen := innovations(joint, own)), first & seen.valid)
        return msgspec.structs.replace(self, joint=joint)._updated(own, ~first)

    def _hint(self, track: int, middle: Array) -> Array:
        """(B, 2) linearization point of a new target: its hint, shifted as the points of the other targets are from
        their hints; without a hint, the ``middle`` of its measurements.
        """
        known = [each for each in self.joint.tracks if each in self.hints and self.joint.position.count]
        if track not in self.hints or not known:
            return self.hints.get(track, middle)
        points = self.joint.linearization_point[:, SHARED_COUNT:]
        index = [self.joint.tracks.index(each) for each in known]
        moved = [points[:, 2 * k : 2 * k + 2] - self.hints[each] for k, each in zip(index, known, strict=True)]
        return np.asarray(self.hints[track] + np.mean(moved, 0))

    def _updated(self, batch: MeasurementBatch, wanted: Mask | None = None) -> FilterPass:
        joint, chosen = self.joint if self.drift is None else self.joint.displaced(), self.chosen
        seen = innovations(joint, batch)
        if self.drift is not None and seen.displaced > MOST_DISPLACED:
            joint = joint.relinearized(batch)
            seen = innovations(joint, batch)
        wanted = np.ones_like(seen.valid) if wanted is None else wanted
        fits = (seen.nis < GATE) & wanted
        joint, score, whitened = joint.update(seen, fits)
        refused = wanted & ~fits
        if refused.any():
            # A refused measurement is charged, too, and an impossible one as the worst: it cannot win a search.
            log_det = np.log(np.where(seen.valid, seen.determinant, batch.pixel_sigma.prod(1) ** 2))
            score = score - np.where(refused, 0.5 * (np.minimum(seen.nis, WORST) + log_det), 0.0).sum(1)
        searched = None if self.drift is not None else _score_variance(batch, seen, wanted)
        return msgspec.structs.replace(
            self,
            joint=joint,
            score=self.score + score,
            score_variance=self.score_variance if searched is None else self.score_variance + searched,
            used=self.used + fits.sum(1),
            refused=self.refused + refused.sum(1),
            drift=None if self.drift is None else self.drift.seen(batch.host_ns, whitened[chosen], fits[chosen]),
        )


def filter_pass(joint: JointFilter, hints: dict[int, Array], drift: InnovationConsistency | None = None) -> FilterPass:
    """A pass about a joint estimate, before any measurement."""
    none = np.zeros(len(joint.mean))
    return FilterPass(joint, none, none, none.astype(int), none.astype(int), hints, drift=drift)


def _score_variance(batch: MeasurementBatch, seen: PixelInnovations, wanted: Mask) -> Array:
    """(B), variance of the log-likelihood by which measurements may prefer another instant of the same motion: the
    attitudes reported for that instant are as noisy, but have other errors.
    """
    pixel2 = batch.pixel_sigma**2
    shares = (pixel2 / (pixel2 + (seen.common**2).sum(-1))) ** 2
    return np.asarray(np.where(wanted & seen.valid, 2.0 - shares.sum(-1), 0.0).sum(1))


def median_of(values: Array, valid: Mask) -> Array:
    """Medians over the last axis of the valid entries; the largest float where there are none."""
    ordered = np.sort(np.where(valid, values, np.finfo(float).max), -1)
    count = np.broadcast_to(valid, values.shape).sum(-1, keepdims=True)
    low, high = np.maximum(count - 1, 0) // 2, np.minimum(count // 2, values.shape[-1] - 1)
    pair = np.take_along_axis(ordered, np.concatenate((low, high), -1), -1)
    return np.asarray(0.5 * pair[..., 0] + 0.5 * pair[..., 1])
