"""The reported position, smoothed with the reported velocity.

A row at a noisy position holds the same noise as its residual, and a filter takes that for information: a copter that
hovered and turned at 10 m with 0.3 m of height noise lost 1.3 m of height at a sigma of 0.34 m. Smoothed, the noise is
a fifth, and what it makes of the rows a thirtieth. The noise of a measurement stays that of single positions: as often
as they come, their mean is as good.

Where a target comes into view for two seconds, a path that is smoothed by earlier positions alone has the noise of its
first ones for half of that time. So passes over kept measurements smooth it by the later ones, too (Rauch, Tung &
Striebel 1965).
"""

from __future__ import annotations

from collections.abc import Sequence
from itertools import pairwise

import msgspec
import numpy as np

from fwav_companion.self_calibration.arrays import Array
from fwav_companion.self_calibration.pixel_measurement import MeasurementBatch
from fwav_companion.self_calibration.position_path import PositionPath
from fwav_companion.types import ErrorPriors


def along_path(
    path: PositionPath, batch: MeasurementBatch, captures_s: Array, priors: ErrorPriors
) -> tuple[PositionPath, MeasurementBatch]:
    """The path after one more batch, and the batch along it; ``captures_s``: nominal captures."""
    poses, middle = batch.poses, len(captures_s) // 2
    times_s = captures_s[:, None] - poses.delay_s
    k = (middle, poses.delay_s.shape[1] // 2)
    state = path.after(float(times_s[k]), poses.position_ned[k], poses.velocity_ned[k], priors)
    positions = state.position + 0.5 * (poses.velocity_ned + state.velocity) * (times_s - state.at_s)[..., None]
    scalars = batch.scalars.copy()
    nominal = state.position[2] + state.velocity[2] * (captures_s - state.at_s)
    scalars[:, 5] = np.where(batch.ranged, nominal, scalars[:, 5])
    poses = msgspec.structs.replace(poses, position_ned=positions)
    return state, msgspec.structs.replace(batch, poses=poses, scalars=scalars, path=state)


def smoothed_back(batches: Sequence[MeasurementBatch]) -> list[Array]:
    """Changes (3) of the positions of batches by all later ones, in their order."""
    shifts = [np.zeros(3)]
    for later, path in pairwise(batch.path for batch in reversed(batches)):
        shifts.append(np.zeros(3) if path is None or later is None else path.shift_by(later, shifts[-1]))
    return shifts[::-1]


def moved(batch: MeasurementBatch, shift: Array) -> MeasurementBatch:
    """The batch with the vehicle elsewhere."""
    scalars = batch.scalars.copy()
    scalars[:, 5] += np.where(batch.ranged, shift[2], 0.0)
    poses = msgspec.structs.replace(batch.poses, position_ned=batch.poses.position_ned + shift)
    return msgspec.structs.replace(batch, poses=poses, scalars=scalars)
