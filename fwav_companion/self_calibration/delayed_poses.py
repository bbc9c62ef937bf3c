"""Poses of the vehicle at instants near the captures, by which an error of the camera's time offset is estimated.

On a flapping wing a delay of 35 ms is a third of a beat: derivatives at the capture do not give the attitude before it.
So the states are requested on a grid of delays, and extrapolated between its points only.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from typing import TypeAlias

import msgspec
import numpy as np
import numpy.typing as npt

from fwav_companion.geometry.rotations import matrix_from_quaternion
from fwav_companion.geometry.stamps import BootNs, ns_from_s, s_from_ns
from fwav_companion.geometry.vectors import ZERO3
from fwav_companion.self_calibration.arrays import Array, rotation, times
from fwav_companion.types import GimbalAt, Unpaired, VehicleState

StateAt: TypeAlias = Callable[[BootNs], VehicleState | Unpaired]


class DelayedPoses(msgspec.Struct, frozen=True):
    """Poses of the carrier of the camera (body or gimbal), with the same leading axes in every array."""

    delay_s: Array
    """Delay before the nominal capture, s."""
    ned_from_body: Array
    """(..., 3, 3), attitude."""
    rates: Array
    """(..., 3), angular rates, body axes, rad/s."""
    acceleration: Array
    """(..., 3), angular acceleration, body axes, rad/s^2."""
    position_ned: Array
    """(..., 3), position, NED, m."""
    velocity_ned: Array
    """(..., 3), velocity, NED, m/s."""

    def each(self, change: Callable[[Array], Array]) -> DelayedPoses:
        """The poses with the same change of every array, such as an index or a new axis."""
        return DelayedPoses(
            change(self.delay_s),
            change(self.ned_from_body),
            change(self.rates),
            change(self.acceleration),
            change(self.position_ned),
            change(self.velocity_ned),
        )

    def padded(self, index: npt.NDArray[np.intp]) -> DelayedPoses:
        """The poses at these points of the grid; an index beyond the grid gives its last point."""
        i = np.minimum(index, self.delay_s.shape[1] - 1)
        return self.each(lambda a: a[:, i])

    def extrapolated(self, delay_s: Array) -> DelayedPoses:
        """The poses at other delays nearby, one each: constant velocity, linearly changing rates."""
        dt = (self.delay_s - delay_s)[..., None]
        turn = self.rates * dt + self.acceleration * (0.5 * dt * dt)
        return msgspec.structs.replace(
            self,
            delay_s=delay_s,
            ned_from_body=times(self.ned_from_body, rotation(turn)),
            rates=self.rates + self.acceleration * dt,
            position_ned=self.position_ned + self.velocity_ned * dt,
        )

    def nearest(self, delay_s: Array | float) -> DelayedPoses:
        """The poses at the points of this grid (N, D) that are nearest to delays (..., N)."""
        nearest = np.abs(self.delay_s - np.asarray(delay_s)[..., None]).argmin(-1)
        index = np.arange(self.delay_s.shape[0])
        return self.each(lambda a: a[index, nearest])

    def at(self, delay_s: Array) -> DelayedPoses:
        """The poses at delays (..., N), each from the nearest point of this grid (N, D)."""
        if self.delay_s.shape[1] > 1:
            return self.nearest(delay_s).extrapolated(delay_s)
        return self.each(lambda a: a[:, 0]).extrapolated(delay_s)


def delayed_poses(
    nominals: Sequence[VehicleState], delays_s: Sequence[float], state_at: StateAt | None
) -> DelayedPoses:
    """The poses (N, D) around captures close in time, requested around the first of them and shared by all.

    Without a history, each capture has its own state as the only pose.

    A state from before the first position would put the vehicle at the origin, on the ground. A state from before a
    gimbal's first attitude would put the camera on the body. Both are left out, and extrapolated from the others.
    """
    first = min(nominals, key=lambda state: state.boot_ns)
    states: list[tuple[float, VehicleState]] = []
    if state_at is not None:
        for delay_s in delays_s:
            state = state_at(BootNs(first.boot_ns - ns_from_s(delay_s)))
            if not isinstance(state, Unpaired) and _is_as_complete(state, first):
                states.append((delay_s, state))
    if not states:
        return _poses([(0.0, state) for state in nominals]).each(lambda a: a[:, None])
    shared = _poses(states)
    later = np.array([s_from_ns(state.boot_ns - first.boot_ns) for state in nominals])
    count = len(nominals)
    poses = shared.each(lambda a: np.broadcast_to(a, (count, *a.shape)))
    return msgspec.structs.replace(poses, delay_s=later[:, None] + shared.delay_s)


def _poses(states: Sequence[tuple[float, VehicleState]]) -> DelayedPoses:
    delays = np.array([delay_s for delay_s, _ in states])
    rates = np.array([state.carrier_rates for _, state in states])
    acceleration = np.zeros_like(rates)
    if len(states) > 1 and delays[-1] != delays[0]:
        i = np.arange(len(states))
        before, after = np.maximum(i - 1, 0), np.minimum(i + 1, len(states) - 1)
        acceleration = (rates[before] - rates[after]) / (delays[after] - delays[before])[:, None]
    return DelayedPoses(
        delay_s=delays,
        ned_from_body=np.array([matrix_from_quaternion(state.ned_from_carrier) for _, state in states]),
        rates=rates,
        acceleration=acceleration,
        position_ned=np.array([state.position_ned or ZERO3 for _, state in states]),
        velocity_ned=np.array([state.velocity_ned or ZERO3 for _, state in states]),
    )


def concatenated(poses: Sequence[DelayedPoses]) -> DelayedPoses:
    """Poses of several batches as one; a shorter grid repeats its last point."""
    index = np.arange(max(each.delay_s.shape[1] for each in poses))
    padded = [each.padded(index) for each in poses]
    names = DelayedPoses.__struct_fields__
    return DelayedPoses(**{name: np.concatenate([getattr(each, name) for each in padded]) for name in names})


def _is_as_complete(state: VehicleState, nominal: VehicleState) -> bool:
    placed, carried = nominal.position_ned is not None, isinstance(nominal.gimbal, GimbalAt)
    return (state.position_ned is not None) is placed and isinstance(state.gimbal, GimbalAt) is carried
