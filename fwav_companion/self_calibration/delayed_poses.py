"""Where the vehicle was at instants near a capture: what an error of the camera's time offset must be judged by.

On a flapping wing a delay of 35 ms is a third of a beat: no derivative at the capture tells the attitude then.
So the states are asked for at a grid of delays, and only between its points are they continued.
"""

from __future__ import annotations

from collections.abc import Callable
from typing import TypeAlias

import msgspec

from fwav_companion.geometry.rotations import Quaternion, exp, multiply
from fwav_companion.geometry.stamps import BootNs, ns_from_s
from fwav_companion.geometry.vectors import ZERO3, Vector3, add, scale, subtract
from fwav_companion.types import GimbalAt, Unpaired, VehicleState

StateAt: TypeAlias = Callable[[BootNs], VehicleState | Unpaired]


class VehiclePose(msgspec.Struct, frozen=True, gc=False):
    """The vehicle at one delay before the nominal capture."""

    delay_s: float
    ned_from_body: Quaternion
    """Of what carries the camera: the body, or a gimbal."""
    rates: Vector3
    """Its rates, rad/s, its own axes."""
    acceleration: Vector3
    """Of the rates, rad/s^2; zero where nothing tells it."""
    position_ned: Vector3
    velocity_ned: Vector3


def vehicle_pose(state: VehicleState, delay_s: float, acceleration: Vector3 = ZERO3) -> VehiclePose:
    """The state as a moment; what is not told of place and motion counts as none."""
    return VehiclePose(
        delay_s,
        state.ned_from_carrier,
        state.carrier_rates,
        acceleration,
        state.position_ned or ZERO3,
        state.velocity_ned or ZERO3,
    )


def continued(moment: VehiclePose, delay_s: float) -> VehiclePose:
    """The vehicle a little earlier or later: constant velocity, rates that change linearly."""
    dt = moment.delay_s - delay_s
    if dt == 0.0:
        return moment
    turn = add(scale(moment.rates, dt), scale(moment.acceleration, 0.5 * dt * dt))
    return VehiclePose(
        delay_s,
        multiply(moment.ned_from_body, exp(turn)),
        add(moment.rates, scale(moment.acceleration, dt)),
        moment.acceleration,
        add(moment.position_ned, scale(moment.velocity_ned, dt)),
        moment.velocity_ned,
    )


class DelayedPoses(msgspec.Struct, frozen=True, gc=False):
    """Moments at growing delays."""

    moments: tuple[VehiclePose, ...]

    def at(self, delay_s: float) -> VehiclePose:
        """The vehicle at this delay, continued from the nearest moment."""
        moments = self.moments
        if len(moments) == 1:
            return continued(moments[0], delay_s)
        return continued(min(moments, key=lambda moment: abs(moment.delay_s - delay_s)), delay_s)


def delayed_poses(nominal: VehicleState, delays_s: tuple[float, ...], state_at: StateAt | None) -> DelayedPoses:
    """The course about a nominal capture; where nothing can be asked, the state of the capture alone.

    A state from before the first position would put the vehicle at the origin, on the ground, and one from before a
    gimbal's first attitude the camera on the body: they are left out, and the course is continued from the others.
    """
    states: list[tuple[float, VehicleState]] = []
    if state_at is not None:
        for delay_s in delays_s:
            state = state_at(BootNs(nominal.boot_ns - ns_from_s(delay_s)))
            if not isinstance(state, Unpaired) and _tells_as_much(state, nominal):
                states.append((delay_s, state))
    if not states:
        return DelayedPoses((vehicle_pose(nominal, 0.0),))
    return DelayedPoses(
        tuple(vehicle_pose(state, delay_s, _acceleration(states, i)) for i, (delay_s, state) in enumerate(states))
    )


def _tells_as_much(state: VehicleState, nominal: VehicleState) -> bool:
    placed, carried = nominal.position_ned is not None, isinstance(nominal.gimbal, GimbalAt)
    return (state.position_ned is not None) is placed and isinstance(state.gimbal, GimbalAt) is carried


def _acceleration(states: list[tuple[float, VehicleState]], i: int) -> Vector3:
    (first, before), (last, after) = states[max(0, i - 1)], states[min(len(states) - 1, i + 1)]
    return scale(subtract(before.carrier_rates, after.carrier_rates), 1.0 / (last - first)) if last > first else ZERO3
