"""One target in several pictures: the claim is right from both sides, and shared errors are found or named.

Truth is chosen in a flat world by scipy's rotations; every error is drawn from the sigmas that the estimate is given.
"""

from __future__ import annotations

import numpy as np
import pytest
from scipy.spatial.transform import Rotation
from scipy.stats import binom, chi2

from fwav_companion.camera import BrownConrady
from fwav_companion.tools.locate.estimate import SightError, locate
from fwav_companion.tools.locate.shots import SharedError, Shot, Sight, SightsEstimate
from fwav_companion.tools.locate.surfaces import FlatSurface

WIDTH, HEIGHT, FOCAL = 4000, 3000, 3000.0
LENS = BrownConrady((FOCAL, FOCAL), ((WIDTH - 1) / 2, (HEIGHT - 1) / 2), (), (WIDTH, HEIGHT))
SHARED = np.array([2.0, 2.0, 3.0, *np.radians([0.5, 0.5, 0.5]), np.radians(3.0), 0.01, 0.5])
OWN_M, OWN_ANGLE, RELIEF_M = 1.0, np.radians(0.3), 4.0
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


@pytest.mark.parametrize("count", [1, 5])
def test_claim_over_drawn_sets_is_right_from_both_sides(count: int) -> None:
    rng = np.random.default_rng(11)
    squares = []
    for _ in range(300):
        error, estimate = drawn_set(rng, count, 1.0)
        cov = np.array(estimate.places[0].cov)
        assert sum(part**2 for part in _parts(estimate)) == pytest.approx(np.trace(cov[:2, :2]), rel=0.02)
        squares.append(float(error[:2] @ np.linalg.inv(cov[:2, :2]) @ error[:2]))
    assert chi2.ppf(0.0005, 600) < sum(squares) < chi2.ppf(0.9995, 600)
    inside = sum(square < chi2.ppf(0.9, 2) for square in squares)
    assert binom.ppf(0.0005, 300, 0.9) <= inside <= binom.ppf(0.9995, 300, 0.9)


def _parts(estimate: SightsEstimate) -> list[float]:
    budget = estimate.places[0].budget
    return [getattr(budget, name) for name in budget.__struct_fields__]


@pytest.mark.parametrize("scale", [0.5, 2.0])
def test_errors_half_and_twice_the_claim_are_inside_or_named(scale: float) -> None:
    rng = np.random.default_rng(12)
    outcomes = []
    for _ in range(100):
        error, estimate = drawn_set(rng, 12, scale)
        cov = np.array(estimate.places[0].cov)[:2, :2]
        outcomes.append(error[:2] @ np.linalg.inv(cov) @ error[:2] < chi2.ppf(0.9, 2) or bool(estimate.contradiction))
    assert sum(outcomes) >= binom.ppf(0.0005, 100, 0.9)


def test_heading_error_of_a_flight_is_found_from_two_sides() -> None:
    heading = np.radians(6.0)
    shots, sights = [], []
    for index, azimuth in enumerate((0.0, 90.0, 180.0, 270.0)):
        at, axes = camera(azimuth, 45.0, 80.0)
        shots.append(shot(str(index), at, Rotation.from_rotvec([0, 0, heading]).as_matrix() @ axes))
        sights.append(Sight(index, seen(at, axes, np.zeros(3)), "t"))
    estimate = locate(shots, sights, FlatSurface(0.0, RELIEF_M), [tuple(SHARED)])
    assert isinstance(estimate, SightsEstimate)
    (found,) = [each for each in estimate.shared if each.error is SharedError.HEADING]
    assert found.value == pytest.approx(heading, abs=3.0 * found.sigma)
    assert np.linalg.norm(estimate.places[0].ned[:2]) < 1.0
    for sight, shown in zip(sights, estimate.places[0].residuals, strict=True):
        assert shown.pixel == pytest.approx(sight.pixel, abs=40.0)  # the heading alone moves it by 240 px


def test_delay_of_a_video_is_found_from_two_directions_of_flight() -> None:
    delay_s, shots, sights = 0.8, [], []
    for index, azimuth in enumerate((0.0, 90.0, 180.0, 270.0)):
        at, axes = camera(azimuth, 60.0, 80.0)
        across = np.radians(azimuth + (90.0 if index < 2 else -90.0))  # else the delay looks like a heading error
        velocity = np.array([10.0 * np.cos(across), 10.0 * np.sin(across), 0.0])
        shots.append(shot(str(index), at + velocity * delay_s, axes, velocity))
        sights.append(Sight(index, seen(at, axes, np.zeros(3)), "t"))
    estimate = locate(shots, sights, FlatSurface(0.0, RELIEF_M), [tuple(SHARED)])
    assert isinstance(estimate, SightsEstimate)
    (found,) = [each for each in estimate.shared if each.error is SharedError.DELAY]
    assert found.value == pytest.approx(delay_s, abs=3.0 * found.sigma)
    assert found.sigma < 0.2
    assert np.linalg.norm(estimate.places[0].ned[:2]) < 1.0


def test_wrong_click_among_pictures_is_named() -> None:
    shots, sights = [], []
    for index, azimuth in enumerate((0.0, 90.0, 180.0, 270.0)):
        at, axes = camera(azimuth, 60.0, 80.0)
        shots.append(shot(f"{index}.jpg", at, axes))
        target = np.array([40.0, 0.0, 0.0]) if index == 2 else np.zeros(3)
        sights.append(Sight(index, seen(at, axes, target), "t"))
    estimate = locate(shots, sights, FlatSurface(0.0, RELIEF_M), [tuple(SHARED)])
    assert isinstance(estimate, SightsEstimate)
    assert "2.jpg agrees least" in estimate.contradiction
    assert estimate.scaled_by > 1.5


def test_two_targets_in_one_picture_share_its_errors() -> None:
    """Their places are correlated: the distance between them is known far better than either."""
    at, axes = camera(0.0, 60.0, 80.0)
    targets = {"a": np.zeros(3), "b": np.array([0.0, 3.0, 0.0])}
    sights = [Sight(0, seen(at, axes, target), label) for label, target in targets.items()]
    estimate = locate([shot("0", at, axes)], sights, FlatSurface(0.0, 0.01), [tuple(SHARED)])
    assert isinstance(estimate, SightsEstimate)
    assert [place.label for place in estimate.places] == ["a", "b"]
    for place, target in zip(estimate.places, targets.values(), strict=True):
        assert place.ned == pytest.approx(tuple(target), abs=1e-3)


@pytest.mark.parametrize(("below_deg", "reason"), [(-5.0, "above_horizon"), (1.0, "near_horizon")])
def test_ray_near_the_horizon_gives_its_reason(below_deg: float, reason: str) -> None:
    axes = Rotation.from_euler("ZYX", [0.0, -below_deg, 0.0], degrees=True).as_matrix() @ FORWARD
    middle = ((WIDTH - 1) / 2, (HEIGHT - 1) / 2)
    found = locate(
        [shot("a", np.array([0.0, 0.0, -50.0]), axes)], [Sight(0, middle, "t")], FlatSurface(0.0, 4.0), [tuple(SHARED)]
    )
    assert isinstance(found, SightError)
    assert found.reason == reason
