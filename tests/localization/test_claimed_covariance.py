"""The whole covariance and its budget by cause: sums of their parts, and claims held against drawn truths."""

import msgspec
import numpy as np
import pytest
from draws import first_of
from scipy.stats import chi2
from true_flights import LEVEL_PRIORS as PRIORS
from true_flights import SCENES, Scene, every_scene, home, scaled_priors

from fwav_companion.localization import FixedGround, HomeGround, Localizer, RangefinderGround
from fwav_companion.types import BIAS_COUNT, Bias, GroundFix, NoFix, Reason


def sigmas(fix):
    """The budget by cause; 0 for one that it has not."""
    return {name: sigma or 0.0 for name, sigma in msgspec.structs.asdict(fix.budget).items()}


@every_scene
def test_the_total_is_the_sum_of_its_named_parts(scene):
    fix = home().locate(scene.sighting())
    jacobian = np.array(fix.bias_jacobian)
    level = np.diag([0.0, 0.0, fix.level_sigma_m**2])
    biases = jacobian.T @ np.diag(np.square(PRIORS.bias_sigmas)) @ jacobian

    assert np.array(fix.cov) == pytest.approx(np.array(fix.noise_cov) + biases + level, rel=1e-9)
    place = jacobian[[Bias.POSITION_NORTH, Bias.POSITION_EAST]]
    delay = PRIORS.sigma(Bias.POSITION_DELAY) * jacobian[Bias.POSITION_DELAY]
    noise = 0.0 if scene.relative else PRIORS.position_noise_m**2 + scene.position_sigma_m**2
    without = np.array(fix.cov) - place.T @ place * (1.0 + noise) - np.outer(delay, delay)
    assert np.array(fix.relative_cov) == pytest.approx(without, rel=1e-9, abs=1e-12)
    assert np.sum(np.square(list(sigmas(fix).values()))) == pytest.approx(np.trace(np.array(fix.cov)[:2, :2]), rel=1e-9)
    assert np.linalg.eigvalsh(np.array(fix.cov)).min() > 0.0
    assert np.linalg.eigvalsh(np.array(fix.noise_cov)).min() > 0.0
    assert fix.bias_jacobian[Bias.TERRAIN] == (0.0, 0.0, 0.0), "terrain_m counts only for an elevation model"


def with_height_bias(scene: Scene, sigma_m: float | None):
    """The sighting where a sensor states one sigma of the vehicle's height above home."""
    sighting = scene.sighting()
    return msgspec.structs.replace(sighting, state=msgspec.structs.replace(sighting.state, height_bias_m=sigma_m))


def test_barometers_sigma_replaces_the_prior_of_the_height_above_home():
    """A height error moves the foot along the ground by its tangent, in every fix alike."""
    scene, sigma_m = SCENES["relative"], 1.3
    usual, by_barometer = (home().locate(with_height_bias(scene, each)) for each in (None, sigma_m))
    column, prior_m = np.array(usual.bias_jacobian[Bias.HEIGHT])[:2], PRIORS.sigma(Bias.HEIGHT)
    assert np.hypot(*column) == pytest.approx(np.hypot(*scene.target) / scene.height_m, rel=1e-6)
    more = np.array(by_barometer.cov)[:2, :2] - np.array(usual.cov)[:2, :2]
    assert more == pytest.approx((sigma_m**2 - prior_m**2) * np.outer(column, column), rel=1e-9, abs=1e-12)
    assert by_barometer.noise_cov == usual.noise_cov, "it does not average out"
    scaled = np.array(by_barometer.bias_jacobian[Bias.HEIGHT])[:2]
    assert scaled == pytest.approx(column * sigma_m / prior_m)


@pytest.mark.parametrize("ground", [FixedGround(40.0), RangefinderGround(0.05)], ids=["fixed", "rangefinder"])
def test_barometers_sigma_does_not_count_where_another_sensor_shows_the_height(ground):
    scene = Scene(roll_deg=6.0, pitch_deg=20.0, beam=(0.0, 0.0, 1.0), relative=True)
    localizer = Localizer(ground, PRIORS, min_height_m=0.5)
    usual, by_barometer = (localizer.locate(with_height_bias(scene, each)) for each in (None, 1.3))
    assert usual.ground != "home"
    assert by_barometer.cov == usual.cov
    assert by_barometer.bias_jacobian == usual.bias_jacobian


@pytest.mark.parametrize("on_gimbal", [False, True])
@pytest.mark.parametrize("relative", [False, True])
def test_the_total_by_a_rangefinder_is_the_sum_of_its_named_parts(relative, on_gimbal):
    """With a beam on the body, attitude and mount have different columns."""
    scene = Scene(roll_deg=6.0, pitch_deg=20.0, beam=(0.6, 0.0, 0.8), relative=relative, on_gimbal=on_gimbal)
    fix = Localizer(RangefinderGround(0.05), PRIORS, min_height_m=0.5).locate(scene.sighting())
    assert fix.ground == "rangefinder"
    jacobian, level = np.array(fix.bias_jacobian), np.diag([0.0, 0.0, fix.level_sigma_m**2])
    biases = jacobian.T @ np.diag(np.square(PRIORS.bias_sigmas)) @ jacobian
    assert np.array(fix.cov) == pytest.approx(np.array(fix.noise_cov) + biases + level, rel=1e-9, abs=1e-12)


