"""The bound of shallow rays: every error that turns the ray counts by the change of the ray's length."""

from dataclasses import replace

import msgspec
import numpy as np
import pytest
from made_up_terrain import PLANE, tile
from true_flights import PRIORS, STEPS, Noise, Scene

from fwav_companion.localization import Datum, ElevationModel, HomeGround, Localizer, TerrainGround
from fwav_companion.types import BIAS_COUNT, Bias, GroundFix, NoFix, Reason, TakeOff, TakeOffSource

MOST = 0.15
"""Largest one sigma of the ray's relative length of a fix."""
NOTHING = msgspec.structs.replace(
    PRIORS, attitude_noise=0.0, position_noise_m=0.0, height_noise_m=0.0, bias_sigmas=(0.0,) * BIAS_COUNT
)
SURE = {"pixel_sigma": (0.0, 0.0), "bridging_sigma": 0.0, "time_noise_s": 0.0, "position_sigma_m": 0.0}
SCENE = Scene(roll_deg=5.0, pitch_deg=40.0, yaw_deg=0.0, vehicle=(0.0, 0.0), target=(60.0, 20.0), **SURE)


def home():
    return HomeGround()


def slope():
    """A slope of 0.4 down to the east, on which a rotation about down changes the ray's length."""
    ground = TerrainGround(ElevationModel([tile(lambda _, j: 500.0 - 0.4 * 20.86 * (j - 60))]), Datum.EGM96)
    ground.on_origin(PLANE, TakeOff(PLANE.origin, TakeOffSource.HOME_POSITION), None)
    return ground


def length_m(ground, bias=None, noise=None):
    """The length of the ray from the camera to the fix, metres."""
    sighting = SCENE.sighting(bias, noise)
    return np.linalg.norm(np.subtract(locate(ground, sighting, NOTHING).position_ned, sighting.camera_ned))


def locate(ground, sighting, priors):
    return Localizer(ground, priors, min_height_m=0.5).locate(sighting)


def bias_of(bias):
    def errors(size):
        return size * np.eye(BIAS_COUNT)[bias], None

    def claims(sigma):
        return msgspec.structs.replace(NOTHING, bias_sigmas=tuple((sigma * np.eye(BIAS_COUNT)[bias]).tolist())), SCENE

    return errors, claims, STEPS[bias]


def noise_of(step, scene_key=None, prior_key=None, **of):
    """``of``: one unit of the error as Noise; ``scene_key`` or ``prior_key``: where its sigma is claimed."""

    def errors(size):
        return None, Noise(**{name: size * np.asarray(unit, dtype=float) for name, unit in of.items()})

    def claims(sigma):
        if prior_key is not None:
            return msgspec.structs.replace(NOTHING, **{prior_key: sigma}), SCENE
        return NOTHING, replace(SCENE, **{scene_key: tuple((sigma * np.array(of["pixel"])).tolist())
                                          if "pixel" in of else sigma})  # fmt: skip

    return errors, claims, step


TURNING = (Bias.ROLL, Bias.PITCH, Bias.MOUNT_X, Bias.MOUNT_Y, Bias.MOUNT_Z, Bias.TIME_OFFSET, Bias.READOUT)
SOURCES = {
    **{bias.name.lower(): (home, *bias_of(bias)) for bias in TURNING},
    "heading": (slope, *bias_of(Bias.HEADING)),
    "pixel u": (home, *noise_of(0.01, "pixel_sigma", pixel=(1, 0))),
    "pixel v": (home, *noise_of(0.01, "pixel_sigma", pixel=(0, 1))),
    "time noise": (home, *noise_of(1e-5, "time_noise_s", time_s=1.0)),
}


@pytest.mark.parametrize("source", SOURCES)
def test_each_error_that_turns_the_ray_counts(source):
    """One error alone, with a sigma 2 % below and 2 % above the bound; the change of the ray's length is by differences
    of the simulation."""
    make_ground, errors, claims, step = SOURCES[source]
    ground = make_ground()
    ahead, behind = (length_m(ground, *errors(sign * step)) for sign in (1.0, -1.0))
    share = abs(ahead - behind) / (2.0 * step * length_m(ground))
    for factor, fixed in ((0.98, True), (1.02, False)):
        priors, scene = claims(factor * MOST / share)
        answer = locate(ground, scene.sighting(), priors)
        assert isinstance(answer, GroundFix) if fixed else answer == NoFix(Reason.TOO_SHALLOW), (source, factor)


@pytest.mark.parametrize(("where", "axes"), [("attitude_noise", 2), ("bridging_sigma", 3)])
def test_noise_about_several_axes_counts_about_each(where, axes):
    """Attitude noise turns the ray about roll and pitch on level ground, interpolation noise about all body axes."""
    ground, shares = home(), []
    for axis in np.eye(3)[:axes]:
        ahead, behind = (length_m(ground, None, Noise(bridging=sign * 1e-5 * axis)) for sign in (1.0, -1.0))
        shares.append((ahead - behind) / (2e-5 * length_m(ground)))
    for factor, fixed in ((0.98, True), (1.02, False)):
        sigma = factor * MOST / float(np.linalg.norm(shares))
        if where == "attitude_noise":
            answer = locate(ground, SCENE.sighting(), msgspec.structs.replace(NOTHING, attitude_noise=sigma))
        else:
            answer = locate(ground, replace(SCENE, bridging_sigma=sigma).sighting(), NOTHING)
        assert isinstance(answer, GroundFix) if fixed else answer == NoFix(Reason.TOO_SHALLOW)


@pytest.mark.parametrize(("descent_deg", "found"), [(8.2, True), (7.7, False)])
def test_a_ray_is_too_shallow_where_its_length_is_known_to_less_than_15_percent(descent_deg, found):
    """A rotation by 1.2 degrees lengthens a ray of length height / sin(descent) by 1.2 degrees / tan(descent), which is
    0.15 at a descent of 7.95 degrees. Only the mount's pitch errs."""
    mount_y = tuple(np.radians(1.2) if bias is Bias.MOUNT_Y else 0.0 for bias in Bias)
    alone = msgspec.structs.replace(NOTHING, bias_sigmas=mount_y)
    still = (0.0, 0.0, 0.0)
    scene = Scene(
        roll_deg=0.0, pitch_deg=60.0, yaw_deg=0.0, height_m=10.0, velocity=still, rates=still,
        target=(10.0 / np.tan(np.radians(descent_deg)), 0.0),
        **SURE,
    )  # fmt: skip
    answer = Localizer(HomeGround(), alone, min_height_m=0.5).locate(scene.sighting())
    assert isinstance(answer, GroundFix) if found else answer == NoFix(Reason.TOO_SHALLOW)
