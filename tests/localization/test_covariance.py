"""The derivatives against differences, the covariance against Monte Carlo, by a simulation of its own."""

from dataclasses import replace

import msgspec
import numpy as np
import pytest
from draws import first_of
from scipy.spatial.transform import Rotation
from scipy.stats import chi2
from true_flights import LEVEL_PRIORS as PRIORS
from true_flights import STEPS, Noise, Scene

from fwav_companion.localization import FixedGround, HomeGround, Localizer, RangefinderGround
from fwav_companion.types import BIAS_COUNT, Bias, GroundFix, NoFix, Reason

SCENES = {
    "ahead and turned": Scene(),
    "below": Scene(roll_deg=-3.0, pitch_deg=5.0, target=(1.0, -2.0)),
    "relative": Scene(relative=True),
    "rolled": Scene(roll_deg=-25.0, pitch_deg=15.0, target=(-10.0, 30.0), row_fraction=0.1),
    "low": Scene(height_m=3.0, target=(1.0, 1.5), velocity=(1.0, 0.0, 0.3)),
    "standing": Scene(height_m=8.0, target=(4.0, 6.0), rises=(0.85, 0.085)),
    "standing, relative": Scene(height_m=8.0, target=(4.0, 6.0), rises=(1.7, 0.17), relative=True),
}
every_scene = pytest.mark.parametrize("scene", SCENES.values(), ids=SCENES.keys())


def home() -> Localizer:
    return Localizer(HomeGround(), PRIORS, min_height_m=0.5)


def differences(localizer: Localizer, scene: Scene) -> np.ndarray:
    """(BIAS_COUNT, 3): how the answer moves with each bias, the target being where it is."""
    columns = []
    for i, step in enumerate(STEPS):
        bias = np.zeros(BIAS_COUNT)
        ahead, behind = (
            np.array(localizer.locate(scene.sighting(bias + sign * step * np.eye(BIAS_COUNT)[i])).position_ned)
            for sign in (1.0, -1.0)
        )
        columns.append((ahead - behind) / (2.0 * step))
    return np.array(columns)


@every_scene
def test_without_errors_the_target_is_where_it_is(scene):
    fix = home().locate(scene.sighting())
    assert fix.position_ned == pytest.approx(scene.truth(), abs=1e-9)
    assert fix.ground == "home"


def test_on_level_ground_the_answer_lies_at_its_level_to_the_bit():
    """Filters treat an exactly constant height as known; a rounding error of 2e-15 m would look like a height on which
    many fixes agree.
    """
    rng, localizer = np.random.default_rng(3), home()
    for height_m, north, east in rng.uniform((0.6, -9.0, -9.0), (60.0, 9.0, 9.0), (300, 3)):
        near = (0.2 * height_m * north / 9.0, 0.2 * height_m * east / 9.0)
        fix = localizer.locate(Scene(height_m=height_m, target=near, pitch_deg=5.0).sighting())
        assert fix.position_ned[2] == 0.0
        assert all(column[2] == 0.0 for column in fix.bias_jacobian)


@every_scene
def test_every_bias_moves_the_answer_as_its_column_says(scene):
    localizer = home()
    fix = localizer.locate(scene.sighting())
    assert np.array(fix.bias_jacobian) == pytest.approx(differences(localizer, scene), rel=1e-5, abs=1e-6)


@every_scene
def test_the_columns_are_their_numpy_form(scene):
    """The numpy form in the docstring of localization.propagation, evaluated on level ground."""
    sighting = scene.sighting()
    ned_from_camera = np.array(sighting.ned_from_camera)
    d = ned_from_camera @ sighting.ray.direction
    s, m = (scene.height_m - scene.rises[0]) / d[2], np.array([0.0, 0.0, 1.0 / d[2]])
    skew = np.array([[0.0, -d[2], d[1]], [d[2], 0.0, -d[0]], [-d[1], d[0], 0.0]])
    P = np.eye(3) - np.outer(d, m)
    by_rotation = s * P @ -skew
    w, *xyz = sighting.state.ned_from_body
    ned_from_body = Rotation.from_quat([*xyz, w]).as_matrix()
    velocity = np.array(scene.velocity) * ([0.0, 0.0, 1.0] if scene.relative else 1.0)

    columns = np.array(home().locate(sighting).bias_jacobian).T
    assert columns[:, :2] == pytest.approx((by_rotation @ ned_from_body)[:, :2], abs=1e-9)
    assert columns[:, Bias.HEADING] == pytest.approx(by_rotation[:, 2], abs=1e-9)
    assert columns[:, 3:6] == pytest.approx(-by_rotation @ ned_from_body, abs=1e-9)
    assert columns[:, 6] == pytest.approx(by_rotation @ ned_from_body @ scene.rates + P @ velocity, abs=1e-9)
    assert columns[:, 9:11] == pytest.approx(0.0 * P[:, :2] if scene.relative else P[:, :2], abs=1e-9)


