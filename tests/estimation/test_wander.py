"""The position's error in time, against dense covariances of its kernels."""

import numpy as np
import pytest

from fwav_companion.estimation.path_samples import PathBreak
from fwav_companion.estimation.wander import QUICK, SMOOTH, ErrorAgeing, Wander, jumps

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


def test_jump_of_the_error_is_known_as_well_as_the_reports_about_the_step():
    """Drawn: two noisy reports, 10 ms apart, of a vehicle that stands."""
    rng, noise_m, true = np.random.default_rng(5), 0.3, np.array([3.0, -1.0])
    normalised = []
    for seen in true + rng.normal(0.0, noise_m, (2000, 2)) - rng.normal(0.0, noise_m, (2000, 2)):
        jump, variance = jumps([PathBreak(10.0, 10.01, 3.0, tuple(seen))], 5.0, 12.0, noise_m)
        normalised.append((jump[:2] - true) ** 2 / variance)
    assert 0.85 < np.mean(normalised) < 1.0


def test_step_whose_size_is_unknown_moves_nothing_and_has_the_variance_of_its_prior():
    jump, variance = jumps([PathBreak(10.0, 13.0, 0.5)], 5.0, 14.0, 0.3)
    assert not jump.any()
    assert variance == pytest.approx(4.0)  # (4 * 0.5 m)^2


@pytest.mark.parametrize("span_s", [(5.0, 10.0), (10.01, 12.0)])
def test_steps_outside_of_a_span_of_time_do_not_count_in_it(span_s):
    jump, variance = jumps([PathBreak(10.0, 10.01, 3.0, (3.0, -1.0))], *span_s, 0.3)
    assert (jump.any(), variance) == (False, 0.0)
