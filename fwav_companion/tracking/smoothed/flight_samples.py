"""Telemetry and ground fixes as the smoother's input. Times are seconds on the autopilot's clock."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Protocol

import numpy as np

from fwav_companion.estimation.errors import Array
from fwav_companion.estimation.estimator import Estimator
from fwav_companion.estimation.kept_sightings import Sightings
from fwav_companion.geometry.rotations import rotate
from fwav_companion.geometry.stamps import BootNs, s_from_ns
from fwav_companion.geometry.vectors import Vector3, cross
from fwav_companion.types import AttitudeSample, GroundFix, Unpaired, VehicleState


class SampleSource(Protocol):
    """The vehicle's samples as sent."""

    def attitudes_after(self, boot_ns: BootNs) -> list[AttitudeSample]:
        """Attitudes later than the instant, in order of time."""

    def positions_after(self, boot_ns: BootNs) -> list[tuple[BootNs, bool]]:
        """Instants of positions later than the instant, in order, and whether the position jumped there."""

    def state_at(self, boot_ns: BootNs) -> VehicleState | Unpaired:
        """The state of the vehicle at this instant, or the reason why it is not known."""


class FlightSamples:
    """Hands each sample of the telemetry to the smoother once."""

    __slots__ = ("_attitude_ns", "_lever_m", "_position_ns", "_source")

    def __init__(self, source: SampleSource, lever_m: Vector3) -> None:
        """``lever_m``: from the reported position to the camera, body axes, metres."""
        self._source, self._lever_m = source, lever_m
        self._attitude_ns = self._position_ns = BootNs(-1)

    def restart(self) -> None:
        """Forget what was handed over: the next smoother takes all stored samples."""
        self._attitude_ns = self._position_ns = BootNs(-1)

    def feed(self, estimator: Estimator) -> None:
        """Hand over what came since."""
        for sample in self._source.attitudes_after(self._attitude_ns):
            estimator.add_attitude(s_from_ns(sample.boot_ns), np.array(sample.ned_from_body))
            self._attitude_ns = sample.boot_ns
        for boot_ns, jumped in self._source.positions_after(self._position_ns):
            if boot_ns > self._attitude_ns:
                break  # its attitude, which places the camera, is still to come
            self._position_ns = boot_ns
            state = self._source.state_at(boot_ns)
            if isinstance(state, VehicleState):
                self._add(estimator, state, reset=jumped)

    def _add(self, estimator: Estimator, state: VehicleState, *, reset: bool) -> None:
        """Add the camera's position: the vehicle's, moved by the lever arm. Its height is that above home."""
        position, velocity, height_m = state.position_ned, state.velocity_ned, state.height_above_home_m
        if position is None or velocity is None or height_m is None:
            return
        north, east, down = rotate(state.ned_from_body, self._lever_m)
        v_north, v_east, v_down = rotate(state.ned_from_body, cross(state.rates, self._lever_m))
        camera = np.array([position[0] + north, position[1] + east, height_m - down])
        moved = np.array([velocity[0] + v_north, velocity[1] + v_east, -velocity[2] - v_down])
        estimator.add_position(s_from_ns(state.boot_ns), camera, moved, reset=reset)


def sightings_of(number: int, fixes: Sequence[GroundFix]) -> Sightings:
    """The detections of a frame's fixes, in their order, without targets."""
    rays, mounts, by_u, by_v, sigma, t, rows = [], [], [], [], [], [], []
    for fix in fixes:
        sighting = fix.sighting
        t.append(s_from_ns(sighting.boot_ns))
        rows.append(sighting.row_fraction)
        mounts.append(sighting.body_from_camera)
        rays.append(sighting.ray.direction)
        by_u.append(sighting.ray.d_du)
        by_v.append(sighting.ray.d_dv)
        sigma.append(sighting.pixel_sigma)
    mount = np.array(mounts)  # (D, 3, 3)
    count, columns = len(fixes), np.array([rays, by_u, by_v]).reshape(3, len(fixes), 3)
    ray, u, v = np.einsum("dij,cdj->cid", mount, columns)  # (3, D) each, carrier axes
    frame, none = np.full(count, number, np.int64), np.full(count, -1, np.int64)
    return Sightings(np.array(t), ray, _tangents(u, v, np.array(sigma).T), frame, none, np.array(rows))


def _tangents(u: Array, v: Array, sigma: Array) -> Array:
    """Rows (2, 3, D) from a direction to pixels over their sigma (2, D): a pseudo-inverse."""
    uu, uv, vv = (u * u).sum(0), (u * v).sum(0), (v * v).sum(0)
    rows = np.stack([vv * u - uv * v, uu * v - uv * u]) / (uu * vv - uv * uv)  # (2, 3, D)
    return np.asarray(rows / sigma[:, None])
