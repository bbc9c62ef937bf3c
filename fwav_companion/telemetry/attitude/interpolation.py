"""Interpolation of an attitude over one interval: a polynomial on the sphere of unit quaternions.

Each component of the quaternion is a polynomial in time, and the result is normalised. Composition with a fixed
rotation is linear in the components, so the result does not depend on the frame. Between attitudes a few degrees apart
it differs from a polynomial of rotation vectors by far less than either differs from the truth, at a third of the cost.
"""

from __future__ import annotations

from collections.abc import Sequence
from math import sqrt
from typing import TypeAlias

from fwav_companion.geometry.rotations import Quaternion
from fwav_companion.geometry.stamps import BootNs
from fwav_companion.geometry.vectors import Vector3
from fwav_companion.types import AttitudeSample

MOST_NODES = 6
NOTHING: Quaternion = (0.0, 0.0, 0.0, 0.0)
Nodes: TypeAlias = tuple[float, float, float, float, float]
"""Instants of the polynomial's nodes, seconds; the sixth attitude's own node is not needed."""
Coefficients: TypeAlias = tuple[float, float, float, float, float, float]
"""Newton form: c0 + (s - n0) (c1 + (s - n1) (c2 + ...)). Unused coefficients are 0."""
Segment: TypeAlias = tuple[BootNs, Nodes, Coefficients, Coefficients, Coefficients, Coefficients]
"""Instant of s = 0, the nodes, and the polynomials of w, x, y, z."""


def quaternion_at(segment: Segment, boot_ns: BootNs) -> Quaternion:
    """Unit quaternion at the instant. Unrolled, because this function costs the most time of this room."""
    t0, (n0, n1, n2, n3, n4), (w0, w1, w2, w3, w4, w5), (x0, x1, x2, x3, x4, x5), of_y, of_z = segment
    (y0, y1, y2, y3, y4, y5), (z0, z1, z2, z3, z4, z5) = of_y, of_z
    s = (boot_ns - t0) * 1e-9
    s0, s1, s2, s3, s4 = s - n0, s - n1, s - n2, s - n3, s - n4
    w = w0 + s0 * (w1 + s1 * (w2 + s2 * (w3 + s3 * (w4 + s4 * w5))))
    x = x0 + s0 * (x1 + s1 * (x2 + s2 * (x3 + s3 * (x4 + s4 * x5))))
    y = y0 + s0 * (y1 + s1 * (y2 + s2 * (y3 + s3 * (y4 + s4 * y5))))
    z = z0 + s0 * (z1 + s1 * (z2 + s2 * (z3 + s3 * (z4 + s4 * z5))))
    n = 1.0 / sqrt(w * w + x * x + y * y + z * z)
    return (w * n, x * n, y * n, z * n)


def course_at(segment: Segment, boot_ns: BootNs) -> tuple[Quaternion, Vector3, Vector3]:
    """Unit quaternion at the instant, and its rates and angular acceleration there, rad/s and rad/s^2.

    Both are in body axes: the imaginary parts of 2 q* dq/dt and of 2 q* d2q/dt2.
    """
    t0, (n0, n1, n2, n3, n4), *components = segment
    s = (boot_ns - t0) * 1e-9
    s0, s1, s2, s3, s4 = s - n0, s - n1, s - n2, s - n3, s - n4
    values, slopes, bends = [], [], []
    for c0, c1, c2, c3, c4, c5 in components:  # Horner's scheme
        v4 = c4 + s4 * c5
        v3 = c3 + s3 * v4
        v2 = c2 + s2 * v3
        v1 = c1 + s1 * v2
        values.append(c0 + s0 * v1)
        d3 = v4 + s3 * c5
        d2 = v3 + s2 * d3
        d1 = v2 + s1 * d2
        slopes.append(v1 + s0 * d1)
        bends.append(2.0 * (d1 + s0 * (d2 + s1 * (d3 + s2 * c5))))
    (w, x, y, z), (dw, dx, dy, dz), (bw, bx, by, bz) = values, slopes, bends
    square = w * w + x * x + y * y + z * z
    n, twice = 1.0 / sqrt(square), 2.0 / square
    return (
        (w * n, x * n, y * n, z * n),
        (
            twice * (w * dx - x * dw - y * dz + z * dy),
            twice * (w * dy - y * dw - z * dx + x * dz),
            twice * (w * dz - z * dw - x * dy + y * dx),
        ),
        (
            twice * (w * bx - x * bw - y * bz + z * by),
            twice * (w * by - y * bw - z * bx + x * bz),
            twice * (w * bz - z * bw - x * by + y * bx),
        ),
    )


def segment_through(t0: BootNs, samples: Sequence[AttitudeSample]) -> Segment:
    """Polynomial through two to six attitudes in order of time, by Newton's divided differences."""
    nodes = [(sample.boot_ns - t0) * 1e-9 for sample in samples]
    divided = aligned([sample.ned_from_body for sample in samples])
    count = len(nodes)
    for order in range(1, count):
        for k in range(count - 1, order - 1, -1):
            (a, b, c, d), (e, f, g, h), n = divided[k], divided[k - 1], 1.0 / (nodes[k] - nodes[k - order])
            divided[k] = ((a - e) * n, (b - f) * n, (c - g) * n, (d - h) * n)
    missing = MOST_NODES - count
    w, x, y, z = zip(*divided, *([NOTHING] * missing), strict=True)
    n0, n1, n2, n3, n4, _ = (*nodes, *([0.0] * missing))
    return (t0, (n0, n1, n2, n3, n4), w, x, y, z)


def segment_with_rates(
    first: AttitudeSample, last: AttitudeSample, rates_first: Vector3, rates_last: Vector3
) -> Segment:
    """Hermite polynomial through two attitudes with these body rates: each attitude is a double node."""
    h = (last.boot_ns - first.boot_ns) * 1e-9
    q0, q1 = aligned([first.ned_from_body, last.ned_from_body])
    d0, d1 = _derivative(q0, rates_first), _derivative(q1, rates_last)
    w, x, y, z = [_hermite(h, (a, da), (b, db)) for a, da, b, db in zip(q0, d0, q1, d1, strict=True)]
    return (first.boot_ns, (0.0, 0.0, h, h, 0.0), w, x, y, z)


def _hermite(h: float, start: tuple[float, float], end: tuple[float, float]) -> Coefficients:
    """Cubic over an interval of ``h`` seconds from the value and the slope at its two ends."""
    (a, da), (b, db) = start, end
    slope = (b - a) / h
    return (a, da, (slope - da) / h, (da - 2.0 * slope + db) / (h * h), 0.0, 0.0)


def _derivative(q: Quaternion, rates: Vector3) -> Quaternion:
    """dq/dt = q (0, rates) / 2."""
    w, x, y, z = q
    p, r, s = 0.5 * rates[0], 0.5 * rates[1], 0.5 * rates[2]
    return (-x * p - y * r - z * s, w * p + y * s - z * r, w * r - x * s + z * p, w * s + x * r - y * p)


def aligned(quaternions: Sequence[Quaternion]) -> list[Quaternion]:
    """The quaternions with signs such that neighbours lie on one hemisphere; the rotations stay the same."""
    out = [quaternions[0]]
    for w, x, y, z in quaternions[1:]:
        pw, px, py, pz = out[-1]
        out.append((w, x, y, z) if w * pw + x * px + y * py + z * pz >= 0.0 else (-w, -x, -y, -z))
    return out
