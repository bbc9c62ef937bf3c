"""The tracker's sensitivities at another place of level ground, against the localizer's at that place."""

import numpy as np
import pytest
from true_flights import PRIORS, Scene

from fwav_companion.localization import HomeGround, Localizer
from fwav_companion.tracking.filters.linearization import SENSITIVE, level_columns

SCENES = [Scene(), Scene(roll_deg=6.0, pitch_deg=20.0), Scene(pitch_deg=-10.0, target=(-3.0, 8.0), height_m=5.0)]


def located(scene):
    return Localizer(HomeGround(), PRIORS, min_height_m=0.5).locate(scene.sighting())


@pytest.mark.parametrize("scene", SCENES)
def test_from_any_fix_the_columns_are_those_of_a_fix_that_looks_there(scene):
    """The other fix sees another target from the same pose: attitude and height are the same, only the ray is not."""
    fix = located(scene)
    other = located(Scene(**{**vars(scene), "target": (scene.target[0] + 1.5, scene.target[1] - 2.0)}))
    north, east, height = np.subtract(other.position_ned, other.sighting.camera_ned)
    for bias, column in zip(SENSITIVE, level_columns(fix, north, east, height), strict=True):
        assert column == pytest.approx(other.bias_jacobian[bias][:2], rel=1e-9, abs=1e-9), bias.name
