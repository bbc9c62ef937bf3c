"""Mean directions of the vertical and of the targets: the axes that decide which errors are observable. PURE."""

from __future__ import annotations

import msgspec

from fwav_companion.geometry.rotations import conjugate, rotate
from fwav_companion.geometry.vectors import Vector3, add, scale, subtract
from fwav_companion.self_calibration.measurement_batch import MeasurementBatch
from fwav_companion.types import VehicleState


class MeanAxes(msgspec.Struct, frozen=True, gc=False):
    """Mean directions of the vertical and of the targets, in the axes of the camera's carrier (body or gimbal)."""

    down: Vector3 = (0.0, 0.0, 1.0)
    """Mean direction of down."""
    sight: Vector3 = (0.0, 0.0, 1.0)
    """Mean direction toward the targets."""
    count: int = 0
    """Number of batches in the means."""

    def with_batch(self, state: VehicleState, batch: MeasurementBatch) -> MeanAxes:
        """The means after one more batch."""
        share = 1.0 / (self.count + 1)
        down = rotate(conjugate(state.ned_from_carrier), (0.0, 0.0, 1.0))
        x, y, z = batch.ray.mean(0).tolist()
        return MeanAxes(
            add(self.down, scale(subtract(down, self.down), share)),
            add(self.sight, scale(subtract((x, y, z), self.sight), share)),
            self.count + 1,
        )
