"""Extended Kalman filter between two solves (Jazwinski 1970): shared parameters, targets, the error now.

It starts at every solve's mean and covariance, so its linearisation errors do not add up. The shared parameters are
considered (Schmidt 1966): solves alone estimate them. A frame's derivative by the height or a delay contains the path's
noise, an error in the variables (Fuller 1987) that a recursive update turns into information: in a hover at 1 m the
height moved by 0.9 m in four seconds, claimed to 0.1 m, and every solve moved it back. Targets beyond the first ten are
Schmidt states, too: each has a mean, a covariance and a covariance with the rest, is updated by its own sightings,
moves when the rest moves, and does not teach. The cost is linear in their number.
"""

from __future__ import annotations

import copy
from dataclasses import replace

import numpy as np

from fwav_companion.estimation.errors import CAMERA_DELAY, POSITION_DELAY, READOUT, Array, Ints
from fwav_companion.estimation.frame_prediction import GATE2, FramePrediction, pair_distances
from fwav_companion.estimation.ground import TARGET_SIZE
from fwav_companion.estimation.kept_sightings import Sightings
from fwav_companion.estimation.measurement import Poses, project
from fwav_companion.estimation.path_samples import Carrier
from fwav_companion.estimation.problem import BREAK_MARGIN_S, Model, attitude_shift
from fwav_companion.estimation.smoother import common_noise
from fwav_companion.estimation.wander import Wander, step_variance

