"""Targets beside the base state of the live filter, which they do not teach (Schmidt 1966): new, moving and many ones.

Each has a mean, a covariance and a covariance with the base state (shared parameters, teaching targets, the error now).
A moving target is one with a velocity: constant, with white acceleration. Its place is correlated with the error now as
a static one's is; so relative to the vehicle the wander cancels. Its own motion is confounded with a wrong calibration,
so it must not move the calibration.
"""

from __future__ import annotations

import numpy as np

from fwav_companion.estimation.errors import Array, Ints
from fwav_companion.estimation.ground import TARGET_SIZE

SIZE = 5  # north, east, height above the surface (m); velocity north, east (m/s), zero for a static target
FIRST_SPEED_M_S = 3.0  # one sigma of each axis of an unknown velocity: people, animals, vehicles on a field
ACCELERATION_M_S2 = 0.5  # white, over one second: a person on foot
_REGULAR = 1e-9  # share of each variance that keeps the base covariance regular: priors of zero are 1e-14
_PLACE = np.arange(2)
_SPEED = np.arange(TARGET_SIZE, SIZE)


class SchmidtTargets:
    """O targets: means (O, 5), covariances (O, 5, 5), covariances with the base state (O, 5, n)."""

    def __init__(self, at: dict[int, int], mean: Array, covariance: Array, cross: Array, moves: Array) -> None:
        self.at, self.mean, self.covariance, self.cross = at, mean, covariance, cross
        self.moves = moves  # (O,) 1.0: moving

    @classmethod
    def of_solve(cls, ids: Ints, mean: Array, covariance: Array, cross: Array) -> SchmidtTargets:
        """Static targets by a solve: means (O, 3), covariances (O, 3, 3), and with the base state (O, 3, n)."""
        count, n = len(ids), cross.shape[2]
        full = cls(
            {k: i for i, k in enumerate(ids.tolist())}, np.zeros((count, SIZE)), np.zeros((count, SIZE, SIZE)),
            np.zeros((count, SIZE, n)), np.zeros(count),
        )  # fmt: skip
        full.mean[:, :TARGET_SIZE], full.cross[:, :TARGET_SIZE] = mean, cross
        full.covariance[:, :TARGET_SIZE, :TARGET_SIZE] = covariance
        return full

    def copy(self) -> SchmidtTargets:
        """A snapshot."""
        return SchmidtTargets(
            dict(self.at), self.mean.copy(), self.covariance.copy(), self.cross.copy(), self.moves.copy()
        )

    def place(self, target: int) -> Array:
        """Mean (3,) of a target's place."""
        return np.asarray(self.mean[self.at[target], :TARGET_SIZE])

    def state(self, target: int) -> tuple[Array, Array, Array, bool]:
        """Mean (5,), covariance (5, 5), covariance with the base state (5, n), and whether it moves."""
        o = self.at[target]
        return self.mean[o], self.covariance[o], self.cross[o], bool(self.moves[o])

    @staticmethod
    def padded(mean: Array, covariance: Array, cross: Array) -> tuple[Array, Array, Array, bool]:
        """The state of a static target by its place alone: (3,), (3, 3), (3, n)."""
        full, with_base = np.zeros((SIZE, SIZE)), np.zeros((SIZE, cross.shape[1]))
        full[:TARGET_SIZE, :TARGET_SIZE], with_base[:TARGET_SIZE] = covariance, cross
        return np.append(mean, (0.0, 0.0)), full, with_base, False

    def begin(
        self, target: int, mean: Array, own: Array, h: Array, base: Array, noise: Array, height_variance: float,
        *, moving: bool,
    ) -> None:  # fmt: skip
        """Add a target by one sighting whose residual is zero at its place.

        mean: (3,) place; own: (2, 3) derivative of the residual by the place, h: (2, n) by the base state; base: (n, n)
        its covariance; noise: (2, 2). The place's error is -own^-1 (h base error + height's error + noise).
        """
        inverse = np.linalg.inv(own[:, :2])
        by_base, by_height = -inverse @ h, -inverse @ own[:, 2:]
        covariance, cross = np.zeros((SIZE, SIZE)), np.zeros((SIZE, h.shape[1]))
        cross[:2] = by_base @ base
        covariance[:2, :2] = cross[:2] @ by_base.T + height_variance * by_height @ by_height.T
        covariance[:2, :2] += inverse @ noise @ inverse.T
        covariance[2, 2] = height_variance
        covariance[:2, 2] = covariance[2, :2] = height_variance * by_height[:, 0]
        if moving:
            covariance[_SPEED, _SPEED] = FIRST_SPEED_M_S**2
        self._add(target, np.append(mean, (0.0, 0.0)), covariance, cross, moving=moving)

    def take_over(
        self, target: int, mean: Array, covariance: Array, cross: Array, *, moving: bool,
        before: tuple[Array, Array], after: tuple[Array, Array], index: Ints,
    ) -> None:  # fmt: skip
        """Add a target of another filter, given another knowledge of what it has in common with the base state.

        cross: (5, k) with the common part; before: its mean (k,) and covariance (k, k); after: the mean and the
        covariance of that part with all of this base state (k, n); index: (k,) its rows there. The target given the
        common part stays as it was; only the common part is known better.
        """
        mean_before, covariance_before = before
        mean_after, with_base = after
        gain = cross @ _inverse(covariance_before)  # (5, k)
        known = with_base[:, index]
        rest = covariance - gain @ cross.T
        moved = mean + gain @ (mean_after - mean_before)
        new = rest + gain @ known @ gain.T
        self._add(target, moved, 0.5 * (new + new.T), gain @ with_base, moving=moving)

    def _add(self, target: int, mean: Array, covariance: Array, cross: Array, *, moving: bool) -> None:
        self.delete(target)
        self.at[target] = len(self.mean)
        self.mean = np.concatenate([self.mean, mean[None]])
        self.covariance = np.concatenate([self.covariance, covariance[None]])
        self.cross = np.concatenate([self.cross, cross[None]])
        self.moves = np.append(self.moves, float(moving))

    def delete(self, target: int) -> None:
        """Delete a target, if it is one of these."""
        row = self.at.pop(target, None)
        if row is None:
            return
        self.mean, self.covariance, self.cross, self.moves = (
            np.delete(a, row, 0) for a in (self.mean, self.covariance, self.cross, self.moves)
        )
        self.at = {k: i - (i > row) for k, i in self.at.items()}

    def rename(self, old: int, new: int) -> None:
        """Give a target another number; one that has the new number is deleted."""
        self.delete(new)
        self.at = {(new if k == old else k): i for k, i in self.at.items()}

    def gains(self, which: Ints, base: Array) -> Array:
        """Regressions (P, 3, n) of the targets' places on the base state with covariance (n, n)."""
        return np.asarray(self.cross[which, :TARGET_SIZE] @ _inverse(base))

    def add_innovations(
        self, covariance: Array, h: Array, targets: Ints, own: Array, index: Ints, base: Array
    ) -> None:  # fmt: skip
        """Add what these targets contribute to the innovation covariance (2 M, 2 M) of a frame's pairs, in place.

        h: (2 M, n) derivatives by the base state; targets: (M,) numbers; own: (2, 3, M) derivatives by the places;
        index: (P,) pairs of these targets; base: (n, n) covariance.
        """
        o = np.array([self.at[k] for k in targets[index].tolist()], np.int64)
        rows = np.stack([index, index + len(targets)], 1).ravel()  # (2 P,)
        seen = own[..., index].transpose(2, 0, 1)  # (P, 2, 3)
        by_base = seen @ self.cross[o, :TARGET_SIZE]  # (P, 2, n)
        carried = by_base.reshape(len(rows), -1) @ h.T  # (2 P, 2 M)
        covariance[rows] += carried
        covariance[:, rows] += carried.T
        # Two of them have in common what the base state explains; of itself a target knows more.
        same = o[:, None] == o
        common = np.zeros((len(rows), len(rows)))
        if not same.all():
            gains = seen @ self.gains(o, base)  # (P, 2, n)
            common = gains.reshape(len(rows), -1) @ by_base.reshape(len(rows), -1).T
        for i, j in np.argwhere(same).tolist():
            whole = seen[i] @ self.covariance[o[i], :TARGET_SIZE, :TARGET_SIZE] @ seen[j].T
            common[2 * i : 2 * i + 2, 2 * j : 2 * j + 2] = whole
        covariance[rows[:, None], rows] += common

    def predict(self, dt: float) -> None:
        """Move the moving ones by their velocity, with white acceleration."""
        if not self.moves.any():
            return
        self.mean[:, :2] += dt * self.mean[:, TARGET_SIZE:]
        self.covariance[:, :2] += dt * self.covariance[:, TARGET_SIZE:]
        self.covariance[:, :, :2] += dt * self.covariance[:, :, TARGET_SIZE:]
        self.cross[:, :2] += dt * self.cross[:, TARGET_SIZE:]
        q = self.moves[:, None] * ACCELERATION_M_S2**2
        self.covariance[:, _PLACE, _PLACE] += q * dt**3 / 3.0
        self.covariance[:, _SPEED, _SPEED] += q * dt
        self.covariance[:, _PLACE, _SPEED] += q * dt**2 / 2.0
        self.covariance[:, _SPEED, _PLACE] += q * dt**2 / 2.0

    def follow(self, h: Array, s: Array, residual: Array, carried: Array, gain: Array) -> None:
        """Move with the base state, which was updated.

        h: (r, n) rows of its sightings; s: (r, r) innovation covariance; carried: (n, r) its covariance with them;
        gain: (n, r) the gain that was used.
        """
        if not self.at:
            return
        cross = self.cross @ h.T  # (O, 5, r)
        own = np.linalg.solve(s, cross.reshape(-1, len(residual)).T).T.reshape(cross.shape)
        self.mean = self.mean + own @ residual
        self.covariance = self.covariance - own @ cross.swapaxes(1, 2)
        self.cross = self.cross - own @ carried.T - cross @ gain.T + own @ s @ gain.T

    def update(self, target: int, own: Array, h: Array, s: Array, residual: Array, base: Array) -> None:
        """Update a target by its sighting: derivatives by its place (2, 3) and by the base state (2, n)."""
        o = self.at[target]
        carried = self.covariance[o, :, :TARGET_SIZE] @ own.T + self.cross[o] @ h.T  # (5, 2)
        with_base = base @ h.T + self.cross[o, :TARGET_SIZE].T @ own.T  # (n, 2)
        gain = np.linalg.solve(s, carried.T).T
        self.mean[o] += gain @ residual
        c = self.covariance[o] - gain @ carried.T
        self.covariance[o] = 0.5 * (c + c.T)
        self.cross[o] -= gain @ with_base.T


def _inverse(covariance: Array) -> Array:
    """Inverse of a covariance, scaled to a unit diagonal first: sigmas differ by many powers of ten."""
    scale = 1.0 / np.sqrt(np.maximum(covariance.diagonal(), 1e-300))
    scaled = covariance * scale * scale[:, None]
    scaled[np.diag_indices(len(scaled))] += _REGULAR
    return np.asarray(np.linalg.inv(scaled) * scale * scale[:, None])
