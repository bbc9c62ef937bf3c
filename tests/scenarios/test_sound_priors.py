"""Self-calibration with little information: correct priors are not denied, and no estimate gets worse.

An orbit that always faces its target makes neither mount nor height observable, and the wandering of the vehicle's own
position resembles both.
"""

import numpy as np
import pytest
from draws import first_of
from flying import fly

from sitl_mock import scenario

ORBIT = {"seconds": 30.0, "camera.fps": 15.0}


@pytest.mark.slow
@pytest.mark.parametrize("seed", first_of(2, 3, 5))
def test_an_orbit_with_a_wandering_position_denies_no_prior(seed):
    options = scenario("default").but({**ORBIT, "seed": seed})
    plain, calibrating = (fly(options, [f"tracking.self_calibration={on}"]) for on in ("false", "true"))
    sigma_m = [
        np.sqrt(np.linalg.eigvalsh(np.array(flight.final()["cov"])[:2, :2])[-1]) for flight in (plain, calibrating)
    ]
    assert calibrating.companion.pipeline._components.camera.calibration.denied == ()
    assert sigma_m[1] < 1.1 * sigma_m[0]
    assert calibrating.error_m(calibrating.final()) < 1.1 * plain.error_m(plain.final()) + 0.02
