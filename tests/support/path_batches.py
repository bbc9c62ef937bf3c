"""Measurement batches along the vehicle's path, one point of it each."""

import numpy as np

from fwav_companion.self_calibration.vehicle_motion import VehicleMotion, in_motion


def along(path, batch, capture_s, priors):
    """(the path after it, the batch along it): the middle of the batch's delays is the report."""
    k = (0, batch.poses.delay_s.shape[1] // 2)
    position, velocity = (tuple(map(float, a[k])) for a in (batch.poses.position_ned, batch.poses.velocity_ned))
    path = path.after(float(capture_s - batch.poses.delay_s[k]), position, velocity, priors)
    count = len(batch.tracks)
    return path, in_motion(batch, np.full(count, capture_s), [VehicleMotion(path=path)], [0] * count)
