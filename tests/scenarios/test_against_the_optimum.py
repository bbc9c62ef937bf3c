"""The tracker against the optimum: a Kalman filter that is given the association, the noise and the motion.

Without biases no filter of the same fixes is better on average. Those that a flight does not show would hide the rest.
"""

from dataclasses import replace

import numpy as np
import pytest
from simulated_flight import Flight, priors
from simulated_world import World

from fwav_companion.tracking import TrackingOptions, make_tracker
from fwav_companion.tracking.filters.moving import ACCELERATION_DENSITY, START_SPEED_M_S

NO_BIAS = {"time_offset": 0.0, "mount_x": 0.0, "mount_y": 0.0, "mount_z": 0.0, "heading": 0.0}
ERRORS = priors(**NO_BIAS, attitude_noise=0.0, height_noise_m=0.0)
SEEDS = range(8)
STEADY_S = 5.0
"""Errors count from then on."""
STILL = Flight(seconds=30.0, shape="hover", height_m=20.0, pitch_deg=0.0, flapping_deg=0.0, stamp_late_s=0.0,
               targets=((3.0, -2.0),), priors=ERRORS, miss=0.1)  # fmt: skip


class Moved(World):
    """A world whose target is accelerated by white noise of a density, m^2/s^3."""

    def __init__(self, flight, density):
        super().__init__(flight)
        rng, self.t = np.random.default_rng(500 + flight.seed), np.arange(-1.0, flight.seconds + 1.0, 0.01)
        steps = rng.normal(0.0, np.sqrt(0.01 * density), (len(self.t), 2)) if density else np.zeros((len(self.t), 2))
        self.places = flight.targets[0] + np.cumsum(np.cumsum(steps, 0), 0) * 0.01

    def at(self, instants):
        """Places at the instants."""
        return np.stack([np.interp(instants, self.t, axis) for axis in self.places.T], -1)

    def _places(self, target, velocity, capture):
        return np.column_stack([self.at(capture), 0.0 * capture])


class Optimum:
    """Place and velocity, horizontal."""

    def __init__(self, density):
        self.density, self.t, speed = density, 0.0, START_SPEED_M_S if density else 0.0
        self.x, self.cov = np.zeros(4), np.diag([1e4, 1e4, speed**2, speed**2])

    def predict(self, t):
        """Move on to an instant."""
        dt = t - self.t
        move = np.eye(4) + dt * np.eye(4, k=2)
        self.x, self.cov, self.t = move @ self.x, move @ self.cov @ move.T, t
        axes = self.density * np.array([[dt**3 / 3, dt**2 / 2], [dt**2 / 2, dt]])
        self.cov += np.kron(axes, np.eye(2))

    def update(self, fix):
        """Take a fix of the target."""
        h = np.eye(2, 4)
        expected = h @ self.cov @ h.T + np.array(fix.noise_cov)[:2, :2]
        gain = self.cov @ h.T @ np.linalg.inv(expected)
        self.x = self.x + gain @ (np.array(fix.position_ned[:2]) - h @ self.x)
        self.cov = self.cov - gain @ expected @ gain.T


def own_fix(fixes, place):
    """The fix of the target: within five sigma of it; None where the frame missed it."""
    for fix in fixes:
        off = np.array(fix.position_ned[:2]) - place
        if off @ np.linalg.solve(np.array(fix.noise_cov)[:2, :2], off) < 25.0:
            return fix
    return None


def errors(flight, density, motion):
    """Distances from the target of the tracker's and of the optimum's place, frame by frame with a fix of both."""
    world, tracker, optimum = Moved(flight, density), make_tracker(TrackingOptions(motion=motion), ERRORS), None
    found = []
    for view in world.frames():
        t = view.frame / flight.fps
        place, tracks = world.at(t), tracker.on_frame(view)
        fix = own_fix(view.fixes, place)
        if fix is None:
            continue
        optimum = optimum or Optimum(density)
        optimum.predict(t)
        optimum.update(fix)
        own = [
            np.hypot(*(track.position_ned[:2] - place))
            for track in tracks
            if track.fix is fix and track.confirmed_host_ns is not None
        ]
        if own and t > STEADY_S:
            found.append((own[0], np.hypot(*(optimum.x[:2] - place))))
    return found


@pytest.mark.slow
@pytest.mark.parametrize(
    ("name", "changes", "density", "motion"),
    [
        ("static", {}, 0.0, "static"),
        ("clutter", {"clutter": 0.5}, 0.0, "static"),
        ("walker", {}, ACCELERATION_DENSITY, "moving"),
    ],
)
def test_the_error_is_within_a_tenth_of_the_optimum(name, changes, density, motion):
    flights = [replace(STILL, seed=seed, **changes) for seed in SEEDS]
    found = np.array([each for flight in flights for each in errors(flight, density, motion)])
    own_m, best_m = np.sqrt(np.mean(found**2, axis=0))
    print(f"{name}: {own_m:.4f} m, the optimum {best_m:.4f} m, {own_m / best_m:.3f} times as much, {len(found)} fixes")  # noqa: T201 - the figures are wanted
    assert len(found) > 2500
    assert 0.9 < own_m / best_m < 1.1
