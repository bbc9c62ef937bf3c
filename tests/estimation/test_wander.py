"""The position's error in time, against dense covariances of its kernels."""

import numpy as np
import pytest

from fwav_companion.estimation.wander import QUICK, SMOOTH, ErrorAgeing, Wander

PATH = (0.01, 0.3)


def test_steps_without_a_sighting_age_the_error_as_one_step_does():
    ageing = ErrorAgeing((Wander(1.0, (30.0,), SMOOTH, PATH), Wander(0.3, (30.0,), QUICK, PATH)))
    whole_keep, whole_added = ageing.between(0.0, 20.0)
    keep, added = np.ones(3), np.zeros(3)
    for k in range(600):
        factor, more = ageing.between(k / 30.0, (k + 1) / 30.0)
        keep, added = keep * factor, factor**2 * added + more
    assert keep == pytest.approx(whole_keep, rel=1e-9)
    assert added == pytest.approx(whole_added, rel=1e-3)


def test_error_without_sightings_returns_to_its_prior():
    wanders = Wander(1.0, (30.0,), SMOOTH, PATH), Wander(0.3, (30.0,), SMOOTH, PATH)
    keep, added = ErrorAgeing(wanders).between(0.0, 300.0)
    assert keep.max() < 1e-3
    assert added == pytest.approx([1.0, 1.0, 0.09], rel=0.01)


def test_error_is_a_walk_from_frame_to_frame():
    wander = Wander(1.0, (30.0,), SMOOTH, PATH)
    keep, added = ErrorAgeing((wander, wander)).between(0.0, 0.03)
    assert keep == pytest.approx(1.0)
    assert added == pytest.approx(0.03 * wander.growth())
