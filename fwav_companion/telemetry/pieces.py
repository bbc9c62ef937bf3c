"""One interval of an attitude's course: a polynomial on the sphere of unit quaternions.

The four components of the quaternion are each a polynomial in time, and the result is brought back to unit length.
Since composing with a fixed rotation is linear in the components, this is the same course whatever frame it is told in;
between attitudes a few degrees apart it differs from a polynomial of rotation vectors by far less than either differs
from the truth, at a third of the cost.
"""

from __future__ import annotations

from collections.abc import Sequence
from math import sqrt
from typing import TypeAlias

from fwav_companion.geometry.rotations import Quaternion
from fwav_companion.geometry.stamps import BootNs
from fwav_companion.geometry.vectors import Vector3
from fwav_companion.nouns import AttitudeSample

Coefficients: TypeAlias = tuple[float, ...]
Piece: TypeAlias = tuple[BootNs, Coefficients, Coefficients, Coefficients, Coefficients]
"""The instant that counts as 0, and the polynomials of w, x, y, z in seconds, lowest power first: four coefficients."""


def quaternion_at(piece: Piece, boot_ns: BootNs) -> Quaternion:
    """The unit quaternion there. The hottest function of this room: unrolled on purpose."""
    t0, (w0, w1, w2, w3), (x0, x1, x2, x3), (y0, y1, y2, y3), (z0, z1, z2, z3) = piece
    s = (boot_ns - t0) * 1e-9
    w = w0 + s * (w1 + s * (w2 + s * w3))
    x = x0 + s * (x1 + s * (x2 + s * x3))
    y = y0 + s * (y1 + s * (y2 + s * y3))
    z = z0 + s * (z1 + s * (z2 + s * z3))
    n = 1.0 / sqrt(w * w + x * x + y * y + z * z)
    return (w * n, x * n, y * n, z * n)


def course_at(piece: Piece, boot_ns: BootNs) -> tuple[Quaternion, Vector3]:
    """The unit quaternion and the body rates (rad/s, body axes) of the course: 2 q* dq/dt."""
    s = (boot_ns - piece[0]) * 1e-9
    (w, dw), (x, dx), (y, dy), (z, dz) = [_value_and_slope(c, s) for c in piece[1:]]
    n2 = 1.0 / (w * w + x * x + y * y + z * z)
    rates = (
        2.0 * n2 * (w * dx - x * dw - y * dz + z * dy),
        2.0 * n2 * (w * dy - y * dw - z * dx + x * dz),
        2.0 * n2 * (w * dz - z * dw - x * dy + y * dx),
    )
    n = sqrt(n2)
    return (w * n, x * n, y * n, z * n), rates


def _value_and_slope(coefficients: Coefficients, s: float) -> tuple[float, float]:
    c0, c1, c2, c3 = coefficients
    return c0 + s * (c1 + s * (c2 + s * c3)), c1 + s * (2.0 * c2 + s * 3.0 * c3)


def piece_through(t0: BootNs, samples: Sequence[AttitudeSample]) -> Piece:
    """Through two to four attitudes, in order; one of them is at ``t0``."""
    nodes = [(sample.boot_ns - t0) * 1e-9 for sample in samples]
    quaternions = _aligned([sample.ned_from_body for sample in samples])
    columns = [_polynomial(nodes, [q[k] for q in quaternions]) for k in range(4)]
    return (t0, columns[0], columns[1], columns[2], columns[3])


def _aligned(quaternions: list[Quaternion]) -> list[Quaternion]:
    """The same rotations with signs chosen so that neighbours lie on one hemisphere."""
    aligned = [quaternions[0]]
    for w, x, y, z in quaternions[1:]:
        pw, px, py, pz = aligned[-1]
        aligned.append((w, x, y, z) if w * pw + x * px + y * py + z * pz >= 0.0 else (-w, -x, -y, -z))
    return aligned


def _polynomial(nodes: list[float], values: list[float]) -> Coefficients:
    """Newton's divided differences, expanded to powers and padded to four coefficients."""
    divided = list(values)
    for order in range(1, len(nodes)):
        for k in range(len(nodes) - 1, order - 1, -1):
            divided[k] = (divided[k] - divided[k - 1]) / (nodes[k] - nodes[k - order])
    powers = [0.0, 0.0, 0.0, 0.0]
    for node, coefficient in zip(reversed(nodes), reversed(divided), strict=True):
        # Horner's scheme, on polynomials: multiply by (s - node), then add the coefficient.
        for k in range(3, 0, -1):
            powers[k] = powers[k - 1] - node * powers[k]
        powers[0] = coefficient - node * powers[0]
    return tuple(powers)
