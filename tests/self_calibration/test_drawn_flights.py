"""Drawn flights: time until calibrated, and the error over time, and that of a batch least-squares fit.

The fit is independent of the package: it knows the true noise, and takes all pixels so far at once. By hand, with more
flights: ``DRAWN_FLIGHTS=200 pytest -m slow -s tests/self_calibration/test_drawn_flights.py``.
"""

import os
import sys
from statistics import mean, median

import numpy as np
import pytest
from scipy.optimize import least_squares
from scipy.spatial.transform import Rotation
from simulated_flight import BODY_FROM_CAMERA, FOCAL, Flight, pixel_from_camera, priors
from simulated_world import World

from fwav_companion.self_calibration import CalibrationStatus
from fwav_companion.tracking import TrackingOptions, make_tracker
from fwav_companion.types import Bias

FLIGHTS = int(os.environ.get("DRAWN_FLIGHTS", "4"))
"""Of each kind."""
TIMES_S = (15.0, 25.0, 35.0, 44.9)
COPTER = {"pitch_deg": 0.0, "flapping_deg": 0.0, "pixel_px": 1.5, "height_m": 10.0, "seconds": 45.0}
KINDS = {
    "eight": {"seconds": 45.0},
    "turns": {"shape": "turns", "targets": ((0.0, 0.0),), "start": (-2.0, 1.0, 0.3), **COPTER},
    "descent": {
        "shape": "descent",
        "targets": ((0.0, 0.0),),
        "start": (-2.0, 1.0, 0.5),
        **COPTER,
        "height_m": 15.0,
    },
}
BIASES = (Bias.TIME_OFFSET, Bias.MOUNT_X, Bias.MOUNT_Y, Bias.MOUNT_Z, Bias.HEADING)
MOST_OF_OPTIMUM = 2.5
"""Error over that of the batch fit, in the median of the flights at the end, besides LEAST_M."""
LEAST_M = 0.015


def drawn(kind, seed):
    reported = priors(time_offset=0.02) if kind == "eight" else priors(time_offset=0.005, pixel_noise_px=1.5)
    return Flight(fps=15.0, priors=reported, **KINDS[kind]).drawn(seed)


def flown(flight):
    """(seconds until calibrated or None, (error, normalised square) at TIMES_S, the world and its frames)."""
    world, calibrated_s, seen = World(flight), None, []
    tracker = make_tracker(TrackingOptions(self_calibration=True), flight.priors, world.state_at)
    frames, left = world.frames(), list(TIMES_S)
    for k, view in enumerate(frames):
        tracks = [track for track in tracker.on_frame(view) if track.confirmed_host_ns is not None]
        if calibrated_s is None and tracker.calibration.status is CalibrationStatus.CALIBRATED:
            calibrated_s = k / flight.fps
        if left and tracks and k / flight.fps >= left[0] - 1.0 / flight.fps:
            left.pop(0)
            error = np.subtract(tracks[0].position_ned[:2], flight.targets[0])
            square = error @ np.linalg.solve(np.array(tracks[0].cov)[:2, :2], error)
            seen.append((float(np.hypot(*error)), float(square)))
    return calibrated_s, seen, world, frames


def optimum(flight, world, frames, until_s):
    """Error of the batch fit of delay, mount, heading and target to every second detection until an instant."""
    stamps = np.arange(0.0, flight.seconds, 1 / flight.fps)
    pairs = [(t, fix.sighting.detection) for t, view in zip(stamps, frames, strict=True) for fix in view.fixes]
    pairs = [pair for pair in pairs if pair[0] <= until_s][::2]
    times, pixels = np.array([t for t, _ in pairs]), np.array([(d.u, d.v) for _, d in pairs])
    sigmas = np.array([flight.priors.sigma(bias) for bias in BIASES])
    noise = np.sqrt(2.0 * (flight.pixel_px**2 + (FOCAL * flight.priors.attitude_noise) ** 2))

    def residuals(x):
        delay, mount, heading, target = x[0], x[1:4], x[4], x[5:]
        rotation, position, *_ = world.autopilot.reported(times - delay)
        true = Rotation.from_rotvec([0.0, 0.0, -heading]) * rotation
        camera = true * Rotation.from_rotvec(mount).inv() * BODY_FROM_CAMERA
        d = camera.inv().apply(np.append(target, 0.0) - position)
        return np.concatenate((((pixel_from_camera(d) - pixels) / noise).ravel(), x[:5] / sigmas))

    scale = np.append(sigmas, (0.3, 0.3))
    start = np.append(np.zeros(5), flight.targets[0])
    found = least_squares(residuals, start, x_scale=scale, loss="linear")
    return float(np.hypot(*(found.x[5:] - flight.targets[0])))


@pytest.mark.slow
@pytest.mark.parametrize("kind", KINDS)
def test_drawn_flights_end_near_the_batch_optimum_and_claim_as_much(kind, capsys):
    times, errors, squares, best = [], [], [], []
    for seed in range(1, FLIGHTS + 1):
        flight = drawn(kind, seed)
        calibrated_s, seen, world, frames = flown(flight)
        times.append(calibrated_s)
        errors.append([error for error, _ in seen])
        squares.append(seen[-1][1])
        best.append([optimum(flight, world, frames, t) for t in TIMES_S[-len(seen) :]])
    reached = [t for t in times if t is not None]
    with capsys.disabled():
        write = sys.stdout.write
        write(f"\n{kind}: {len(reached)} of {FLIGHTS} calibrated, after {median(reached):.0f} s in the median\n")
        for k in range(-min(map(len, errors)), 0):
            own, fit = median(each[k] for each in errors), median(each[k] for each in best)
            worst = max(each[k] for each in errors)
            write(f"  {TIMES_S[k]:4.0f} s: error {own:.3f} m, worst {worst:.3f}, batch fit {fit:.3f} m\n")
        write(f"  mean normalised square at the end {mean(squares) / 2.0:.2f}\n")
    assert len(reached) == FLIGHTS
    assert median(e[-1] for e in errors) < MOST_OF_OPTIMUM * median(e[-1] for e in best) + LEAST_M
    assert 0.1 < mean(squares) / 2.0 < 3.0
