"""A moving target: constant velocity with white acceleration; it uses what static targets teach and teaches nothing.

Its place is apparent (place plus the position's error), which is what a sighting measures: relative to the vehicle the
wander cancels. Shared parameters and the height's error are consider states (Schmidt 1966) of the live posterior. A
target's own motion is confounded with a wrong calibration; so it must not move the calibration.
"""

from __future__ import annotations

import numpy as np

from fwav_companion.estimation.errors import POSITION_DELAY, Array, Ints
from fwav_companion.estimation.frame_prediction import GATE2
from fwav_companion.estimation.kept_sightings import Sightings
from fwav_companion.estimation.live_filter import LiveFilter
from fwav_companion.estimation.measurement import feet, project
from fwav_companion.estimation.smoother import common_noise

_FIRST_PLACE_M, _FIRST_SPEED_M_S = 10.0, 3.0  # prior about the first sighting's ground point
_ONE = np.zeros(1, np.int64)
ACCELERATION_M_S2 = 0.5  # white, over one second: a person on foot


class MovingTarget:
    """State: apparent north, east (m), velocity north, east (m/s).

    `own` (4, 4): covariance with the considered parameters known; `sensitivity` (4, C) of the estimate's error to
    theirs. The covariance is own + sensitivity P sensitivity', with P of the live filter when it is asked for.
    """

    def __init__(self, live: LiveFilter, s: Sightings, acceleration: float = ACCELERATION_M_S2) -> None:
        """Initiate from one sighting (N = 1)."""
        self.t, self.acceleration = float(s.t[0]), acceleration
        error = np.array([[0.0], [0.0], [live.mean[live.error + 2]]])
        place, _ = feet(live.pose(self.t), s.rays, live.mean[: live.size], error, self._ground(live, np.zeros(2)))
        self.state = np.concatenate([place[:, 0], np.zeros(2)])
        self.own = np.diag([_FIRST_PLACE_M**2] * 2 + [_FIRST_SPEED_M_S**2] * 2)
        self.sensitivity = np.zeros((4, live.size + 1))
        self._considered = self._means(live)

    @staticmethod
    def _ground(live: LiveFilter, place: Array) -> float:
        return float(live.model.ground.height(place[:, None])[0][0])

    @staticmethod
    def _index(live: LiveFilter) -> Ints:
        return np.append(np.arange(live.size), live.error + 2)

    def _means(self, live: LiveFilter) -> Array:
        return np.asarray(live.mean[self._index(live)])

    def follow(self, live: LiveFilter) -> None:
        """Move with the considered parameters' means, which static targets and solves have changed."""
        means = self._means(live)
        self.state, self._considered = self.state + self.sensitivity @ (means - self._considered), means

    def predict(self, live: LiveFilter, t: float) -> None:
        """Move to the time t; the position's error wanders meanwhile."""
        dt = t - self.t
        if dt <= 0:
            return
        transition, noise = np.eye(4), np.zeros((4, 4))
        transition[0, 2] = transition[1, 3] = dt
        q = self.acceleration**2
        for axis in (0, 1):
            noise[axis, axis] = q * dt**3 / 3 + live.growth[axis] * dt
            noise[axis, axis + 2] = noise[axis + 2, axis] = q * dt**2 / 2
            noise[axis + 2, axis + 2] = q * dt
        self.state, self.sensitivity, self.t = transition @ self.state, transition @ self.sensitivity, t
        self.own = transition @ self.own @ transition.T + noise

    def update(self, live: LiveFilter, s: Sightings) -> bool:
        """Take one sighting (N = 1); False where the gate refuses it."""
        self.follow(live)
        self.predict(live, float(s.t[0]))
        index = self._index(live)
        error = np.array([[0.0], [0.0], [live.mean[live.error + 2]]])
        point = np.append(self.state[:2], self._ground(live, self.state[:2]))[:, None]
        found = project(live.poses(s, _ONE), s.rays, s.tangents, live.mean[: live.size], point, error, s.row)
        h = np.zeros((2, 4))
        h[:, :2] = found.point[:, :2, 0]
        g = common_noise(found, live.model.noise)[..., 0]
        noise = g @ g.T + np.eye(2)
        direct = np.concatenate([found.shared[..., 0], found.point[:, 2:, 0]], axis=1)  # (2, C)
        through = h @ self.sensitivity + direct
        considered = live.covariance[np.ix_(index, index)]
        innovation = h @ self.own @ h.T + through @ considered @ through.T + noise
        residual = found.residual[:, 0]
        if not found.visible[0] or float(residual @ np.linalg.solve(innovation, residual)) > GATE2:
            return False
        gain = np.linalg.solve(innovation, h @ self.own + through @ considered @ self.sensitivity.T).T  # (4, 2)
        rest = np.eye(4) - gain @ h
        self.state = self.state + gain @ residual
        self.own = rest @ self.own @ rest.T + gain @ noise @ gain.T
        self.sensitivity = self.sensitivity - gain @ through
        return True

    def relative(self, live: LiveFilter, t: float, position: Array, velocity: Array) -> tuple[Array, Array]:
        """Target minus vehicle (2,), covariance (2, 2), by the vehicle's reported position and velocity (2,) at t."""
        dt = t - self.t
        index = self._index(live)
        moved = self.state + self.sensitivity @ (self._means(live) - self._considered)
        sensitivity = self.sensitivity[:2] + dt * self.sensitivity[2:]
        sensitivity[:, POSITION_DELAY] -= velocity
        delay = float(live.mean[POSITION_DELAY])
        mean = moved[:2] + dt * moved[2:] - position - velocity * delay
        step = np.hstack([np.eye(2), dt * np.eye(2)])
        added = self.acceleration**2 * abs(dt) ** 3 / 3 + live.growth[:2] * abs(dt)
        added = added + live.wanders[0].path[0] ** 2
        covariance = step @ self.own @ step.T + np.diag(added)
        return mean, covariance + sensitivity @ live.covariance[np.ix_(index, index)] @ sensitivity.T
