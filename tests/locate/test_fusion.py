"""One target in several pictures: the claim is right from both sides, and shared errors are found or named."""

from __future__ import annotations

import msgspec
import numpy as np
import pytest
from scipy.spatial.transform import Rotation
from scipy.stats import binom, chi2

from fwav_companion.tools.locate.estimate import SightError, locate
from fwav_companion.tools.locate.shots import SharedError, Sight, SightsEstimate
from fwav_companion.tools.locate.surfaces import FlatSurface
from tests.locate.drawn_sets import FORWARD, HEIGHT, RELIEF_M, SHARED, WIDTH, camera, drawn_set, seen, shot


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


@pytest.mark.parametrize(("count", "who"), [(1, "1 picture cannot show whether its"), (3, "3 pictures cannot")])
def test_few_pictures_say_that_they_cannot_show_larger_errors(count: int, who: str) -> None:
    _, estimate = drawn_set(np.random.default_rng(13), count, 1.0)
    assert estimate.unverified.startswith(who)


def test_one_picture_has_the_claim_of_the_assumed_errors() -> None:
    _, estimate = drawn_set(np.random.default_rng(13), 1, 3.0)
    assert estimate.error_scale == pytest.approx(1.0, abs=0.005)


@pytest.mark.parametrize("scale", [1.0, 2.0])
def test_many_pictures_show_the_scale_of_their_errors(scale: float) -> None:
    rng = np.random.default_rng(14)
    estimates = [drawn_set(rng, 20, scale)[1] for _ in range(8)]
    assert not any(each.unverified for each in estimates)
    assert np.mean([each.error_scale for each in estimates]) == pytest.approx(scale, rel=0.15)


def test_pictures_that_agree_do_not_show_that_their_shared_errors_are_small() -> None:
    """Twenty sights from one place and attitude, whose errors are all shared: the claim is that of the assumed ones."""
    at, axes = camera(0.0, 60.0, 80.0)
    middle = ((WIDTH - 1) / 2, (HEIGHT - 1) / 2)
    sights = [Sight(number, middle, "t") for number in range(20)]
    found = locate([shot(str(n), at, axes) for n in range(20)], sights, FlatSurface(0.0, RELIEF_M), [tuple(SHARED)])
    assert isinstance(found, SightsEstimate)
    assert found.error_scale < 0.7
    assert found.places[0].budget.shared_position == pytest.approx(np.hypot(SHARED[0], SHARED[1]), rel=0.01)


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


@pytest.mark.parametrize(
    ("exact", "said"), [(False, "the ellipse is widened"), (True, "the ellipse does not hold that")]
)
def test_wrong_click_among_pictures_is_named_and_widens_what_is_not_given_as_exact(exact: bool, said: str) -> None:
    shots, sights = [], []
    for index, azimuth in enumerate((0.0, 90.0, 180.0, 270.0)):
        at, axes = camera(azimuth, 60.0, 80.0)
        taken = shot(f"{index}.jpg", at, axes)
        own = {"own_position_m": 0.0, "own_height_m": 0.0, "own_attitude": 0.0} if exact else {}
        shots.append(msgspec.structs.replace(taken, **own))
        target = np.array([40.0, 0.0, 0.0]) if index == 2 else np.zeros(3)
        sights.append(Sight(index, seen(at, axes, target), "t"))
    shared = np.zeros_like(SHARED) if exact else SHARED
    estimate = locate(shots, sights, FlatSurface(0.0, RELIEF_M), [tuple(shared)])
    assert isinstance(estimate, SightsEstimate)
    assert "2.jpg agrees least" in estimate.contradiction
    assert said in estimate.contradiction
    assert (estimate.error_scale > 1.5) is not exact


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
