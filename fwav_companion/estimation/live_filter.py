"""Extended Kalman filter between two solves (Jazwinski 1970): shared parameters, targets, the error now.

It starts at every solve's mean and covariance, so its linearisation errors do not add up. The shared parameters are
considered (Schmidt 1966): solves alone estimate them. A frame's derivative by the height or a delay contains the path's
noise, an error in the variables (Fuller 1987) that a recursive update turns into information: in a hover at 1 m the
height moved by 0.9 m in four seconds, claimed to 0.1 m, and every solve moved it back. Targets beyond the first ten are
Schmidt states, too: each has a mean, a covariance and a covariance with the rest, is updated by its own sightings,
moves when the rest moves, and does not teach. The cost is linear in their number. A new target, also one that moves
(``moving``), begins as such a state by its first sighting (``SchmidtTargets``).
"""

from __future__ import annotations

import copy
from collections.abc import Iterator, Sequence, Set
from dataclasses import replace

import numpy as np

from fwav_companion.estimation.errors import POSITION_DELAY, Array, Ints
from fwav_companion.estimation.frame_linearisation import linearise_pairs
from fwav_companion.estimation.frame_poses import FramePoses
from fwav_companion.estimation.frame_prediction import GATE2, FramePrediction, LinearisedPairs, pair_distances
from fwav_companion.estimation.ground import TARGET_SIZE
from fwav_companion.estimation.kept_sightings import Sightings
from fwav_companion.estimation.path_samples import Carrier
from fwav_companion.estimation.problem import BREAK_MARGIN_S, Model, in_solution
from fwav_companion.estimation.schmidt_targets import SchmidtTargets
from fwav_companion.estimation.wander import ErrorAgeing, Wander, jumps

TEACHING = 10  # targets whose sightings update the error and each other
_READING_GAP_S, _READING_GATE2 = 0.3, 9.0  # beyond three sigmas a rangefinder sees something else than the ground


