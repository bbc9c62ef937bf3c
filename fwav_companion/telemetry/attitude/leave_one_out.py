"""Leave-one-out error of an interpolation: one attitude is predicted from its neighbours."""

from __future__ import annotations

from collections.abc import Sequence
from math import prod

from fwav_companion.geometry.rotations import Quaternion, conjugate, multiply
from fwav_companion.telemetry.attitude.interpolation import aligned
from fwav_companion.types import AttitudeSample


def squared_leave_one_out_error(neighbours: Sequence[AttitudeSample], sample: AttitudeSample) -> float:
    """Squared angle, rad^2, between a sample and the polynomial through its neighbours."""
    nodes = [(n.boot_ns - sample.boot_ns) * 1e-9 for n in neighbours]
    whole = prod(nodes)
    w = x = y = z = 0.0
    for at, (qw, qx, qy, qz) in zip(nodes, aligned([n.ned_from_body for n in neighbours]), strict=True):
        weight = whole / (at * prod([node - at for node in nodes if node != at]))
        w += weight * qw
        x += weight * qx
        y += weight * qy
        z += weight * qz
    return squared_angle((w, x, y, z), sample.ned_from_body)


def squared_angle(a: Quaternion, b: Quaternion) -> float:
    """Squared angle between two nearly equal attitudes, the first of nearly unit length."""
    _, x, y, z = multiply(conjugate(b), a)
    return 4.0 * (x * x + y * y + z * z)
