"""The extent of the vehicle's path while it measures targets: only a baseline shows the height.

From one place, targets that are twice as far apart look the same from twice the height. In a hover only the errors of
reported positions change the rows, and a filter takes that for parallax: over six targets, 20 m above them, the height
ran away by 7 m at a claim of 0.4 m.
"""

from __future__ import annotations

import msgspec
import numpy as np

from fwav_companion.self_calibration.arrays import Array
from fwav_companion.self_calibration.measurement_batch import MeasurementBatch

LEAST_SHARE = 0.25
"""Baseline over the height above the targets from which it shows the height: 14 degrees of parallax."""
LEAST_SIGMAS = 4.0
"""Horizontal baseline over one sigma of the vehicle's position error, from which that error does not imitate it."""


class Baseline(msgspec.Struct, frozen=True):
    """Bounds of the reported positions of one pass. Immutable."""

    least_ned: Array = np.full(3, np.inf)
    most_ned: Array = np.full(3, -np.inf)
    drop_m: float = 0.0
    """Height above the targets, the largest of all."""

    def with_batch(self, batch: MeasurementBatch) -> Baseline:
        """The bounds with the positions of one more batch."""
        positions = batch.poses.position_ned.reshape(-1, 3)
        return Baseline(
            np.minimum(self.least_ned, positions.min(0)),
            np.maximum(self.most_ned, positions.max(0)),
            max(self.drop_m, float(batch.drop_m.max())),
        )

    def shows_height(self, position_sigma_m: float) -> bool:
        """Whether the path is long enough to show the height."""
        north, east, down = map(float, np.maximum(self.most_ned - self.least_ned, 0.0))  # 0 before the first batch
        level = float(np.hypot(north, east))
        level = level if level >= LEAST_SIGMAS * position_sigma_m else 0.0
        return max(level, down) > LEAST_SHARE * self.drop_m
