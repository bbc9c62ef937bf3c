"""The derivatives against differences, the covariance against Monte Carlo, by a simulation of its own."""

from dataclasses import replace

import msgspec
import numpy as np
import pytest
from draws import first_of
from scipy.spatial.transform import Rotation
from true_flights import LEVEL_PRIORS as PRIORS
from true_flights import SCENES, STEPS, Noise, Scene, every_scene, home, scaled_priors

from fwav_companion.localization import FixedGround, HomeGround, Localizer, RangefinderGround
from fwav_companion.types import BIAS_COUNT, Bias


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
