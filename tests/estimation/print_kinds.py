"""Prints the relative error and the normalised squares of flight kinds, true labels: print_kinds.py SEEDS KIND..."""

import sys
from pathlib import Path

import numpy as np

sys.path.insert(0, str(Path(__file__).parents[1] / "support"))

from estimated_flights import Planted, flown
from simulated_flight import Flight, path

from fwav_companion.estimation.errors import SampleNoise, priors

PRIORS = priors(heading_rad=np.radians(2.0), tilt_rad=np.radians(0.5))
LATE = np.array([0.035, 0.02, -0.01, 0.015, *[0.0] * 9])
FIVE, TEN = ((8.0, 3.0), (10.0, -2.0), (6.0, 0.0), (12.0, 4.0), (9.0, -5.0)), (-12.0, -4.0, 4.0, 12.0, 18.0)
DESCENT = {"shape": "descent", "height_m": 15.0, "targets": ((0.3, 0.2),), "pitch_deg": 0.0, "seconds": 45.0}
KINDS = {  # flight, wander m, jump m, s between frames
    "eight": ({}, 0.0, 0.0, 0.0),
    "eight d": ({}, 0.0, 0.0, 0.0),
    "eight w": ({}, 1.0, 0.0, 0.0),
    "descent": (DESCENT, 0.0, 0.0, 0.0),
    "descent w": (DESCENT, 1.0, 0.0, 0.0),
    "descent j": (DESCENT, 0.0, 0.4, 0.0),
    "hover 1": ({"shape": "hover", "targets": FIVE[:1]}, 1.0, 0.0, 0.0),
    "hover 5": ({"shape": "hover", "targets": FIVE}, 1.0, 0.0, 0.0),
    "ten": ({"targets": tuple((n, e) for n in TEN for e in (-4.0, 4.0))}, 1.0, 0.0, 0.0),
    "photographs": ({"seconds": 240.0, "targets": tuple((n, e) for n in TEN for e in (-4.0, 4.0))}, 1.0, 0.0, 4.0),
}


def one(kind, seed):
    """(rms m, mean normalised square) of all targets after 30 % of the flight."""
    shape, wander, jump, period = KINDS[kind]
    shape = {"seconds": 40.0, "seed": seed, "targets": ((2.0, 3.0),), **shape}
    count = len(shape["targets"])
    flight = Flight(**shape, velocities=((0.0, 0.0),) * count, labels=("",) * count)
    drawn = np.random.default_rng(seed).standard_normal(13) * PRIORS.sigma
    errors = {"eight": LATE, "eight d": drawn}.get(kind, np.zeros(13))
    planted = Planted(flight, errors, wander_m=wander, jump_m=jump, period_s=period)
    found = []

    def observe(estimator, t):
        camera = path(flight, np.array([t]))[0][0]
        for number, target in enumerate(flight.targets):
            answer = estimator.answer(number, t) if t > 0.3 * flight.seconds else None
            if answer is not None:
                d = np.array(target) - camera[:2] - answer.relative[:2]
                found.append((d @ d, d @ np.linalg.solve(answer.relative_covariance[:2, :2], d)))

    noise = SampleNoise(
        attitude_rad=planted.attitude_noise, position_wander_m=wander, height_wander_m=0.35 if wander else 0.0
    )
    flown(planted, PRIORS, noise, observe=observe)
    squares = np.mean(found, axis=0)
    return float(np.sqrt(squares[0])), float(squares[1])


if __name__ == "__main__":
    for name in sys.argv[2:] or KINDS:
        rows = np.array([one(name, seed) for seed in range(1, int(sys.argv[1]) + 1)])
        median, worst = np.median(rows, axis=0), rows.max(0)
        print(f"{name:12} {median[0]:.3f} / {worst[0]:.3f} m   squares {median[1]:.2f} / {worst[1]:.2f}", flush=True)
