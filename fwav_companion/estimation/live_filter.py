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
from collections.abc import Set
from dataclasses import replace

import numpy as np

from fwav_companion.estimation.errors import CAMERA_DELAY, POSITION_DELAY, READOUT, Array, Ints
from fwav_companion.estimation.frame_prediction import GATE2, FramePrediction, pair_distances
from fwav_companion.estimation.ground import TARGET_SIZE
from fwav_companion.estimation.kept_sightings import Sightings
from fwav_companion.estimation.measurement import Poses, feet, project
from fwav_companion.estimation.path_samples import Carrier
from fwav_companion.estimation.problem import BREAK_MARGIN_S, Model, attitude_shift, error_processes
from fwav_companion.estimation.schmidt_targets import SchmidtTargets
from fwav_companion.estimation.smoother import common_noise
from fwav_companion.estimation.wander import SMOOTH, Wander, step_variance

TEACHING = 10  # targets whose sightings update the error and each other
_ONE_INSTANT_S = 1e-6
_READING_GAP_S, _READING_GATE2 = 0.3, 9.0  # beyond three sigmas a rangefinder sees something else than the ground
_SHORT_S = 0.5  # gap up to which the error is a random walk
_SEARCHED_S, _SEARCHED_SIGMAS, _REACH_SIGMAS = 0.08, 8.0, 2.5  # of the delay's first search
_LEAST_DETERMINANT = 1e-9  # of the derivative by a place: a smaller one has no inverse


