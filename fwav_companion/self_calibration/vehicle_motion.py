"""Motion of the vehicle that sights close in time share: its slow rates, and its smoothed path.

The reported position is smoothed with the reported velocity. A row at a noisy position contains the same noise as its
residual, and a filter takes that for information: a copter that hovered and turned at 10 m with 0.3 m of height noise
lost 1.3 m of height with a sigma of 0.34 m. Smoothing reduces the noise to a fifth, and its effect on the rows to a
thirtieth. The noise of a measurement stays that of single positions, because their mean is only as good as their number
allows.

Where a target comes into view for two seconds, a path that is smoothed by earlier positions alone has the noise of its
first positions for half of that time. So passes over kept measurements smooth the path by the later positions, too
(Rauch, Tung & Striebel 1965).
"""

from __future__ import annotations

from collections.abc import Sequence

import msgspec
import numpy as np

from fwav_companion.geometry.stamps import BootNs, ns_from_s, s_from_ns
from fwav_companion.geometry.vectors import ZERO3, Vector3
from fwav_companion.self_calibration.arrays import Array
from fwav_companion.self_calibration.delayed_poses import StateAt
from fwav_companion.self_calibration.measurement_batch import MeasurementBatch
from fwav_companion.self_calibration.position_path import PositionPath
from fwav_companion.self_calibration.rate_denoiser import SPAN_S, RateDenoiser, denoised, slow_rates
from fwav_companion.types import ErrorPriors, Unpaired, VehicleState


class VehicleMotion(msgspec.Struct, frozen=True, gc=False):
    """Motion of the vehicle at one instant, with the filters that estimate it."""

    slow: Vector3 = ZERO3
    """Mean angular rates around the instant, axes of the carrier, rad/s; zero where states around it are not known."""
    denoiser: RateDenoiser = RateDenoiser()
    path: PositionPath = PositionPath()

    def after(
        self, nominal: VehicleState, delay_s: float, state_at: StateAt | None, priors: ErrorPriors
    ) -> VehicleMotion:
        """The motion at a later capture with the delay ``delay_s``; ``nominal``: the vehicle state without delay."""
        slow, at = ZERO3, nominal
        if state_at is not None:
            half_ns, at_ns = ns_from_s(0.5 * SPAN_S), nominal.boot_ns - ns_from_s(delay_s)
            before, captured, later = (state_at(BootNs(at_ns + k * half_ns)) for k in (-1, 0, 1))
            if not (isinstance(before, Unpaired) or isinstance(later, Unpaired)):
                slow = slow_rates(before, later)
            if not isinstance(captured, Unpaired):
                at = captured
        path = self.path
        if at.position_ned is not None:
            path = path.after(s_from_ns(at.boot_ns), at.position_ned, at.velocity_ned or ZERO3, priors)
        return VehicleMotion(slow, self.denoiser.with_state(nominal, slow, priors.attitude_noise), path)


def in_motion(
    batch: MeasurementBatch, captures_s: Array, motions: Sequence[VehicleMotion], sample: Sequence[int]
) -> MeasurementBatch:
    """The batch with positions on the smoothed path, and with denoised rates.

    ``captures_s`` (N): nominal captures; ``sample`` (N): index in ``motions`` of each measurement.
    """
    rates = np.array([(motion.slow, motion.denoiser.shares) for motion in motions])[sample]
    paths, poses = tuple([m.path for m in motions]), denoised(batch.poses, rates)
    if not paths[0].begun:
        return msgspec.structs.replace(batch, poses=poses)
    point = np.array([(path.at_s, *path.position, *path.velocity) for path in paths])[sample]
    at_s, position, velocity = point[:, 0], point[:, 1:4], point[:, 4:]
    since_s = captures_s[:, None] - poses.delay_s - at_s[:, None]
    positions = position[:, None] + 0.5 * (poses.velocity_ned + velocity[:, None]) * since_s[..., None]
    nominal = position[:, 2] + velocity[:, 2] * (captures_s - at_s)
    poses, down = (
        msgspec.structs.replace(poses, position_ned=positions),
        np.where(batch.ranged, nominal, batch.camera_down),
    )
    return msgspec.structs.replace(batch, poses=poses, camera_down=down, sample=np.array(sample), paths=paths)


def smoothed_back(batches: Sequence[MeasurementBatch]) -> list[Array]:
    """Corrections (S, 3) of the points of each batch's path by all later points, in the order of the batches."""
    found, later, shift = list[Array](), PositionPath(), ZERO3
    for batch in reversed(batches):
        own = list[Vector3]()
        for path in reversed(batch.paths):
            shift, later = path.shift_by(later, shift), path
            own.append(shift)
        found.append(np.array(own[::-1] or [ZERO3]))
    return found[::-1]


def moved(batch: MeasurementBatch, shifts: Array) -> MeasurementBatch:
    """The batch with the points of its path moved by ``shifts`` (S, 3)."""
    shift = shifts[batch.sample]
    down = batch.camera_down + np.where(batch.ranged, shift[:, 2], 0.0)
    poses = msgspec.structs.replace(batch.poses, position_ned=batch.poses.position_ned + shift[:, None])
    return msgspec.structs.replace(batch, poses=poses, camera_down=down)