def test_each_line_of_the_budget_is_its_own_cause():
    scene = SCENES["standing"]
    fix = home().locate(scene.sighting())
    for name, sources in {
        "attitude": [Bias.ROLL, Bias.PITCH],
        "heading": [Bias.HEADING],
        "height": [Bias.HEIGHT],
        "time": [Bias.TIME_OFFSET, Bias.READOUT],
        "mount": [*range(Bias.MOUNT_X, Bias.TIME_OFFSET), *range(Bias.LEVER_X, Bias.TARGET_HEIGHT)],
        "position": [Bias.POSITION_NORTH, Bias.POSITION_EAST, Bias.POSITION_DELAY],
        "target": [Bias.TARGET_HEIGHT],
    }.items():
        without = tuple(0.0 if i in sources else s for i, s in enumerate(PRIORS.bias_sigmas))
        lean = Localizer(HomeGround(), msgspec.structs.replace(PRIORS, bias_sigmas=without), min_height_m=0.5)
        less, all_causes = sigmas(lean.locate(scene.sighting())), sigmas(fix)
        assert less.pop(name) < all_causes.pop(name)
        assert less == all_causes


@pytest.mark.parametrize("pitch_deg", first_of(37.0, 10.0))
@pytest.mark.parametrize(("north", "within"), [(5.0, "steep"), (40.0, "halfway"), (105.0, "as shallow as is allowed")])
def test_a_claimed_ellipse_holds_as_many_truths_as_it_says(pitch_deg, north, within):
    """500 flights, one fix each, biases from the priors: normalised squares and the 90 % ellipse, from both sides."""
    scene = Scene(pitch_deg=pitch_deg, yaw_deg=0.0, height_m=30.0, target=(north, 4.0), pixel_sigma=(4.0, 4.0))
    localizer, rng = home(), np.random.default_rng(11)
    squares = []
    for _ in range(500):
        fix = localizer.locate(scene.sighting(*scene.draw(rng)))
        if isinstance(fix, NoFix):
            continue
        error = np.subtract(fix.position_ned, scene.truth())[:2]
        squares.append(error @ np.linalg.solve(np.array(fix.cov)[:2, :2], error))

    count = len(squares)
    assert count > 250
    low, high = chi2.ppf([0.0005, 0.9995], 2 * count) / count
    assert low <= np.mean(squares) <= high
    held = np.mean(np.array(squares) < chi2.ppf(0.9, 2))
    assert 0.85 <= held <= 0.95


def test_beyond_what_a_gaussian_can_tell_it_refuses():
    found = {}
    for distance in (30.0, 100.0, 300.0, 3000.0):
        answer = home().locate(Scene(pitch_deg=60.0, yaw_deg=0.0, height_m=30.0, target=(distance, 0.0)).sighting())
        found[distance] = answer.reason if isinstance(answer, NoFix) else "fix"
    assert found == {30.0: "fix", 100.0: "fix", 300.0: Reason.TOO_SHALLOW, 3000.0: Reason.TOO_SHALLOW}


def test_the_bias_of_convexity_stays_a_small_part_of_what_is_claimed():
    """A shallow ray's error is skewed outward: its mean lies k sigma too far, k = 0.12 here and at most 0.15."""
    still = (0.0, 0.0, 0.0)
    scene = Scene(
        pitch_deg=60.0, yaw_deg=0.0, roll_deg=0.0, height_m=30.0, target=(110.0, 0.0), velocity=still, rates=still
    )
    sigma = np.sqrt(home().locate(scene.sighting()).cov[0][0])
    loose = Localizer(HomeGround(), scaled_priors(0.001), min_height_m=0.5)  # so that no draw is refused
    rng = np.random.default_rng(4)

    errors = [loose.locate(scene.sighting(*scene.draw(rng))) for _ in range(3000)]

    off = np.mean([e.position_ned[0] for e in errors if isinstance(e, GroundFix)]) - scene.truth()[0]
    assert 0.05 * sigma < off < 0.15 * sigma


def test_nothing_fresh_and_no_bias_leaves_only_the_level():
    """With every sigma zero but the height's, only height is left."""
    zero = tuple(0.5 if i == Bias.HEIGHT else 0.0 for i in range(BIAS_COUNT))
    priors = msgspec.structs.replace(scaled_priors(0.0), bias_sigmas=zero)
    scene = Scene(pixel_sigma=(0.0, 0.0), bridging_sigma=0.0, time_noise_s=0.0, position_sigma_m=0.0)
    fix = Localizer(HomeGround(), priors, min_height_m=0.5).locate(scene.sighting())

    north, east = scene.target
    expected = 0.25 * np.outer([north / 40.0, east / 40.0], [north / 40.0, east / 40.0])
    assert np.array(fix.cov)[:2, :2] == pytest.approx(expected, rel=1e-9)
    assert fix.cov[2][2] == pytest.approx(0.25)
