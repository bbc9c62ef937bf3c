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

MOST_NODES = 6
NOTHING: Quaternion = (0.0, 0.0, 0.0, 0.0)
Coefficients: TypeAlias = tuple[float, float, float, float, float, float]
"""Of powers of seconds, lowest first."""
Piece: TypeAlias = tuple[BootNs, Coefficients, Coefficients, Coefficients, Coefficients]
"""The instant that counts as 0, and the polynomials of w, x, y, z."""


def quaternion_at(piece: Piece, boot_ns: BootNs) -> Quaternion:
    """The unit quaternion there. The hottest function of this room: unrolled on purpose."""
    t0, (w0, w1, w2, w3, w4, w5), (x0, x1, x2, x3, x4, x5), (y0, y1, y2, y3, y4, y5), (z0, z1, z2, z3, z4, z5) = piece
    s = (boot_ns - t0) * 1e-9
    w = w0 + s * (w1 + s * (w2 + s * (w3 + s * (w4 + s * w5))))
    x = x0 + s * (x1 + s * (x2 + s * (x3 + s * (x4 + s * x5))))
    y = y0 + s * (y1 + s * (y2 + s * (y3 + s * (y4 + s * y5))))
    z = z0 + s * (z1 + s * (z2 + s * (z3 + s * (z4 + s * z5))))
    n = 1.0 / sqrt(w * w + x * x + y * y + z * z)
    return (w * n, x * n, y * n, z * n)


def rates_at(piece: Piece, boot_ns: BootNs) -> Vector3:
    """The body rates of the course, rad/s, body axes: 2 q* dq/dt."""
    s = (boot_ns - piece[0]) * 1e-9
    (w, dw), (x, dx), (y, dy), (z, dz) = [_value_and_slope(c, s) for c in piece[1:]]
    twice = 2.0 / (w * w + x * x + y * y + z * z)
    return (
        twice * (w * dx - x * dw - y * dz + z * dy),
        twice * (w * dy - y * dw - z * dx + x * dz),
        twice * (w * dz - z * dw - x * dy + y * dx),
    )


def _value_and_slope(c: Coefficients, s: float) -> tuple[float, float]:
    c0, c1, c2, c3, c4, c5 = c
    value = c0 + s * (c1 + s * (c2 + s * (c3 + s * (c4 + s * c5))))
    return value, c1 + s * (2.0 * c2 + s * (3.0 * c3 + s * (4.0 * c4 + s * 5.0 * c5)))


def piece_through(t0: BootNs, samples: Sequence[AttitudeSample]) -> Piece:
    """Through two to six attitudes, in order of time."""
    nodes = [(sample.boot_ns - t0) * 1e-9 for sample in samples]
    quaternions = aligned([sample.ned_from_body for sample in samples])
    powers = _polynomial(nodes, quaternions)
    powers += [NOTHING] * (MOST_NODES - len(powers))
    w, x, y, z = zip(*powers, strict=True)
    return (t0, w, x, y, z)


def piece_with_rates(first: AttitudeSample, last: AttitudeSample, rates_first: Vector3, rates_last: Vector3) -> Piece:
    """Through two attitudes, with these body rates at them: a cubic Hermite of each component."""
    h = (last.boot_ns - first.boot_ns) * 1e-9
    q0, q1 = aligned([first.ned_from_body, last.ned_from_body])
    d0, d1 = _derivative(q0, rates_first), _derivative(q1, rates_last)
    w, x, y, z = (
        (
            q0[k],
            d0[k],
            (3.0 * (q1[k] - q0[k]) / h - 2.0 * d0[k] - d1[k]) / h,
            (d0[k] + d1[k] - 2.0 * (q1[k] - q0[k]) / h) / (h * h),
            0.0,
            0.0,
        )
        for k in range(4)
    )
    return (first.boot_ns, w, x, y, z)


def _derivative(q: Quaternion, rates: Vector3) -> Quaternion:
    """dq/dt = q (0, rates) / 2."""
    w, x, y, z = q
    p, r, s = 0.5 * rates[0], 0.5 * rates[1], 0.5 * rates[2]
    return (-x * p - y * r - z * s, w * p + y * s - z * r, w * r - x * s + z * p, w * s + x * r - y * p)


def aligned(quaternions: Sequence[Quaternion]) -> list[Quaternion]:
    """The same rotations with signs chosen so that neighbours lie on one hemisphere."""
    out = [quaternions[0]]
    for w, x, y, z in quaternions[1:]:
        pw, px, py, pz = out[-1]
        out.append((w, x, y, z) if w * pw + x * px + y * py + z * pz >= 0.0 else (-w, -x, -y, -z))
    return out


def _polynomial(nodes: list[float], quaternions: Sequence[Quaternion]) -> list[Quaternion]:
    """Newton's divided differences, expanded to powers; all four components at once."""
    divided = list(quaternions)
    for order in range(1, len(nodes)):
        for k in range(len(nodes) - 1, order - 1, -1):
            (a, b, c, d), (e, f, g, h), s = divided[k], divided[k - 1], nodes[k] - nodes[k - order]
            divided[k] = ((a - e) / s, (b - f) / s, (c - g) / s, (d - h) / s)
    powers = divided[-1:]
    for node, coefficient in zip(reversed(nodes[:-1]), reversed(divided[:-1]), strict=True):
        # Horner's scheme, on polynomials: multiply by (s - node), then add the coefficient.
        lower = [coefficient, *powers[:-1]]
        powers = [*(_less(low, node, high) for low, high in zip(lower, powers, strict=True)), powers[-1]]
    return powers


def _less(q: Quaternion, s: float, p: Quaternion) -> Quaternion:
    """Q - s p."""
    (a, b, c, d), (e, f, g, h) = q, p
    return (a - s * e, b - s * f, c - s * g, d - s * h)
