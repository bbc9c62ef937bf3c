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
import math
from collections.abc import Set
from dataclasses import replace

import numpy as np

from fwav_companion.estimation.errors import CAMERA_DELAY, POSITION_DELAY, READOUT, Array, Ints
from fwav_companion.estimation.frame_prediction import GATE2, FramePrediction, pair_distances
from fwav_companion.estimation.ground import TARGET_SIZE
from fwav_companion.estimation.kept_sightings import Sightings
from fwav_companion.estimation.measurement import Poses, Projection, project
from fwav_companion.estimation.path_samples import Carrier
from fwav_companion.estimation.problem import BREAK_MARGIN_S, Model, attitude_shift, in_solution
from fwav_companion.estimation.schmidt_targets import SchmidtTargets
from fwav_companion.estimation.smoother import common_noise
from fwav_companion.estimation.wander import SHORT_S, Wander, aged, step_variance

TEACHING = 10  # targets whose sightings update the error and each other
_ONE_INSTANT_S = 1e-6
_READING_GAP_S, _READING_GATE2 = 0.3, 9.0  # beyond three sigmas a rangefinder sees something else than the ground
_REACH_SIGMAS = math.sqrt(3.0)  # nodes of the Gauss-Hermite quadrature with three points; each outer one weighs a sixth