class LiveFilter:
    """State: shared (S), teaching targets (3 each), the delay's curvature (0 or 2), error now (3); others apart."""

    def __init__(
        self, model: Model, carrier: Carrier, wanders: tuple[Wander, Wander], t: float, mean: Array, covariance: Array,
        ids: Ints, *, curved: int = 0,
    ) -> None:  # fmt: skip
        """Mean (n,) and covariance (n, n) of shared, targets in the order of `ids`, error; the first ten teach.

        curved: 2 unknowns before the error, where the delay is too uncertain for its derivative (`linearise`); else 0.
        """
        self.model, self.carrier, self.t = model, carrier, t
        self.size = len(model.priors)
        taught = ids[:TEACHING]
        self.curved, end = curved, np.arange(len(mean) - 3 - curved, len(mean))
        base = np.concatenate([np.arange(self.size + TARGET_SIZE * len(taught)), end])
        self.mean, self.covariance = mean[base], covariance[np.ix_(base, base)]
        self.at = {k: self.size + TARGET_SIZE * i for i, k in enumerate(taught.tolist())}
        self.error = len(base) - 3
        self.errors = np.arange(self.error, self.error + 3)
        others = ids[TEACHING:]
        rows = self.size + TARGET_SIZE * len(taught) + np.arange(TARGET_SIZE * len(others)).reshape(-1, TARGET_SIZE)
        self.others = SchmidtTargets.of_solve(
            others, mean[rows], covariance[rows[:, :, None], rows[:, None, :]], covariance[rows[:, :, None], base]
        )
        self._seen_t = t  # s, of the newest sighting or reading that corrected the error
        self._wander_as(in_solution(wanders, carrier, t))
        self._stepped_s = t  # of the newest step of the report that is taken
        self._reading_t = t  # s, of the newest reading of the rangefinder that is used
        self.surprise, self.used, self.refused = 0.0, 0, 0  # sums since the solve: distance, sightings, gated
        self.version = 0  # grows with every change of means or covariances
        self.poses = FramePoses(carrier, self.mean[: self.size])
        self._frame: tuple[Sightings, LinearisedPairs, FramePrediction] | None = None  # newest, at the present means

    def _wander_as(self, wanders: tuple[Wander, Wander]) -> None:
        self.wanders, self._ageing = wanders, ErrorAgeing(wanders)

    def copy(self) -> LiveFilter:
        """A snapshot that later frames do not change."""
        other = copy.copy(self)
        other.mean, other.covariance, other.others = self.mean.copy(), self.covariance.copy(), self.others.copy()
        other.poses = FramePoses(self.carrier, other.mean[: self.size])
        return other

    def __contains__(self, target: int) -> bool:
        return target in self.at or target in self.others.at

    @property
    def targets(self) -> Ints:
        """Numbers of all targets, teaching ones first."""
        return np.array([*self.at, *self.others.at], np.int64)

    def target_means(self, targets: Ints) -> Array:
        """Means (3, M): north, east, height above the surface."""
        rows = [
            self.mean[self.at[k] : self.at[k] + TARGET_SIZE] if k in self.at else self.others.place(k)
            for k in targets.tolist()
        ]
        return np.array(rows).reshape(-1, TARGET_SIZE).T

    def predict(self, t: float) -> None:
        """Age the error to the time t."""
        if t <= self.t:
            return
        self._frame = None
        e, (keep, added) = self.errors, self.ageing(t)
        if keep.min() < 1.0:
            self._fade(e, keep)
        self.covariance[e, e] += added
        self._change_solution(t)
        self.version += 1
        if self.carrier.path.breaks:
            jump, variance = self.steps(t)
            self.mean[e] += jump
            self.covariance[e, e] += variance
            self._stepped_s = max([b.after for b in self.carrier.path.breaks if b.after <= t], default=self._stepped_s)
        self.others.predict(t - self.t)
        self.t = t

    def _fade(self, errors: Ints, keep: Array) -> None:
        """Multiply errors (k,), and their covariances with everything, by factors (k,)."""
        self.mean[errors] *= keep
        self.covariance[errors] *= keep[:, None]
        self.covariance[:, errors] *= keep
        self.others.cross[:, :, errors] *= keep

    def ageing(self, t: float) -> tuple[Array, Array]:
        """Factor (3,) on the error now and variance (3,) added by the time t, without further sightings."""
        return self._ageing.between(self.t - self._seen_t, max(t, self.t) - self._seen_t)

    def steps(self, t: float) -> tuple[Array, float]:
        """Jump (3,) m of the error until t, and its variance, m^2, by steps of the report that are not taken yet.

        Also such that became known after their instant. The targets stay where they are.
        """
        return jumps(self.carrier.path.breaks, self._stepped_s, t, self.model.noise.position_m)

    def _change_solution(self, t: float) -> None:
        """Go over to the receiver's solution at t: what the best of both has in common stays (`wander.Pieces`)."""
        path = self.carrier.path
        if len(path.accuracies) < 2:
            return
        (before, after), (old, new) = ((x.tolist()) for x in path.accuracy_at(np.array([self.t, t])))
        if before == after:
            return
        common = min(old, new) ** 2
        keep = common / old**2 if old > 0.0 else 1.0
        e = self.errors[:2]
        self._fade(e, np.full(2, keep))
        self.covariance[e, e] += common * (1.0 - keep) + new**2 - common
        self._wander_as((replace(self.wanders[0], sigma_m=new), self.wanders[1]))

    def take_over(self, before: LiveFilter, dropped: Set[int] = frozenset()) -> None:
        """Take over the targets that an earlier filter holds and this one does not, moved by what is now known better.

        Both are at the same instant. dropped: targets that are not wanted any more.
        """
        self._change()
        shared = np.arange(self.size)
        here, there = np.append(shared, self.errors), np.append(shared, before.errors)
        for target in before.targets.tolist():
            if target in self or target in dropped:
                continue
            mean, covariance, cross, moving = before.state(target)
            self.others.take_over(
                target, mean, covariance, cross[:, there], moving=moving,
                before=(before.mean[there], before.covariance[np.ix_(there, there)]),
                after=(self.mean[here], self.covariance[here]), index=here,
            )  # fmt: skip

    def state(self, target: int) -> tuple[Array, Array, Array, bool]:
        """Mean (5,), covariance (5, 5), covariance with the base state (5, n), and whether it moves."""
        if target in self.others.at:
            return self.others.state(target)
        i = slice(self.at[target], self.at[target] + TARGET_SIZE)
        return self.others.padded(self.mean[i], self.covariance[i, i], self.covariance[i])

    def forget(self, target: int) -> None:
        """Delete a target that does not teach, or leave a teaching one to the next solve."""
        self.others.delete(target)
        self._change()

    def rename(self, old: int, new: int) -> None:
        """Give a target another number; one that has the new number is deleted."""
        self._change()
        if old in self.others.at:
            self.others.rename(old, new)
        elif old in self.at:
            self.at = {(new if k == old else k): i for k, i in self.at.items() if k != new}

    def _change(self) -> None:
        self.version += 1
        self._frame = None

    def predict_pairs(self, s: Sightings, detection: Ints, targets: Ints) -> FramePrediction:
        """Innovations of pairs (M,) of a frame's detections and targets. The frame's update uses them again."""
        pairs = linearise_pairs(self, s, detection, targets)
        self._frame = s, pairs, self._innovations(pairs)
        return self._frame[2]

    def _innovations(self, pairs: LinearisedPairs) -> FramePrediction:
        """Innovations at the present means, which have moved little since the pairs were linearised."""
        m = len(pairs.target)
        rows, g = pairs.base.reshape(2 * m, -1), pairs.noise.reshape(2 * m, -1)
        residual = pairs.residual.ravel() - rows @ (self.mean - pairs.mean)
        covariance = rows @ self.covariance @ rows.T + g @ g.T
        covariance.reshape(-1)[:: 2 * m + 1] += 1.0
        others = np.array([i for i, k in enumerate(pairs.target.tolist()) if k in self.others.at], np.int64)
        if len(others):
            moved = self.target_means(pairs.target[others]) - pairs.places[:, others]  # (3, P)
            residual.reshape(2, m)[:, others] -= (pairs.own[..., others] * moved).sum(1)
            self.others.add_innovations(covariance, rows, pairs.target, pairs.own, others, self.covariance)
        distance2, log_det = pair_distances(residual, covariance)
        return FramePrediction(
            pairs.detection, pairs.target, residual, covariance, distance2, log_det, pairs.visible
        )  # fmt: skip

    def replay(self, frames: Sequence[Sightings]) -> None:
        """Take frames that came since the solve's start; their poses are found together."""
        stamps = [float(s.t[0]) for s in frames]
        for t, pose, s in zip(stamps, self.poses.found_together(stamps), frames, strict=True):
            self.poses.hold(t, pose)
            self.update(s, np.arange(len(s)), s.target)

    def update(self, s: Sightings, detection: Ints, targets: Ints) -> None:
        """Take pairs (M,) of one frame's detections and targets; targets that it does not hold are left out."""
        held = np.array([k in self for k in targets.tolist()], np.bool_)
        if not held.all():
            detection, targets = detection[held], targets[held]
        if not len(targets):
            return
        self.predict(float(s.t[0]))
        early, late = self.t - BREAK_MARGIN_S, self.t + BREAK_MARGIN_S
        if any(b.before < late and early < b.after for b in self.carrier.path.breaks):
            return
        self._update_by_range()
        frame, pairs = self._frame, None
        if frame is not None and frame[0] is s:
            pairs = frame[1].of(detection, targets)
        if pairs is None:
            pairs = linearise_pairs(self, s, detection, targets)
        teaches = np.array([k in self.at for k in pairs.target.tolist()], np.bool_)
        for which in (np.flatnonzero(teaches), np.flatnonzero(~teaches)):
            if not len(which):
                continue
            part = pairs if len(which) == len(teaches) else pairs.select(which)
            frame = self._frame
            found = frame[2] if frame is not None and frame[1] is part else self._innovations(part)
            use = np.flatnonzero(found.visible & (found.distance2 < GATE2))
            self.used += len(use)
            self.refused += len(which) - len(use)
            self.surprise += float(found.distance2[use].sum())
            rows = found.rows(use)
            if len(use) and teaches[which[0]]:
                h = part.base.reshape(-1, len(self.mean))[rows]
                self._correct(h, found.covariance[rows[:, None], rows], found.residual[rows])
            elif len(use):
                self._update_others(found, part, use)

    def _update_by_range(self) -> None:
        """Take the newest reading of a rangefinder, at most a few in a second: they see the same ground again."""
        found = self.carrier.ranges.newest(self._reading_t + _READING_GAP_S, self.t)
        if found is None:
            return
        reading, foot = found
        self._reading_t = reading.t
        position, velocity, calm = (a[:, 0] for a in self.carrier.path.at(np.array([reading.t])))
        h = np.zeros((1, len(self.mean)))
        h[0, POSITION_DELAY], h[0, self.error + 2] = calm[2], -1.0
        ground, _ = self.model.ground.height(foot[:, None])
        predicted = position[2] + velocity[2] * self.mean[POSITION_DELAY] - self.mean[self.error + 2] - ground[0]
        variance = reading.sigma_m**2 + self.model.noise.roughness_m**2
        s = h @ self.covariance @ h.T + variance
        residual = np.array([reading.height_m - predicted])
        if float(residual[0]) ** 2 < _READING_GATE2 * float(s[0, 0]):
            self._correct(h, s, residual)

    def _correct(self, h: Array, s: Array, r: Array) -> None:
        """Correct by measurements (m,): rows (m, n) of the base state, innovation covariance (m, m), residuals (m,)."""
        self._change()
        self._seen_t = self.t
        carried = self.covariance @ h.T  # (n, m)
        gain = np.linalg.solve(s, carried.T).T
        gain[: self.size] = 0.0
        self.mean = self.mean + gain @ r
        # Joseph's form (Bucy & Joseph 1968) in full: right also for the rows of a gain that were set to zero.
        left = gain @ carried.T
        c = self.covariance - left - left.T + gain @ s @ gain.T
        self.covariance = 0.5 * (c + c.T)
        self.others.follow(h, s, r, carried, gain)

    def _update_others(self, found: FramePrediction, pairs: LinearisedPairs, use: Ints) -> None:
        m = len(found.target)
        self._change()
        for i in use.tolist():
            s, residual = found.covariance[[[i], [i + m]], [i, i + m]], found.residual[[i, i + m]]
            self.others.update(int(found.target[i]), pairs.own[..., i], pairs.base[:, i], s, residual, self.covariance)

    def places(self) -> Iterator[tuple[list[int], Array, Array, Array]]:
        """Of teaching targets and of others: numbers, means (T, k), covariances (T, k, k) and (T, k, n) with the base.

        A state is north, east, height above the surface; of others also the velocity north and east.
        """
        if self.at:
            block = np.array([*self.at.values()], np.int64)[:, None] + np.arange(TARGET_SIZE)
            own = self.covariance[block[:, :, None], block[:, None, :]]
            yield [*self.at], self.mean[block], own, self.covariance[block]
        if self.others.at:
            yield [*self.others.at], self.others.mean.copy(), self.others.covariance.copy(), self.others.cross

    def place(self, target: int) -> tuple[Array, Array]:
        """Mean (3,) and covariance (3, 3) of a target: north, east, height above the surface."""
        mean, covariance, _, _ = self.state(target)
        return mean[:TARGET_SIZE], covariance[:TARGET_SIZE, :TARGET_SIZE]

    def cross(self, target: int) -> Array:
        """Covariance (3, n) of a target with the base state."""
        return np.asarray(self.state(target)[2][:TARGET_SIZE])
