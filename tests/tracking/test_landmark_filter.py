"""The filter of landmarks against one batch of linear algebra over all errors and places together."""

import msgspec
import numpy as np
import pytest

from fwav_companion.config.estimation import UncertaintyConfig
from fwav_companion.geometry.earth import Geodetic
from fwav_companion.tracking.landmarks.joint_place import Correction, Transition, first_joint_place
from fwav_companion.tracking.landmarks.landmark_filter import landmark_filter
from fwav_companion.tracking.landmarks.state_vector import SharedErrors
from fwav_companion.types import Landmark, LandmarkRecord, LandmarkState

RNG = np.random.default_rng(5)
SHARED = 4


def correction_of(mean, cov, rows, noise, measured) -> tuple[Correction, np.ndarray, np.ndarray]:
    """A sight of a landmark, and mean and covariance of the shared errors after it."""
    crossed = rows @ cov
    inverse = np.linalg.inv(crossed @ rows.T + noise)
    innovation = measured - rows @ mean
    gain = crossed.T @ inverse
    return Correction(rows, crossed, inverse, innovation), mean + gain @ innovation, cov - gain @ crossed


def test_a_place_and_its_claim_are_those_of_the_whole_filter_with_considered_errors():
    """Oracle: one Kalman filter of place and shared errors, in which fixes of the target move the place alone."""
    root = RNG.normal(size=(SHARED, SHARED))
    mean, cov = RNG.normal(size=SHARED), root @ root.T
    full_mean, full_cov, place = None, None, None
    for turn in range(12):
        rows, noise, measured = RNG.normal(size=(2, SHARED)), np.diag(RNG.uniform(0.1, 1.0, 2)), RNG.normal(size=2)
        if place is None:
            place = first_joint_place(measured, noise, rows, (mean, cov))
            full_mean = np.concatenate((measured - rows @ mean, mean))
            cross = -rows @ cov
            full_cov = np.block([[noise + rows @ cov @ rows.T, cross], [cross.T, cov]])
        elif turn % 3 == 0:
            step, mean, cov = correction_of(mean, cov, rows, noise, measured)
            place = place.after(step)
            whole = np.hstack((np.zeros((2, 2)), rows))
            gain = full_cov @ whole.T @ np.linalg.inv(whole @ full_cov @ whole.T + noise)
            full_mean = full_mean + gain @ (measured - whole @ full_mean)
            full_cov = full_cov - gain @ whole @ full_cov
        elif turn % 3 == 1:
            place = place.update(measured, noise, rows, (mean, cov))
            whole = np.hstack((np.eye(2), rows))
            gain = full_cov @ whole.T @ np.linalg.inv(whole @ full_cov @ whole.T + noise)
            gain[2:] = 0.0
            full_mean = full_mean + gain @ (measured - whole @ full_mean)
            rest = np.eye(2 + SHARED) - gain @ whole
            full_cov = rest @ full_cov @ rest.T + gain @ noise @ gain.T
        else:
            matrix, fresh = np.diag(RNG.uniform(0.5, 1.0, SHARED)), np.diag(RNG.uniform(0.0, 0.3, SHARED))
            mean, cov = matrix @ mean, matrix @ cov @ matrix.T + fresh
            place = place.after(Transition(matrix))
            whole = np.block([[np.eye(2), np.zeros((2, SHARED))], [np.zeros((SHARED, 2)), matrix]])
            full_mean, full_cov = whole @ full_mean, whole @ full_cov @ whole.T
            full_cov[2:, 2:] += fresh
        assert place.place == pytest.approx(full_mean[:2], abs=1e-9)
        assert place.cov == pytest.approx(full_cov[:2, :2], abs=1e-9)
        assert place.cross == pytest.approx(full_cov[:2, 2:], abs=1e-9)


@pytest.mark.parametrize(("used", "known"), [(9, True), (2, False)])
def test_the_altitude_is_what_sights_show_without_its_prior(used, known):
    """Sights that show 4 m with 3 m of sigma, on a receiver of 1 m, whose altitude has a prior of 2 m."""
    landmark = Landmark("mark", Geodetic.from_degrees(48.0, 11.0, 500.0), 0.4)
    state = landmark_filter(SharedErrors(UncertaintyConfig().priors(readout_known=True, surveyed=False), [landmark]))
    index, prior = state.model.altitude, (2.0 * state.sigma_m) ** 2
    cov, mean = state.cov.copy(), state.mean.copy()
    cov[index, index] = 1.0 / (1.0 / prior + 1.0 / 9.0)
    mean[index] = cov[index, index] * 4.0 / 9.0
    record = LandmarkRecord("mark", LandmarkState.USED, used=used)
    seen = msgspec.structs.replace(state, cov=cov, mean=mean, records=(record,))
    assert state.altitude is None, "not seen"
    if not known:
        assert seen.altitude is None, "hardly seen"
        return
    assert seen.altitude.too_high_m == pytest.approx(4.0)
    assert seen.altitude.sigma_m == pytest.approx(np.hypot(3.0, 0.4))
