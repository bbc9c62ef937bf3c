"""Filters of one target for the tracker's own questions, in numpy: the mean of all fixes, and constant velocity.

They follow the protocol of a filter of one's own. They know no biases: a fix has the noise that it states.
"""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np

from fwav_companion.tracking.filters.base import GATE
from fwav_companion.tracking.filters.filter_tracker import FilterTracker
from fwav_companion.types.tracks import OUTSIDE_GATE, GateResult

ACCELERATION_DENSITY = 0.03
"""Spectral density of the acceleration, m^2/s^3."""
UNSEEN_DENSITY, UNSEEN_S = 0.5, 1.0
"""The same of a target that was not seen for so many seconds: it may have turned."""
START_SPEED_M_S = 3.0


@dataclass(frozen=True)
class PlainState:
    """North, east and their velocities; without motion, only the first two change."""

    x: np.ndarray
    p: np.ndarray
    down_m: float
    t_ns: int
    fixed_ns: int
    moves: bool

    @property
    def position_ned(self):
        """Place, NED, metres."""
        return (float(self.x[0]), float(self.x[1]), self.down_m)

    @property
    def cov(self):
        """Covariance of the place, m^2."""
        (nn, ne), (en, ee) = self.p[:2, :2].tolist()
        return ((nn, ne, 0.0), (en, ee, 0.0), (0.0, 0.0, 0.01))

    @property
    def apparent_ned(self):
        """The place: the vehicle's position is exact."""
        return self.position_ned

    @property
    def relative_cov(self):
        """Covariance of the place, m^2."""
        return self.cov

    @property
    def velocity_ned(self):
        """Velocity, NED, m/s; None of what stays."""
        return (float(self.x[2]), float(self.x[3]), 0.0) if self.moves else None

    @property
    def velocity_cov(self):
        """Covariance of the velocity, (m/s)^2; None of what stays."""
        if not self.moves:
            return None
        (nn, ne), (en, ee) = self.p[2:, 2:].tolist()
        return ((nn, ne, 0.0), (en, ee, 0.0), (0.0, 0.0, 0.0))

    def predict(self, host_ns):
        """The state at a later instant."""
        dt = (host_ns - self.t_ns) * 1e-9
        if not self.moves or dt <= 0.0:
            return replace(self, t_ns=host_ns)
        move = np.eye(4) + dt * np.eye(4, k=2)
        density = ACCELERATION_DENSITY if (host_ns - self.fixed_ns) * 1e-9 < UNSEEN_S else UNSEEN_DENSITY
        axes = density * np.array([[dt**3 / 3, dt**2 / 2], [dt**2 / 2, dt]])
        return replace(self, x=move @ self.x, p=move @ self.p @ move.T + np.kron(axes, np.eye(2)), t_ns=host_ns)

    def gate(self, fix):
        """Gating statistics of a fix."""
        noise, off = np.array(fix.noise_cov)[:2, :2], np.array(fix.position_ned[:2]) - self.x[:2]
        if off @ off > GATE * (np.trace(self.p[:2, :2]) + np.trace(noise)):
            return OUTSIDE_GATE
        cov = self.p[:2, :2] + noise
        ratio = np.linalg.det(cov) / np.linalg.det(noise)
        return GateResult(float(off @ np.linalg.solve(cov, off)), float(np.log(ratio)))

    def update(self, fix):
        """The state after a fix."""
        h, noise = np.eye(2, 4), np.array(fix.noise_cov)[:2, :2]
        gain = self.p @ h.T @ np.linalg.inv(h @ self.p @ h.T + noise)
        x, p = self.x + gain @ (np.array(fix.position_ned[:2]) - self.x[:2]), self.p - gain @ h @ self.p
        return replace(self, x=x, p=0.5 * (p + p.T), fixed_ns=fix.sighting.frame_host_ns)


class PlainFilter:
    """Begins targets."""

    def __init__(self, *, moves: bool) -> None:
        self.moves = moves

    def initiate(self, fix):
        """The state after the first fix."""
        p = np.zeros((4, 4))
        p[:2, :2] = np.array(fix.noise_cov)[:2, :2]
        p[2:, 2:] = START_SPEED_M_S**2 * np.eye(2) * self.moves
        x = np.array([*fix.position_ned[:2], 0.0, 0.0])
        now_ns = fix.sighting.frame_host_ns
        return PlainState(x, p, fix.position_ned[2], now_ns, now_ns, self.moves)


def plain_tracker(motion="static"):
    """The tracker by the mean of all fixes, or by constant velocity."""
    return FilterTracker(PlainFilter(moves=motion == "moving"))