@every_scene
def test_a_fixed_height_carries_the_ground_along(scene):
    """The ground's height is relative to the camera: an error of the camera's height does not affect the fix; an error
    of the stated height moves the point along its ray.
    """
    localizer = Localizer(FixedGround(scene.height_m), PRIORS, min_height_m=0.5)
    jacobian = np.array(localizer.locate(scene.sighting()).bias_jacobian)
    expected = differences(localizer, scene)
    deeper, shallower = (
        np.array(
            Localizer(FixedGround(scene.height_m + d), PRIORS, min_height_m=0.5).locate(scene.sighting()).position_ned
        )
        for d in (1e-4, -1e-4)
    )
    expected[Bias.HEIGHT] = (deeper - shallower) / 2e-4
    if scene.relative:  # the time column: the world goes with the vehicle, its height is as stated
        assert jacobian[Bias.POSITION_NORTH] == pytest.approx((0.0, 0.0, 0.0))
    assert jacobian == pytest.approx(expected, rel=1e-5, abs=1e-6)


@pytest.mark.parametrize("beam", [(0.0, 0.0, 1.0), (0.6, 0.0, 0.8)], ids=["body down", "forward and down"])
@pytest.mark.parametrize("relative", [False, True])
def test_a_tilted_beam_turns_with_the_vehicle(beam, relative):
    scene = Scene(
        roll_deg=6.0, pitch_deg=20.0, beam=beam, relative=relative, row_fraction=0.0, velocity=(3.0, 2.0, 0.0)
    )
    localizer = Localizer(RangefinderGround(0.05), PRIORS, min_height_m=0.5)

    fix = localizer.locate(scene.sighting())
    assert fix.ground == "rangefinder"
    assert fix.position_ned == pytest.approx(scene.truth(), abs=1e-9)
    jacobian, expected = np.array(fix.bias_jacobian), differences(localizer, scene)
    rotations = [Bias.ROLL, Bias.PITCH, Bias.HEADING, Bias.MOUNT_X, Bias.MOUNT_Y, Bias.MOUNT_Z]
    assert jacobian[rotations] == pytest.approx(expected[rotations], rel=1e-5, abs=1e-6)


@pytest.mark.parametrize("relative", [False, True])
def test_a_gimbals_error_turns_the_ray_but_not_the_beam(relative):
    """The rangefinder is fixed to the body, so an attitude error of the gimbal does not change the measured height."""
    scene = Scene(
        roll_deg=6.0, pitch_deg=20.0, beam=(0.0, 0.0, 1.0), relative=relative, row_fraction=0.0, on_gimbal=True
    )
    localizer = Localizer(RangefinderGround(0.05), PRIORS, min_height_m=0.5)

    fix = localizer.locate(scene.sighting())
    assert fix.ground == "rangefinder"
    assert fix.position_ned == pytest.approx(scene.truth(), abs=1e-9)
    jacobian, expected = np.array(fix.bias_jacobian), differences(localizer, scene)
    rotations = [Bias.ROLL, Bias.PITCH, Bias.HEADING, Bias.MOUNT_X, Bias.MOUNT_Y, Bias.MOUNT_Z]
    assert jacobian[rotations] == pytest.approx(expected[rotations], rel=1e-5, abs=1e-6)
    on_body = localizer.locate(replace(scene, on_gimbal=False).sighting())
    assert abs(np.array(on_body.bias_jacobian) - jacobian)[[Bias.ROLL, Bias.PITCH]].max() > 1.0


