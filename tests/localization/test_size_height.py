"""The height by a ground model and by the size of a tag, and the fix at it."""

from math import hypot

import msgspec
import numpy as np
import pytest
from true_flights import LEVEL_PRIORS, Scene

from fwav_companion.localization import FixedGround, HomeGround, Localizer, RangefinderGround
from fwav_companion.localization.size_height import SizeHeights
from fwav_companion.types import Bias, GroundFix, NoFix, Reason, SizeHeight

HEIGHT_NOISE_M, HEIGHT_BIAS_M = LEVEL_PRIORS.height_noise_m, LEVEL_PRIORS.sigma(Bias.HEIGHT)


def low(too_high_m=0.0, height_m=5.0, size=True, noise_m=0.03, **scene):
    """A sighting from 5 m whose reported height is too large, with the height by a tag's size."""
    bias = np.zeros(len(Bias))
    bias[Bias.HEIGHT] = too_high_m
    seen = Scene(
        pitch_deg=4.0, roll_deg=-3.0, height_m=height_m, target=(1.5, 1.0), pixel_sigma=(0.3, 0.3),
        position_sigma_m=0.0, **scene,
    ).sighting(bias)  # fmt: skip
    by_size = SizeHeight(height_m - seen.anchor_height_m, noise_m, 0.01) if size else None
    return msgspec.structs.replace(seen, size_height=by_size)


def located(sighting, ground=None, **kinds):
    localizer = Localizer(ground or HomeGround(), LEVEL_PRIORS, **({"min_height_m": 0.5} | kinds))
    return localizer.locate(sighting)


def off_m(fix, scene_target=(1.5, 1.0), vehicle=(100.0, -50.0)):
    return hypot(*(np.array(fix.position_ned[:2]) - np.add(scene_target, vehicle)))


@pytest.mark.parametrize("too_high_m", [-2.0, 2.0])
def test_fix_of_a_near_tag_is_at_the_height_of_its_size(too_high_m):
    assert off_m(located(low(too_high_m, size=False))) > 0.5
    fix = located(low(too_high_m))
    assert off_m(fix) < 0.03
    assert fix.position_ned[2] == pytest.approx(0.0, abs=1e-9)
    assert fix.best_height_m == pytest.approx(5.0, abs=0.03)


def test_height_of_many_pictures_is_the_optimum_of_both_measurements():
    """numpy, in one batch: a constant error with its prior, and n pictures of both heights."""
    rng, heights, n, true_m, error_m = np.random.default_rng(3), SizeHeights(LEVEL_PRIORS), 25, 8.0, 0.7
    by_ground = true_m + error_m + rng.normal(0.0, HEIGHT_NOISE_M, n)
    by_size = true_m + rng.normal(0.0, 0.25, n)
    for ground_m, size_m in zip(by_ground, by_size, strict=True):
        size = SizeHeight(float(size_m), 0.25, 0.0)
        fused = heights.fused(
            "a", 0, size, ground_m=float(ground_m), noise_m2=HEIGHT_NOISE_M**2, bias_m2=HEIGHT_BIAS_M**2
        )
    variance = HEIGHT_NOISE_M**2 + 0.25**2
    weight = n / variance / (n / variance + 1.0 / HEIGHT_BIAS_M**2)
    assert fused.too_high_m == pytest.approx(weight * np.mean(by_ground - by_size), abs=1e-9)
    # The last picture's height: unknown errors and heights in one least squares.
    rows, right, sigma = [], [], []
    for k in range(n):
        at = np.eye(n)[k]
        rows += [np.append(at, 1.0), np.append(at, 0.0)]
        right += [by_ground[k], by_size[k]]
        sigma += [HEIGHT_NOISE_M, 0.25]
    rows.append(np.append(np.zeros(n), 1.0))
    right.append(0.0)
    sigma.append(HEIGHT_BIAS_M)
    a, b = np.array(rows) / np.array(sigma)[:, None], np.array(right) / np.array(sigma)
    solution, *_ = np.linalg.lstsq(a, b, rcond=None)
    cov = np.linalg.inv(a.T @ a)
    assert fused.height_m == pytest.approx(solution[n - 1], abs=1e-6)
    assert hypot(fused.noise_m, fused.bias_m) == pytest.approx(np.sqrt(cov[n - 1, n - 1]), rel=1e-6)


HEIGHTS_M = {"descent": np.linspace(9.0, 2.0, 12), "hover": np.full(300, 8.0)}


@pytest.mark.parametrize("flight", HEIGHTS_M)
def test_claims_of_drawn_heights_are_honest(flight):
    """A hover of ten seconds averages the noise, and not the scale of the print."""
    rng, squares = np.random.default_rng(6), []
    for _ in range(400 if flight == "descent" else 120):
        heights, error_m = SizeHeights(LEVEL_PRIORS), rng.normal(0.0, HEIGHT_BIAS_M)
        scale = 1.0 + rng.normal(0.0, 0.01)
        for height_m in HEIGHTS_M[flight].tolist():
            sigma_m = 0.003 * height_m**2
            size = SizeHeight(float(height_m * scale + rng.normal(0.0, sigma_m)), sigma_m, 0.01)
            ground_m = float(height_m + error_m + rng.normal(0.0, HEIGHT_NOISE_M))
            fused = heights.fused("a", 0, size, ground_m=ground_m, noise_m2=HEIGHT_NOISE_M**2, bias_m2=HEIGHT_BIAS_M**2)
        squares.append(((fused.height_m - height_m) / hypot(fused.noise_m, fused.bias_m)) ** 2)
    assert 0.7 < np.mean(squares) < 1.3


