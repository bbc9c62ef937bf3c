"""Sets of pictures of one target with drawn errors, and a table of how often the truth is in the claim.

    python -m tests.locate.drawn_sets [SETS] [SEED]

Truth is chosen in a flat world by scipy's rotations; every error is drawn from the sigmas that the estimate is given,
times a scale. The table has sets of 1 to 20 pictures with half, once and twice the assumed errors; `named` are those
whose answer says that its pictures contradict one another, or that they are too few to show the scale of their errors.
"""

# ruff: noqa: T201

from __future__ import annotations

import sys

import numpy as np
from scipy.spatial.transform import Rotation
from scipy.stats import chi2

from fwav_companion.camera import BrownConrady
from fwav_companion.tools.locate.estimate import locate
from fwav_companion.tools.locate.shots import Shot, Sight, SightsEstimate
from fwav_companion.tools.locate.surfaces import FlatSurface

WIDTH, HEIGHT, FOCAL = 4000, 3000, 3000.0
LENS = BrownConrady((FOCAL, FOCAL), ((WIDTH - 1) / 2, (HEIGHT - 1) / 2), (), (WIDTH, HEIGHT))
SHARED = np.array([2.0, 2.0, 3.0, *np.radians([0.5, 0.5, 0.5]), np.radians(3.0), 0.01, 0.5])
OWN_M, OWN_ANGLE, RELIEF_M = 1.0, np.radians(0.3), 4.0
PICTURES = (1, 2, 3, 4, 8, 12, 20)
FORWARD = np.array([[0.0, 0.0, 1.0], [1.0, 0.0, 0.0], [0.0, 1.0, 0.0]])


def camera(azimuth_deg: float, below_deg: float, height_m: float) -> tuple[np.ndarray, np.ndarray]:
    """Position and ned_from_camera of a camera that looks at the origin from this side."""
    away = height_m / np.tan(np.radians(below_deg))
    at = np.array([-away * np.cos(np.radians(azimuth_deg)), -away * np.sin(np.radians(azimuth_deg)), -height_m])
    return at, Rotation.from_euler("ZYX", [azimuth_deg, -below_deg, 0.0], degrees=True).as_matrix() @ FORWARD


def seen(at: np.ndarray, axes: np.ndarray, target: np.ndarray, focal: float = FOCAL) -> tuple[float, float]:
    x, y, z = axes.T @ (target - at)
    return focal * x / z + (WIDTH - 1) / 2, focal * y / z + (HEIGHT - 1) / 2


STILL = np.zeros(3)


def shot(name: str, at: np.ndarray, axes: np.ndarray, velocity: np.ndarray = STILL, turn: np.ndarray = STILL) -> Shot:
    return Shot(
        velocity_ned=tuple(map(float, velocity)), turn=tuple(map(float, turn)),
        name=name, camera_ned=tuple(map(float, at)), ned_from_camera=tuple(tuple(map(float, row)) for row in axes),
        lens=LENS, own_position_m=OWN_M, own_height_m=OWN_M, own_attitude=float(OWN_ANGLE),
    )  # fmt: skip


def drawn_set(rng: np.random.Generator, count: int, scale: float) -> tuple[np.ndarray, SightsEstimate]:
    """(error of the place, the estimate) of one target in ``count`` pictures; shared errors are one draw for all."""
    target = np.array([*rng.uniform(-5, 5, 2), rng.normal() * RELIEF_M])
    shared = rng.normal(size=9) * SHARED * scale
    shots, sights = [], []
    while len(shots) < count:
        at, axes = camera(rng.uniform(0, 360), rng.uniform(40, 90), rng.uniform(40, 120))
        own = rng.normal(size=6) * np.array([OWN_M] * 3 + [OWN_ANGLE] * 3) * scale
        u, v = np.array(seen(at, axes, target, FOCAL / (1.0 + shared[7]))) + rng.normal(size=2)
        if not (0 <= u < WIDTH and 0 <= v < HEIGHT):
            continue
        velocity, turn = rng.normal(size=3) * (3.0, 3.0, 0.5), rng.normal(size=3) * np.radians(2.0)
        moved = at + np.array([shared[0] + own[0], shared[1] + own[1], -(shared[2] + own[2])]) + velocity * shared[8]
        turned = Rotation.from_rotvec([0, 0, shared[6]]).as_matrix() @ axes
        turned = turned @ Rotation.from_rotvec(shared[3:6] + own[3:] + turn * shared[8]).as_matrix()
        shots.append(shot(str(len(shots)), moved, turned, velocity, turn))
        sights.append(Sight(len(shots) - 1, (u, v), "t"))
    estimate = locate(shots, sights, FlatSurface(0.0, RELIEF_M), [tuple(SHARED)])
    assert isinstance(estimate, SightsEstimate)
    return np.array(estimate.places[0].ned) - target, estimate


def print_table(sets: int, seed: int) -> None:
    print("pictures  errors  inside 90 %  inside 95 %  named  inside 90 % or named  scale found")
    for count in PICTURES:
        for scale in (0.5, 1.0, 2.0):
            rng = np.random.default_rng([seed, count, int(2 * scale)])
            squares, named, found = [], [], []
            for _ in range(sets):
                error, estimate = drawn_set(rng, count, scale)
                cov = np.array(estimate.places[0].cov)[:2, :2]
                squares.append(float(error[:2] @ np.linalg.inv(cov) @ error[:2]))
                named.append(bool(estimate.contradiction or estimate.unverified))
                found.append(estimate.error_scale)
            inside = np.array(squares) < chi2.ppf(0.9, 2)
            wider = np.array(squares) < chi2.ppf(0.95, 2)
            shares = [np.mean(each) for each in (inside, wider, named, inside | np.array(named))]
            print(
                f"{count:8d}  x {scale:<4g}  {shares[0]:11.1%}  {shares[1]:11.1%}  {shares[2]:5.0%}  {shares[3]:20.1%}"
                f"  {np.mean(found):11.2f}",
                flush=True,
            )


if __name__ == "__main__":
    print_table(int(sys.argv[1]) if len(sys.argv) > 1 else 1000, int(sys.argv[2]) if len(sys.argv) > 2 else 1)