TEACHING = 10  # targets whose sightings update the error and each other
_ONE_INSTANT_S = 1e-6
_FEW_PAIRS, _NEAREST = 24, 3
_READING_GAP_S, _READING_GATE2 = 0.3, 9.0  # beyond three sigmas a rangefinder sees something else than the ground
_SHORT_S = 0.5  # gap up to which the error is a random walk


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
        self.other = {k: i for i, k in enumerate(others.tolist())}
        rows = self.size + TARGET_SIZE * len(taught) + np.arange(TARGET_SIZE * len(others)).reshape(-1, TARGET_SIZE)
        self.other_mean = mean[rows]  # (O, 3)
        self.other_covariance = covariance[rows[:, :, None], rows[:, None, :]]  # (O, 3, 3)
        self.other_cross = covariance[rows[:, :, None], base]  # (O, 3, n)
        if carrier.path.accuracies:  # the receiver's solution now, in all
            sigma_m = float(carrier.path.accuracy_at(np.array([t]))[1][0])
            wanders = replace(wanders[0], sigma_m=sigma_m), wanders[1]
        self._wander_as(wanders)
        self._reading_t = t  # s, of the newest reading of the rangefinder that is used
        self.surprise, self.used, self.refused = 0.0, 0, 0  # sums since the solve: distance, sightings, gated
        self._pose: tuple[float, Poses] | None = None
        self.version = 0  # grows with every change of means or covariances

    def _wander_as(self, wanders: tuple[Wander, Wander]) -> None:
        self.wanders = wanders
        level, up = (w.growth() for w in wanders)
        self.growth = np.array([level, level, up])  # m^2/s

    def copy(self) -> LiveFilter:
        """A snapshot that later frames do not change."""
        other = copy.copy(self)
        other.mean, other.covariance, other.other_mean = (
            self.mean.copy(),
            self.covariance.copy(),
            self.other_mean.copy(),
        )
        other.other_covariance, other.other_cross = self.other_covariance.copy(), self.other_cross.copy()
        return other

    @property
    def targets(self) -> Ints:
        """Numbers of all targets, teaching ones first."""
        return np.array([*self.at, *self.other], np.int64)

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
            self.mean[self.at[k] : self.at[k] + TARGET_SIZE] if k in self.at else self.other_mean[self.other[k]]
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
            self.other_cross[:, :, e] *= keep
        self.covariance[e, e] += added
        self._change_solution(t)
        self.version += 1
        for b in self.carrier.path.breaks:
            if self.t < b.after <= t:
                self.covariance[e, e] += step_variance(b)
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
        self.other_cross[:, :, e] *= keep
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

    def near_pairs(self, s: Sightings) -> tuple[Ints, Ints]:
        """Pairs (M,) of detections and targets that may belong together: all, or of many the nearest of each detection.

        The joint covariance grows with the square of their number.
        """
        targets = self.targets
        detection = np.repeat(np.arange(len(s)), len(targets))
        if len(detection) <= _FEW_PAIRS:
            return detection, np.tile(targets, len(s))
        mean = self.target_means(targets)
        mean[2] += self.model.ground.height(mean[:2])[0]
        rays, tangents = s.rays.take(detection, -1), s.tangents.take(detection, -1)
        point, error = np.tile(mean, len(s)), self.mean[self._errors, None]
        found = project(
            self.poses(s, detection), rays, tangents, self.mean[: self.size], point, error, s.row.take(detection)
        )
        far = np.where(found.visible, (found.residual**2).sum(0), np.inf).reshape(len(s), -1)
        nearest = np.argsort(far, axis=1, kind="stable")[:, :_NEAREST]
        return np.repeat(np.arange(len(s)), nearest.shape[1]), targets[nearest.ravel()]

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
        m = len(targets)
        for i, k in enumerate(targets.tolist()):
            if k not in self.other:
                continue
            o = self.other[k]
            rows = [i, i + m]
            carried = own[..., i] @ self.other_cross[o] @ h.T  # (2, 2 M)
            covariance[rows] += carried
            covariance[:, rows] += carried.T
            same = np.flatnonzero(targets == k)
            for j in same.tolist():
                covariance[np.ix_(rows, [j, j + m])] += own[..., i] @ self.other_covariance[o] @ own[..., j].T

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
        cross = self.other_cross @ h.T  # (O, 3, m)
        self.mean = self.mean + gain @ r
        # Joseph's form (Bucy & Joseph 1968) in full: right also for the rows of a gain that were set to zero.
        left = gain @ carried.T
        c = self.covariance - left - left.T + gain @ s @ gain.T
        self.covariance = 0.5 * (c + c.T)
        if len(self.other):
            other_gain = np.linalg.solve(s, cross.reshape(-1, len(r)).T).T.reshape(cross.shape)
            self.other_mean = self.other_mean + other_gain @ r
            self.other_covariance = self.other_covariance - other_gain @ cross.swapaxes(1, 2)
            self.other_cross = self.other_cross - other_gain @ carried.T - cross @ gain.T + other_gain @ s @ gain.T

    def _update_others(self, found: FramePrediction, h: Array, own: Array, use: Ints) -> None:
        m = len(found.target)
        for i in use.tolist():
            o, rows = self.other[int(found.target[i])], [i, i + m]
            s, place = found.covariance[np.ix_(rows, rows)], own[..., i]
            carried = self.other_covariance[o] @ place.T + self.other_cross[o] @ h[rows].T  # (3, 2)
            base = self.covariance @ h[rows].T + self.other_cross[o].T @ place.T  # (n, 2)
            gain = np.linalg.solve(s, carried.T).T
            self.other_mean[o] = self.other_mean[o] + gain @ found.residual[rows]
            c = self.other_covariance[o] - gain @ carried.T
            self.other_covariance[o] = 0.5 * (c + c.T)
            self.other_cross[o] = self.other_cross[o] - gain @ base.T

    def places(self) -> tuple[Array, Array, Array]:
        """Of all `targets`: means (T, 3) north, east, height above the surface, covariances (T, 3, 3), and covariances
        (T, 3, n) with the base state.
        """
        block = np.arange(self.size, self.error).reshape(-1, TARGET_SIZE)
        mean, cross = self.mean[block], self.covariance[block]
        own = self.covariance[block[:, :, None], block[:, None, :]]
        if not self.other:
            return mean, own, cross
        return (
            np.concatenate([mean, self.other_mean]),
            np.concatenate([own, self.other_covariance]),
            np.concatenate([cross, self.other_cross]),
        )

    def vehicle_rows(self, t: float, velocity: Array) -> tuple[Array, Array]:
        """Rows (3, n): apparent minus true vehicle (north, east, up) by the base state; variance (3,) added by then."""
        keep, added = self.aging(t - self.t)
        added = added + sum(step_variance(b) for b in self.carrier.path.breaks if self.t < b.after <= t)
        a = np.zeros((3, len(self.mean)))
        a[np.arange(3), self._errors] = keep
        a[:, POSITION_DELAY] = -velocity
        return a, added
