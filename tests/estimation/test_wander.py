"""The position's error in time, against dense covariances of its kernels."""

import numpy as np
import pytest

from fwav_companion.estimation.wander import KERNELS, QUICK, SMOOTH, ErrorAgeing, Wander, sines

PATH = (0.01, 0.3)


@pytest.mark.parametrize("kernel", KERNELS, ids=lambda k: k.name)
@pytest.mark.parametrize("gap_s", [0.5, 4.0])
def test_sines_hold_what_two_sightings_between_the_same_knots_share(kernel, gap_s):
    """Against the covariance given both knots' line; the third and higher sines are the rest of each sighting."""
    wander, part = Wander(1.0, (30.0, 1800.0), kernel, PATH), np.array([0.2, 0.35, 0.6, 0.8])
    times = np.concatenate([[0.0], part, [1.0]]) * gap_s
    line = np.concatenate([-(1.0 - part)[:, None], np.eye(4), -part[:, None]], 1)
    covariance = line @ wander.covariance(np.abs(times[:, None] - times)) @ line.T
    variances, shapes = wander.mode_variances(np.array([gap_s]))[:, 0], sines(part)
    shared = np.einsum("m,mp,mq->pq", variances, shapes, shapes)
    assert shared == pytest.approx(covariance, abs=0.25 * covariance.max())
    assert (shared.diagonal() <= wander.bridge(np.full(4, gap_s), part) * 1.02).all()


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
