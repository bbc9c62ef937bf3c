"""Inputs of the tracker, made by hand from plain numbers and arrays: instants, states, fixes and views."""

from __future__ import annotations

from typing import NamedTuple

import numpy as np
from scipy.spatial.transform import Rotation

from fwav_companion.geometry.stamps import HostNs
from fwav_companion.types import (
    BIAS_COUNT,
    Bias,
    Detection,
    ErrorBudget,
    FrameView,
    GroundFix,
    Ray,
    Sighting,
    VehicleState,
)

EPOCH_NS = 1_790_000_000_000_000_000
BOOT_NS = 77_000_000_000
AHEAD = Ray((0.0, 0.0, 1.0), (0.0015, 0.0, 0.0), (0.0, 0.0015, 0.0))
IDENTITY = ((1.0, 0.0, 0.0), (0.0, 1.0, 0.0), (0.0, 0.0, 1.0))
LEVEL = np.diag([0.04, 0.04, 0.0])
NO_BUDGET = ErrorBudget(0, 0, 0, 0, 0, 0, 0, 0)


class KnownErrors(NamedTuple):
    """Covariances of a fix, given."""

    cov: tuple
    relative_cov: tuple
    budget: ErrorBudget = NO_BUDGET


def host_ns(t):
    """The host instant at t seconds."""
    return _ns(EPOCH_NS, t)


def boot_ns(t):
    """The autopilot's instant at t seconds."""
    return _ns(BOOT_NS, t)


def vector(v):
    """An array as a vector of the package's types."""
    return tuple(float(x) for x in v)


def matrix(a):
    """An array as a matrix of the package's types."""
    return tuple(vector(row) for row in a)


def a_state(
    stamp_ns,
    xyzw,
    rates,
    position,
    velocity,
    spacing_s=0.0,
    stamp_sigma_s=0.0,
    *,
    acceleration=(0.0, 0.0, 0.0),
    frequency=0.0,
):
    """The vehicle's state; the quaternion in scipy's order."""
    x, y, z, w = map(float, xyzw)
    return VehicleState(
        boot_ns=int(stamp_ns), ned_from_body=(w, x, y, z), rates=vector(rates), attitude_sigma=0.0, gap_s=0.0,
        position_ned=vector(position), velocity_ned=vector(velocity), position_sigma_m=0.0,
        height_above_home_m=float(-position[2]), spacing_s=spacing_s,
        stamp_sigma_s=stamp_sigma_s, angular_acceleration=vector(acceleration),
        turning_frequency=frequency,
    )  # fmt: skip


def a_sighting(
    now_ns,
    state,
    *,
    detection=None,
    frame=1,
    ray=AHEAD,
    pixel_sigma=4.0,
    axes=IDENTITY,
    camera_ned=(0.0, 0.0, -10.0),
):
    """One detection with its ray from a camera; ``axes``: the camera's, in NED as in the body."""
    return Sighting(
        frame=frame, index=0, frame_host_ns=HostNs(now_ns), host_ns=HostNs(now_ns),
        detection=detection or Detection(u=320.0, v=240.0), ray=ray, pixel_sigma=(pixel_sigma, pixel_sigma),
        row_fraction=0.0, time_noise_s=0.0, state=state, body_from_camera=axes, ned_from_camera=axes,
        camera_ned=camera_ned, camera_height_above_home_m=-camera_ned[2], relative=False,
    )  # fmt: skip


def a_fix(t, position, noise=LEVEL, jacobian=None, sigmas=None, **detection):
    """One fix at t seconds; ``jacobian`` is (3, BIAS_COUNT), ``sigmas`` are the biases' priors."""
    jacobian = np.zeros((3, BIAS_COUNT)) if jacobian is None else jacobian
    scaled = jacobian * (np.zeros(BIAS_COUNT) if sigmas is None else np.array(sigmas))
    shares = [np.outer(j, j) for j in scaled.T]
    relative = noise + sum(shares[: Bias.POSITION_NORTH])
    total = relative + shares[Bias.POSITION_NORTH] + shares[Bias.POSITION_EAST]
    state = a_state(boot_ns(t), Rotation.identity().as_quat(), np.zeros(3), np.array([0.0, 0.0, -10.0]), np.zeros(3))
    sighting = a_sighting(host_ns(t), state, detection=Detection(320.0, 240.0, **detection), frame=round(t * 1000))
    columns = tuple(vector(j) for j in jacobian.T)
    return GroundFix(
        sighting, vector(position), matrix(noise), columns, KnownErrors(matrix(total), matrix(relative)), "as given"
    )


def a_view(t, *fixes, sees=True):
    """One frame at t seconds."""
    return FrameView(
        frame=round(t * 1000), host_ns=host_ns(t), boot_ns=boot_ns(t), fixes=fixes, could_see=lambda _: sees
    )


def _ns(base, t):
    return int(base + round(t * 1e6) * 1000)
