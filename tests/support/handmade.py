"""Inputs of the tracker, made by hand from plain numbers and arrays: instants, states, fixes and views."""

from __future__ import annotations

from typing import NamedTuple

import numpy as np
from scipy.spatial.transform import Rotation

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


def a_fix(t, position, noise=LEVEL, jacobian=None, sigmas=None, **detection):
    """One fix at t seconds; ``jacobian`` is (3, BIAS_COUNT), ``sigmas`` are the biases' priors."""
    jacobian = np.zeros((3, BIAS_COUNT)) if jacobian is None else jacobian
    scaled = jacobian * (np.zeros(BIAS_COUNT) if sigmas is None else np.array(sigmas))
    shares = [np.outer(j, j) for j in scaled.T]
    relative = noise + sum(shares[: Bias.POSITION_NORTH])
    total = relative + shares[Bias.POSITION_NORTH] + shares[Bias.POSITION_EAST]
    camera = np.array([0.0, 0.0, -10.0])
    identity = Rotation.identity()
    sighting = Sighting(
        frame=round(t * 1000), index=0, frame_host_ns=host_ns(t), host_ns=host_ns(t),
        detection=Detection(320.0, 240.0, **detection), ray=Ray((0, 0, 1.0), (0.0015, 0, 0), (0, 0.0015, 0)),
        pixel_sigma=(4.0, 4.0), row_fraction=0.0, time_noise_s=0.0,
        state=a_state(boot_ns(t), identity.as_quat(), np.zeros(3), camera, np.zeros(3)),
        body_from_camera=matrix(np.eye(3)), ned_from_camera=matrix(np.eye(3)), camera_ned=vector(camera),
        camera_height_above_home_m=10.0, relative=False,
    )  # fmt: skip
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
