"""A track as self-calibration sees it: the joint estimate, the doubt about a wrong mount, and which answer counts."""

from types import SimpleNamespace

import numpy as np
import pytest
from handmade import a_fix, a_view, host_ns
from simulated_flight import priors

from fwav_companion.tracking.filters.kalman import StaticKalman
from fwav_companion.tracking.filters.moving import MovingKalman
from fwav_companion.tracking.filters.schmidt_kalman import DownEstimate, PointEstimate
from fwav_companion.tracking.filters.standing import with_down
from fwav_companion.tracking.self_calibrated import CalibratedTargetState, misplaced
from fwav_companion.tracking.track_state import initiate
from fwav_companion.types.tracks import GateResult

PRIORS = priors(position_north=0.3, position_east=0.5, position_noise_m=0.2)
RELATIVE = np.diag([0.09, 0.16, 0.01])
PLACE = (4.0, 3.0, 0.0)


class Own:
    """The target by its own filter."""

    position_ned, apparent_ned = (1.0, 2.0, 3.0), (1.5, 2.5, 3.5)
    cov = ((0.5, 0.1, 0.0), (0.1, 0.6, 0.0), (0.0, 0.0, 0.07))
    velocity_ned = velocity_cov = None

    def __init__(self, relative):
        self.relative_cov = tuple(map(tuple, relative.tolist()))

    def gate(self, _fix):
        return GateResult(7.0, 0.0)


def calibrated(relative=RELATIVE, gate=None):
    calibrator = SimpleNamespace(context=SimpleNamespace(priors=PRIORS), gate=lambda _track, _fix: gate)
    placed = SimpleNamespace(
        north=10.0,
        east=20.0,
        cov=(0.02, 0.005, 0.03),
        apparent_north=11.0,
        apparent_east=22.0,
        relative_cov=(0.12, 0.015, 0.13),
    )
    return CalibratedTargetState(calibrator, 4, placed, Own(relative))


def test_the_place_is_the_joint_estimates_and_the_height_its_own():
    state = calibrated()
    assert state.position_ned == (10.0, 20.0, 3.0)
    assert np.array(state.cov) == pytest.approx(np.array([[0.02, 0.005, 0.0], [0.005, 0.03, 0.0], [0.0, 0.0, 0.07]]))
    assert state.velocity_ned is None
    assert state.velocity_cov is None


def test_relative_to_the_vehicle_the_joint_estimate_answers_with_the_noise_of_the_vehicles_report():
    """Whatever the target's own filter claims: it rests on priors, and does not know how the position wanders."""
    noise = 0.2**2
    joint = np.array([[0.12 + noise, 0.015, 0.0], [0.015, 0.13 + noise, 0.0], [0.0, 0.0, 0.07]])
    for own in (0.09, 0.3):
        state = calibrated(np.diag([own, own, 0.01]))
        assert state.apparent_ned == (11.0, 22.0, 3.0)
        assert np.array(state.relative_cov) == pytest.approx(joint)


def test_its_gate_is_the_joint_estimates_where_that_has_one():
    assert calibrated(gate=GateResult(2.0, 1.0)).gate("fix") == GateResult(2.0, 1.0)
    assert calibrated().gate("fix") == GateResult(7.0, 0.0)


def test_while_the_mount_is_wrong_both_claims_are_wider_by_its_effect_and_nothing_is_known_of_the_motion():
    fix = a_fix(2.0, PLACE)
    track = initiate(7, fix, MovingKalman(PRIORS).initiate(fix), host_ns(2.0))
    plain = track.report(track.target, a_view(2.0))
    found = misplaced(plain, 1.5)
    assert (found.position_ned, found.apparent_ned) == (plain.position_ned, plain.apparent_ned)
    assert np.subtract(found.cov, plain.cov) == pytest.approx(np.diag([2.25, 2.25, 0.0]))
    assert np.subtract(found.relative_cov, plain.relative_cov) == pytest.approx(np.diag([2.25, 2.25, 0.0]))
    assert (plain.fix, plain.velocity_cov is None) == (fix, False)
    assert (found.fix, found.innovation, found.velocity_ned, found.velocity_cov) == (None, None, None, None)


@pytest.mark.parametrize("down_shared", [(0.3, -0.1, 0.2), (0.0, 0.0, 0.0)])
def test_the_covariance_of_a_place_has_what_its_height_shares(down_shared):
    rows = np.array([[0.5, -0.2, 0.1], [0.3, 0.4, -0.6], down_shared])
    noise = np.array([[0.2, 0.05, 0.0], [0.05, 0.3, 0.0], [0.0, 0.0, 0.04]])
    place = PointEstimate(1.0, 2.0, (0.2, 0.05, 0.3), (tuple(rows[0].tolist()), tuple(rows[1].tolist())))
    down = DownEstimate(0.0, 0.04, tuple(rows[2].tolist()))
    found = with_down(place.cov, place.along(down.shared), down)
    assert np.array(found) == pytest.approx(noise + rows @ rows.T)


def test_the_gates_share_of_a_target_and_of_a_fix():
    p = priors(time_offset=0, heading=0, mount_x=0, mount_y=0, mount_z=0, height_noise_m=0.0)
    fix = a_fix(0.0, (4.0, 3.0, 0.0), np.diag([0.04, 0.09, 0.0]))
    state = StaticKalman(p).initiate(fix)
    share, of_fix = state.gate_share, state.gate_share_of(fix)
    assert (share.nn, share.ee) == pytest.approx((0.04, 0.09))
    assert (of_fix.nn, of_fix.ee) == pytest.approx((0.04, 0.09))