class LiveFilter:
    """State: shared (S), teaching targets (3 each), the delay's curvature (0 or 2), error now (3); others apart."""

    def __init__(
        self, model: Model, carrier: Carrier, wanders: tuple[Wander, Wander], t: float, mean: Array, covariance: Array,
        ids: Ints, *, curved: int = 0,
    ) -> None:  # fmt: skip
        """Mean (n,) and covariance (n, n) of shared, targets in the order of `ids`, error; the first ten teach.

        curved: 2 unknowns before the error, where the delay is too uncertain for its derivative (`linearised`); else 0.
        """
        self.model, self.carrier, self.t = model, carrier, t
        self.size = len(model.priors)
        taught = ids[:TEACHING]
        self.curved, end = curved, np.arange(len(mean) - 3 - curved, len(mean))
        base = np.concatenate([np.arange(self.size + TARGET_SIZE * len(taught)), end])
        self.mean, self.covariance = mean[base], covariance[np.ix_(base, base)]
        self.at = {k: self.size + TARGET_SIZE * i for i, k in enumerate(taught.tolist())}
        self.error = len(base) - 3
        self._errors = np.arange(self.error, self.error + 3)
        others = ids[TEACHING:]
        rows = self.size + TARGET_SIZE * len(taught) + np.arange(TARGET_SIZE * len(others)).reshape(-1, TARGET_SIZE)
        self.others = SchmidtTargets.of_solve(
            others, mean[rows], covariance[rows[:, :, None], rows[:, None, :]], covariance[rows[:, :, None], base]
        )
        self._wander_as(in_solution(wanders, carrier, t))
        self._reading_t = t  # s, of the newest reading of the rangefinder that is used
        self.surprise, self.used, self.refused = 0.0, 0, 0  # sums since the solve: distance, sightings, gated
        self.version = 0  # grows with every change of means or covariances
        self._pose: tuple[float, Poses] | None = None

    def _wander_as(self, wanders: tuple[Wander, Wander]) -> None:
        self.wanders = wanders
        level, up = (w.growth() for w in wanders)
        self.growth = np.array([level, level, up])  # m^2/s

    def copy(self) -> LiveFilter:
        """A snapshot that later frames do not change."""
        other = copy.copy(self)
        other.mean, other.covariance, other.others = self.mean.copy(), self.covariance.copy(), self.others.copy()
        return other

    def __contains__(self, target: int) -> bool:
        return target in self.at or target in self.others.at

    @property
    def targets(self) -> Ints:
        """Numbers of all targets, teaching ones first."""
        return np.array([*self.at, *self.others.at], np.int64)

    def pose(self, t: float) -> Poses:
        """The pose of a frame stamped t; all users of the frame share it."""
        if self._pose is None or self._pose[0] != t:
            shared = self.mean[: self.size]
            self._pose = t, self.carrier.pose(t - float(shared[CAMERA_DELAY]), attitude_shift(shared))
        return self._pose[1]

    def poses(self, s: Sightings, detection: Ints, later_s: float = 0.0) -> Poses:
        """Poses of a frame's detections (M,): one pose, or with a rolling shutter that of each detection's row.

        later_s: delay of the camera beyond the estimated one.
        """
        shared = self.mean[: self.size]
        t = s.t - s.row * float(shared[READOUT])
        if t.max() - t.min() < _ONE_INSTANT_S and not later_s:
            return self.pose(float(t[0]))
        t, shift = t - float(shared[CAMERA_DELAY]) - later_s, attitude_shift(shared)
        return self.carrier.poses(t, self.carrier.live_rates(t, shift), shift).take(detection)

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
        keep, added = aged(self.wanders, self.growth, t - self.t)
        e = self._errors
        if t - self.t >= SHORT_S:
            self.mean[e] *= keep
            self.covariance[e] *= keep[:, None]
            self.covariance[:, e] *= keep
            self.others.cross[:, :, e] *= keep
        self.covariance[e, e] += added
        self._change_solution(t)
        self.version += 1
        self.covariance[e, e] += sum(step_variance(b) for b in self.carrier.path.breaks if self.t < b.after <= t)
        self.others.predict(t - self.t)
        self.t = t

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
        e = self._errors[:2]
        self.mean[e] *= keep
        self.covariance[e] *= keep
        self.covariance[:, e] *= keep
        self.others.cross[:, :, e] *= keep
        self.covariance[e, e] += common * (1.0 - keep) + new**2 - common
        self._wander_as((replace(self.wanders[0], sigma_m=new), self.wanders[1]))

    def take_over(self, before: LiveFilter, dropped: Set[int] = frozenset()) -> None:
        """Take over the targets that an earlier filter holds and this one does not, moved by what is now known better.

        Both are at the same instant. dropped: targets that are not wanted any more.
        """
        self.version += 1
        shared = np.arange(self.size)
        here, there = np.append(shared, self._errors), np.append(shared, before._errors)
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
        self.version += 1

    def rename(self, old: int, new: int) -> None:
        """Give a target another number; one that has the new number is deleted."""
        self.version += 1
        if old in self.others.at:
            self.others.rename(old, new)
        elif old in self.at:
            self.at = {(new if k == old else k): i for k, i in self.at.items() if k != new}

    def innovations(self, s: Sightings, detection: Ints, targets: Ints) -> tuple[FramePrediction, Array, Array]:
        """Pairs (M,) of detections and targets; their rows (2 M, n) of the base state, and (2, 3, M) of the targets."""
        m, mean = len(targets), self.target_means(targets)
        ground, slope = self.model.ground.height(mean[:2])
        point = np.stack([mean[0], mean[1], mean[2] + ground])
        found, h = self.linearised(s, detection, point)
        h = h.swapaxes(1, 2)  # (2, M, n)
        own = found.point.copy()
        own[:, :2] += found.point[:, 2:] * slope
        for i, k in enumerate(targets.tolist()):
            if k in self.at:
                h[:, i, self.at[k] : self.at[k] + TARGET_SIZE] = own[..., i]
        rows = h.reshape(2 * m, -1)
        own_noise = None if s.own_noise is None else s.own_noise.take(detection, -1)
        g = common_noise(found, self.model.noise, own_noise).swapaxes(1, 2).reshape(2 * m, -1)
        covariance = rows @ self.covariance @ rows.T + g @ g.T
        if own_noise is not None:
            place = (found.point * own_noise[[1, 1, 2]]).swapaxes(1, 2).reshape(2 * m, 3)
            covariance += place @ place.T
        covariance.reshape(-1)[:: 2 * m + 1] += 1.0
        self._add_others(covariance, rows, own, targets)
        residual = found.residual.ravel()
        distance2, log_det = pair_distances(residual, covariance)
        prediction = FramePrediction(detection, targets, residual, covariance, distance2, log_det, found.visible)
        return prediction, rows, own

    def linearised(self, s: Sightings, detection: Ints, point: Array) -> tuple[Projection, Array]:
        """Detections (M,) of a frame at points (3, M): the projection, and derivatives (2, n, M) by the base state."""
        rays, tangents, row = s.rays.take(detection, -1), s.tangents.take(detection, -1), s.row.take(detection)
        shared, error = self.mean[: self.size], self.mean[self._errors, None]
        found = project(self.poses(s, detection), rays, tangents, shared, point, error, row)
        h = np.zeros((2, len(self.mean), len(detection)))
        h[:, : self.size], h[:, self.error :] = found.shared, found.point
        if self.curved:
            # A delay's displacements (2, M) beyond its derivative: over one beat of a shaking vehicle they are as large
            # as what the derivative says. Even and odd in the delay, each with a variance of one.
            reach, beyond = _REACH_SIGMAS * float(self.covariance[CAMERA_DELAY, CAMERA_DELAY]) ** 0.5, []
            for later in (reach, -reach):
                there = project(self.poses(s, detection, later), rays, tangents, shared, point, error, row)
                off = found.residual - there.residual - later * found.shared[:, CAMERA_DELAY]
                beyond.append(np.where(there.visible & found.visible, off, 0.0) * (0.5 / _REACH_SIGMAS))
            h[:, self.error - 2], h[:, self.error - 1] = beyond[0] + beyond[1], beyond[0] - beyond[1]
        return found, h

    def _add_others(self, covariance: Array, h: Array, own: Array, targets: Ints) -> None:
        """Add what Schmidt targets contribute to the innovation covariance (2 M, 2 M), in place."""
        index = np.array([i for i, k in enumerate(targets.tolist()) if k in self.others.at], np.int64)
        if not len(index):
            return
        o = np.array([self.others.at[int(k)] for k in targets[index]], np.int64)
        rows = np.stack([index, index + len(targets)], 1)  # (P, 2)
        seen = own[..., index].transpose(2, 0, 1)  # (P, 2, 3)
        by_base = seen @ self.others.cross[o, :TARGET_SIZE]  # (P, 2, n)
        flat = rows.ravel()
        carried = by_base.reshape(len(flat), -1) @ h.T  # (2 P, 2 M)
        covariance[flat] += carried
        covariance[:, flat] += carried.T
        # Two of them have in common what the base state explains; of itself a target knows more.
        gains = seen @ self.others.gains(o, self.covariance)  # (P, 2, n)
        common = gains.reshape(len(flat), -1) @ by_base.reshape(len(flat), -1).T
        same = o[:, None] == o
        for i, j in np.argwhere(same).tolist():
            whole = seen[i] @ self.others.covariance[o[i], :TARGET_SIZE, :TARGET_SIZE] @ seen[j].T
            common[2 * i : 2 * i + 2, 2 * j : 2 * j + 2] = whole
        covariance[np.ix_(flat, flat)] += common

    def update(self, s: Sightings) -> None:
        """Take one frame whose detections have targets that the filter knows."""
        self.predict(float(s.t[0]))
        early, late = self.t - BREAK_MARGIN_S, self.t + BREAK_MARGIN_S
        if any(b.before < late and early < b.after for b in self.carrier.path.breaks):
            return
        self._update_by_range()
        teaches = np.array([k in self.at for k in s.target.tolist()], np.bool_)
        for index in (np.flatnonzero(teaches), np.flatnonzero(~teaches)):
            if not len(index):
                continue
            found, h, own = self.innovations(s, index, s.target[index])
            use = found.visible & (found.distance2 < GATE2)
            self.used += int(use.sum())
            self.refused += int((~use).sum())
            self.surprise += float(found.distance2[use].sum())
            if not use.any():
                continue
            self.version += 1
            if teaches[index[0]]:
                rows = found.rows(np.flatnonzero(use))
                self._correct(h[rows], found.covariance[np.ix_(rows, rows)], found.residual[rows])
            else:
                self._update_others(found, h, own, np.flatnonzero(use))

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
        carried = self.covariance @ h.T  # (n, m)
        gain = np.linalg.solve(s, carried.T).T
        gain[: self.size] = 0.0
        self.mean = self.mean + gain @ r
        # Joseph's form (Bucy & Joseph 1968) in full: right also for the rows of a gain that were set to zero.
        left = gain @ carried.T
        c = self.covariance - left - left.T + gain @ s @ gain.T
        self.covariance = 0.5 * (c + c.T)
        self.others.follow(h, s, r, carried, gain)

    def _update_others(self, found: FramePrediction, h: Array, own: Array, use: Ints) -> None:
        m = len(found.target)
        for i in use.tolist():
            rows = [i, i + m]
            s = found.covariance[np.ix_(rows, rows)]
            self.others.update(int(found.target[i]), own[..., i], h[rows], s, found.residual[rows], self.covariance)

    def places(self) -> tuple[Array, Array, Array]:
        """Of all `targets`: means (T, 5), covariances (T, 5, 5), and covariances (T, 5, n) with the base state.

        A state is north, east, height above the surface, and the velocity north and east.
        """
        block = np.array([*self.at.values()], np.int64)[:, None] + np.arange(TARGET_SIZE)
        own = self.covariance[block[:, :, None], block[:, None, :]]
        taught = SchmidtTargets.of_solve(self.targets[: len(block)], self.mean[block], own, self.covariance[block])
        if not self.others.at:
            return taught.mean, taught.covariance, taught.cross
        return (
            np.concatenate([taught.mean, self.others.mean]),
            np.concatenate([taught.covariance, self.others.covariance]),
            np.concatenate([taught.cross, self.others.cross]),
        )

    def place(self, target: int) -> tuple[Array, Array]:
        """Mean (3,) and covariance (3, 3) of a target: north, east, height above the surface."""
        mean, covariance, _, _ = self.state(target)
        return mean[:TARGET_SIZE], covariance[:TARGET_SIZE, :TARGET_SIZE]

    def cross(self, target: int) -> Array:
        """Covariance (3, n) of a target with the base state."""
        return np.asarray(self.state(target)[2][:TARGET_SIZE])

    def vehicle_rows(self, t: float, velocity: Array) -> tuple[Array, Array]:
        """Rows (3, n): apparent minus true vehicle (north, east, up) by the base state; variance (3,) added by then."""
        keep, added = aged(self.wanders, self.growth, t - self.t)
        added = added + sum(step_variance(b) for b in self.carrier.path.breaks if self.t < b.after <= t)
        a = np.zeros((3, len(self.mean)))
        a[np.arange(3), self._errors] = keep
        a[:, POSITION_DELAY] = -velocity
        return a, added
