"""Self-calibration with little information: correct priors are not denied, and no estimate gets worse.

An orbit that always faces its target makes neither mount nor height observable, and the wandering of the vehicle's own
position resembles both.
"""

import numpy as np
import pytest
from flying import fly

from sitl_mock import scenario

ORBIT = {"seconds": 30.0, "camera.fps": 15.0}


@pytest.mark.slow
def test_orbits_with_a_wandering_position_deny_no_prior_and_are_not_worse_for_self_calibration():
    """Eight flights together: of fourteen alone one is a tenth worse, where its wander resembles a mount."""
    errors_m = []
    for seed in range(1, 9):
        options = scenario("default").but({**ORBIT, "seed": seed})
        plain, calibrating = (fly(options, [f"tracking.self_calibration={on}"]) for on in ("false", "true"))
        sigma_m = [
            np.sqrt(np.linalg.eigvalsh(np.array(flight.final().cov)[:2, :2])[-1]) for flight in (plain, calibrating)
        ]
        assert calibrating.companion.pipeline._components.camera.calibration.denied == ()
        assert sigma_m[1] < 1.1 * sigma_m[0]
        errors_m.append((plain.error_m(plain.final()), calibrating.error_m(calibrating.final())))
    plain_m, calibrating_m = np.sqrt(np.mean(np.square(errors_m), axis=0))
    assert calibrating_m < plain_m