def test_barometer_that_drifts_is_followed():
    """By 1.5 m in a minute after a minute: propeller wash, and the weather."""
    heights = SizeHeights(LEVEL_PRIORS)
    for second in range(120):
        error_m = 0.025 * max(0, second - 60)
        for tenth in range(10):
            size = SizeHeight(6.0, 0.2, 0.01)
            fused = heights.fused(
                "a", round((second + 0.1 * tenth) * 1e9), size, ground_m=6.0 + error_m, noise_m2=0.01, bias_m2=0.25
            )
    assert fused.too_high_m == pytest.approx(1.475, abs=0.25)


def test_far_tag_changes_little():
    """At 40 m a tag's size is 3 m uncertain."""
    with_size = msgspec.structs.replace(Scene().sighting(), size_height=SizeHeight(44.0, 3.0, 0.01))
    plain, fixed = located(Scene().sighting()), located(with_size)
    assert hypot(*np.subtract(plain.position_ned, fixed.position_ned)) < 0.3


def test_claim_shrinks_with_the_size():
    plain, sized = located(low(size=False)), located(low())
    assert sized.cov[0][0] < plain.cov[0][0]
    assert sized.budget.height < 0.25 * plain.budget.height


def test_height_by_the_size_alone_where_the_ground_has_none():
    def without_height(sighting):
        state = msgspec.structs.replace(sighting.state, height_above_home_m=None)
        return msgspec.structs.replace(sighting, state=state, camera_height_above_home_m=None)

    seen = without_height(low(relative=True))
    refusal = located(without_height(low(relative=True, size=False)))
    assert isinstance(refusal, NoFix)
    assert refusal.reason is Reason.NO_HEIGHT
    fix = located(seen)
    assert isinstance(fix, GroundFix)
    assert fix.ground == "size"
    assert off_m(fix, vehicle=(0.0, 0.0)) < 0.03


def test_rangefinder_that_reads_too_short_is_corrected():
    """It reads a bush of a metre below the vehicle."""
    seen = low(beam=(0.0, 0.0, 1.0))
    state = seen.state
    short = msgspec.structs.replace(state.range, distance_m=state.range.distance_m - 1.0)
    bush = msgspec.structs.replace(seen, state=msgspec.structs.replace(state, range=short))
    ground = RangefinderGround(0.05)
    assert off_m(located(msgspec.structs.replace(bush, size_height=None), ground)) > 0.25
    assert off_m(located(bush, ground)) < 0.03


def test_tag_on_a_thing_is_at_its_own_height():
    """Half a metre above the ground: the size says the height above the tag, and the fix is its foot."""
    fix = located(low(1.0, rises=(0.5, 0.05)))
    assert fix.best_height_m == pytest.approx(4.5, abs=0.03)
    assert off_m(fix) < 0.03
    assert fix.position_ned[2] == pytest.approx(0.0, abs=1e-9)


def test_tag_of_known_size_is_located_below_the_least_height():
    assert located(low(height_m=0.3, size=False)).reason is Reason.TOO_LOW
    fix = located(low(height_m=0.3))
    assert off_m(fix) < 0.03
    assert fix.height_above_target_m == fix.best_height_m
    assert located(low(height_m=0.01), FixedGround(0.01)).reason is Reason.TOO_LOW


def test_pad_below_a_barometers_ground_is_located_by_its_size():
    seen = low(too_high_m=-0.5, height_m=0.3)
    assert located(msgspec.structs.replace(seen, size_height=None)).reason is Reason.TOO_LOW
    assert off_m(located(seen)) < 0.03


@pytest.mark.parametrize(
    "reads_m", [4.5, 5.0, None], ids=["the pad", "the water next to it", "its maximum, no reading"]
)
def test_pad_on_a_deck_is_at_its_own_height_whatever_the_rangefinder_reads(reads_m):
    """The deck is 0.5 m above the water, the vehicle 5 m, and its barometer a metre off."""
    seen = low(1.0, rises=(0.5, 0.05), beam=(0.0, 0.0, 1.0))
    cosine = seen.state.range.distance_m / 5.0
    reading = None if reads_m is None else msgspec.structs.replace(seen.state.range, distance_m=reads_m * cosine)
    fix = located(
        msgspec.structs.replace(seen, state=msgspec.structs.replace(seen.state, range=reading)), RangefinderGround(0.05)
    )
    assert fix.best_height_m == pytest.approx(4.5, abs=0.05)
    assert off_m(fix) < 0.04