class LiveFilter:
    """State: shared (S), teaching targets (3 each), error now (3); other targets apart."""

    def __init__(
        self, model: Model, carrier: Carrier, wanders: tuple[Wander, Wander], t: float, mean: Array, covariance: Array,
        ids: Ints,
    ) -> None:  # fmt: skip
        """Mean (n,) and covariance (n, n) of shared, targets in the order of `ids`, error; the first ten teach."""
        self.model, self.carrier, self.t = model, carrier, t
        self.size = len(model.priors)
        taught = ids[:TEACHING]
        base = np.concatenate([np.arange(self.size + TARGET_SIZE * len(taught)), np.arange(len(mean) - 3, len(mean))])
        self.mean, self.covariance = mean[base], covariance[np.ix_(base, base)]
        self.at = {k: self.size + TARGET_SIZE * i for i, k in enumerate(taught.tolist())}
        self.error = len(base) - 3
        self._errors = np.arange(self.error, self.error + 3)
        others = ids[TEACHING:]
        rows = self.size + TARGET_SIZE * len(taught) + np.arange(TARGET_SIZE * len(others)).reshape(-1, TARGET_SIZE)
        self.others = SchmidtTargets.of_solve(
            others, mean[rows], covariance[rows[:, :, None], rows[:, None, :]], covariance[rows[:, :, None], base]
        )
        self._wander_as(_by_solution(wanders, carrier, t))
        self._reading_t = t  # s, of the newest reading of the rangefinder that is used
        self.surprise, self.used, self.refused = 0.0, 0, 0  # sums since the solve: distance, sightings, gated
        self._pose: tuple[float, Poses] | None = None
        self.version = 0  # grows with every change of means or covariances

    def _wander_as(self, wanders: tuple[Wander, Wander]) -> None:
        self.wanders = wanders
        level, up = (w.growth() for w in wanders)
        self.growth = np.array([level, level, up])  # m^2/s

    @classmethod
    def before_solves(cls, model: Model, carrier: Carrier, t: float) -> LiveFilter:
        """The filter by the priors alone, without targets.

        The delay may be as far off as the first search will look: else its sightings of one target would not meet.
        """
        wanders = _by_solution(error_processes(model, carrier, SMOOTH), carrier, t)
        level, up = (float(w.covariance(np.zeros(1))[0]) for w in wanders)
        mean = np.concatenate([model.priors.mean, np.zeros(3)])
        sigma = model.priors.sigma.copy()
        if not model.consider:
            reach = min(_SEARCHED_S, _SEARCHED_SIGMAS * float(sigma[CAMERA_DELAY]))
            sigma[CAMERA_DELAY] = max(float(sigma[CAMERA_DELAY]), reach / _REACH_SIGMAS)
        variance = np.concatenate([sigma**2, [level, level, up]])
        return cls(model, carrier, wanders, t, mean, np.diag(variance), np.zeros(0, np.int64))

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

    def poses(self, s: Sightings, detection: Ints) -> Poses:
        """Poses of a frame's detections (M,): one pose, or with a rolling shutter that of each detection's row."""
        shared = self.mean[: self.size]
        t = s.t - s.row * float(shared[READOUT])
        if t.max() - t.min() < _ONE_INSTANT_S:
            return self.pose(float(t[0]))
        t -= float(shared[CAMERA_DELAY])
        shift = attitude_shift(shared)
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
        keep, added = self.aging(t - self.t)
        e = self._errors
        if t - self.t >= _SHORT_S:
            self.mean[e] *= keep
            self.covariance[e] *= keep[:, None]
            self.covariance[:, e] *= keep
            self.others.cross[:, :, e] *= keep
        self.covariance[e, e] += added
        self._change_solution(t)
        self.version += 1
        for b in self.carrier.path.breaks:
            if self.t < b.after <= t:
                self.covariance[e, e] += step_variance(b)
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

    def aging(self, dt: float) -> tuple[Array, Array]:
        """Factor (3,) on the error and variance (3,) added after dt seconds without a sighting.

        From frame to frame a random walk with the growth over half a second. After a gap the mean fades and the
        variance grows as the kernel says: a walk that is right from frame to frame is too slow for wanders with a
        finite rate.
        """
        if dt < _SHORT_S:
            return np.ones(3), self.growth * max(dt, 0.0)
        (a, b), (c, d) = (w.covariance(np.array([0.0, dt])).tolist() for w in self.wanders)
        start, later = np.array([a, a, c]), np.array([b, b, d])
        start = np.maximum(start, 1e-12)
        return later / start, np.maximum(start - later * later / start, self.growth * _SHORT_S)

    def begin(self, target: int, s: Sightings, *, moving: bool) -> bool:
        """Begin a target from one sighting (N = 1) at the present calibration; False where its ray has no foot.

        The place is the ground point; its error is that of the detection and of all that the base state does not know.
        """
        poses, shared, error = self.poses(s, np.zeros(1, np.int64)), self.mean[: self.size], self.mean[self._errors]
        prior, place = self.model.target(target), poses.position[:2]
        for _ in range(2):
            ground = float(self.model.ground.height(place)[0][0])
            place, meets = feet(poses, s.rays, shared, error[:, None], ground + prior.height_m)
        if not meets[0]:
            return False
        ground_height, slope = self.model.ground.height(place)
        point = np.append(place[:, 0], ground_height + prior.height_m)[:, None]
        found = project(poses, s.rays, s.tangents, shared, point, error[:, None], s.row)
        own = found.point[..., 0].copy()
        own[:, :2] += found.point[:, 2:, 0] * slope[:, 0]
        if not found.visible[0] or abs(np.linalg.det(own[:, :2])) < _LEAST_DETERMINANT:
            return False
        h = np.zeros((2, len(self.mean)))
        h[:, : self.size], h[:, self.error :] = found.shared[..., 0], found.point[..., 0]
        g = common_noise(found, self.model.noise, s.own_noise)[..., 0]
        noise = g @ g.T + np.eye(2)
        if s.own_noise is not None:
            moved = found.point[..., 0] * s.own_noise[[1, 1, 2], 0]
            noise += moved @ moved.T
        mean = np.array([point[0, 0], point[1, 0], prior.height_m])
        variance = prior.precision()[2] ** -1.0
        self.others.begin(target, mean, own, h, self.covariance, noise, variance, moving=moving)
        self.version += 1
        return True

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

    def separation2(self, one: int, other: int) -> tuple[float, float]:
        """Squared Mahalanobis distance of two targets, and the trace of their difference's covariance, m^2.

        The errors that both share cancel: two targets may be far nearer to each other than each to its place.
        """
        (a, aa, _, _), (b, bb, _, _) = self.state(one), self.state(other)
        cross = self.between(one, other)[:2, :2]
        covariance = aa[:2, :2] + bb[:2, :2] - cross - cross.T
        difference = a[:2] - b[:2]
        return float(difference @ np.linalg.solve(covariance, difference)), float(np.trace(covariance))

    def between(self, one: int, other: int) -> Array:
        """Covariance (3, 3) of two targets; what two Schmidt targets have in common is what the base state explains."""
        if one in self.at:
            i = self.at[one]
            return np.asarray(self.cross(other)[:, i : i + TARGET_SIZE].T)
        if other in self.at:
            i = self.at[other]
            return np.asarray(self.cross(one)[:, i : i + TARGET_SIZE])
        gain = self.others.gains(np.array([self.others.at[one]]), self.covariance)[0]
        return np.asarray(gain @ self.cross(other).T)

    def innovations(self, s: Sightings, detection: Ints, targets: Ints) -> tuple[FramePrediction, Array, Array]:
        """Pairs (M,) of detections and targets; their rows (2 M, n) of the base state, and (2, 3, M) of the targets."""
        m, x = len(targets), self.mean
        mean = self.target_means(targets)
        ground, slope = self.model.ground.height(mean[:2])
        point = np.stack([mean[0], mean[1], mean[2] + ground])
        rays, tangents = s.rays.take(detection, -1), s.tangents.take(detection, -1)
        found = project(
            self.poses(s, detection),
            rays,
            tangents,
            x[: self.size],
            point,
            x[self._errors, None],
            s.row.take(detection),
        )
        h = np.zeros((2, m, len(x)))
        h[..., : self.size] = found.shared.swapaxes(1, 2)
        h[..., self.error :] = found.point.swapaxes(1, 2)
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

    def _add_others(self, covariance: Array, h: Array, own: Array, targets: Ints) -> None:
        """Add what Schmidt targets contribute to the innovation covariance (2 M, 2 M), in place."""
        index = np.array([i for i, k in enumerate(targets.tolist()) if k in self.others.at], np.int64)
        if not len(index):
            return
        o = np.array([self.others.at[int(k)] for k in targets[index]], np.int64)
        rows = np.stack([index, index + len(targets)], 1)  # (P, 2)
        seen = own[..., index].transpose(2, 0, 1)  # (P, 2, 3)
        cross = self.others.cross[o, :TARGET_SIZE]  # (P, 3, n)
        by_base = seen @ cross  # (P, 2, n)
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
        margin = BREAK_MARGIN_S
        if any(b.before - margin < self.t < b.after + margin for b in self.carrier.path.breaks):
            return
        self._update_by_range()
        teaches = np.array([k in self.at for k in s.target.tolist()], np.bool_)
        for which, update in ((teaches, self._update_base), (~teaches, self._update_others)):
            index = np.flatnonzero(which)
            if not len(index):
                continue
            found, h, own = self.innovations(s, index, s.target[index])
            use = found.visible & (found.distance2 < GATE2)
            self.used += int(use.sum())
            self.refused += int((~use).sum())
            self.surprise += float(found.distance2[use].sum())
            if use.any():
                self.version += 1
                update(found, h, own, np.flatnonzero(use))

    def _update_base(self, found: FramePrediction, h: Array, own: Array, use: Ints) -> None:
        del own
        rows = found.rows(use)
        self._correct(h[rows], found.covariance[np.ix_(rows, rows)], found.residual[rows])

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
        keep, added = self.aging(t - self.t)
        added = added + sum(step_variance(b) for b in self.carrier.path.breaks if self.t < b.after <= t)
        a = np.zeros((3, len(self.mean)))
        a[np.arange(3), self._errors] = keep
        a[:, POSITION_DELAY] = -velocity
        return a, added


def _by_solution(wanders: tuple[Wander, Wander], carrier: Carrier, t: float) -> tuple[Wander, Wander]:
    """Processes of the error in the receiver's solution at t."""
    if not carrier.path.accuracies:
        return wanders
    sigma_m = float(carrier.path.accuracy_at(np.array([t]))[1][0])
    return replace(wanders[0], sigma_m=sigma_m), wanders[1]
