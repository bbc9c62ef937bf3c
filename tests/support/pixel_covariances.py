"""Dense covariances of pixel measurements."""

import numpy as np

from fwav_companion.self_calibration.pixel_measurement import common_noise


def pixel_noise(batch, rows, priors):
    """(..., N, 2, 2) covariance of the residuals by every fresh error, px^2."""
    common = common_noise(batch, rows, priors)
    return common @ common.swapaxes(-1, -2) + batch.pixel_sigma[:, :, None] ** 2 * np.eye(2)