@pytest.mark.parametrize(
    ("draws", "apart", "within"), [(1000, 0.12, 0.087), pytest.param(3000, 0.07, 0.05, marks=pytest.mark.slow)]
)
@pytest.mark.parametrize("name", first_of("ahead and turned", "standing", "relative", "low", few=2))
def test_noise_and_total_agree_with_monte_carlo(name, draws, apart, within):
    """Errors small enough to be linear; drawn, flown and located one by one. ``within`` is 3.9 sigma of the draws."""
    priors = scaled_priors(0.2)
    scene = replace(
        SCENES[name], pixel_sigma=(0.6, 1.0), bridging_sigma=0.0004, time_noise_s=0.0004, position_sigma_m=0.01
    )
    localizer = Localizer(HomeGround(), priors, min_height_m=0.5)
    fix = localizer.locate(scene.sighting())
    rng = np.random.default_rng(2)
    fresh, total = [], []
    for _ in range(draws):
        bias, noise = scene.draw(rng, priors)
        fresh.append(localizer.locate(scene.sighting(None, noise)).position_ned[:2])
        total.append(localizer.locate(scene.sighting(bias, noise)).position_ned[:2])

    for errors, claimed in ((fresh, fix.noise_cov), (total, fix.cov)):
        found, claimed = np.cov(np.array(errors).T), np.array(claimed)[:2, :2]
        scale = np.sqrt(np.outer(np.diag(claimed), np.diag(claimed)))
        assert np.abs(found - claimed).max() <= apart * scale.max()
        assert np.sqrt(np.diag(found) / np.diag(claimed)) == pytest.approx([1.0, 1.0], abs=within)


FRESH = {
    "pixel": (np.eye(2), 1e-3),
    "attitude": (np.eye(3), 1e-6),
    "bridging": (np.eye(3), 1e-6),
    "place": (np.eye(2), 1e-4),
    "height": (np.ones(1), 1e-4),
    "time_s": (np.ones(1), 1e-6),
}
"""Independent errors of a sighting: their components, and the steps for differences."""


@pytest.mark.parametrize("ground", ["home", "rangefinder"])
@every_scene
def test_the_noise_is_the_sum_of_what_each_fresh_error_does(scene, ground):
    """Horizontally, by differences of the simulation. A rangefinder reading with a sigma of 0.05 m replaces the height:
    the noise of the height and the age of the position then have no effect."""
    scene = replace(scene, position_sigma_m=0.3, beam=(0.0, 0.0, 1.0))
    by_reading = ground == "rangefinder"
    localizer = Localizer(RangefinderGround(0.05) if by_reading else HomeGround(), PRIORS, min_height_m=0.5)
    age_m = scene.position_sigma_m
    sigmas = {
        "pixel": scene.pixel_sigma,
        "attitude": (PRIORS.attitude_noise,) * 3,
        "bridging": (scene.bridging_sigma,) * 3,
        "place": (0.0,) * 2 if scene.relative else (np.hypot(PRIORS.position_noise_m, age_m),) * 2,
        "height": (0.0 if by_reading else np.hypot(PRIORS.height_noise_m, age_m),),
        "time_s": (scene.time_noise_s,),
    }
    expected = np.zeros((2, 2))
    for name, (units, step) in FRESH.items():
        for unit, sigma in zip(units, sigmas[name], strict=True):
            ahead, behind = (
                localizer.locate(scene.sighting(None, Noise(**{name: sign * step * unit}))).position_ned[:2]
                for sign in (1.0, -1.0)
            )
            column = sigma * np.subtract(ahead, behind) / (2.0 * step)
            expected += np.outer(column, column)
    fix = localizer.locate(scene.sighting())
    assert fix.ground == ground
    if by_reading:
        ahead, behind = (localizer.locate(read_as(scene.sighting(), d)).position_ned[:2] for d in (1e-4, -1e-4))
        column = 0.05 * np.subtract(ahead, behind) / 2e-4
        expected += np.outer(column, column)
    else:
        assert fix.noise_cov[2] == pytest.approx((0.0, 0.0, PRIORS.height_noise_m**2)), "the ground is that uneven"
    assert np.array(fix.noise_cov)[:2, :2] == pytest.approx(expected, rel=1e-4, abs=1e-9)


def read_as(sighting, by_m: float):
    """The sighting with a rangefinder reading longer by ``by_m``."""
    reading = msgspec.structs.replace(sighting.state.range, distance_m=sighting.state.range.distance_m + by_m)
    return msgspec.structs.replace(sighting, state=msgspec.structs.replace(sighting.state, range=reading))


def scaled_priors(factor: float):
    p = PRIORS
    return msgspec.structs.replace(
        p,
        attitude_noise=factor * p.attitude_noise,
        position_noise_m=factor * p.position_noise_m,
        height_noise_m=factor * p.height_noise_m,
        bias_sigmas=tuple(factor * s for s in p.bias_sigmas),
    )


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
    budget = [getattr(fix.budget, name) for name in fix.budget.__struct_fields__]
    assert np.sum(np.square(budget)) == pytest.approx(np.trace(np.array(fix.cov)[:2, :2]), rel=1e-9)
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
        less = lean.locate(scene.sighting()).budget
        for other in less.__struct_fields__:
            if other == name:
                assert getattr(less, other) < getattr(fix.budget, other)
            else:
                assert getattr(less, other) == getattr(fix.budget, other)


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
