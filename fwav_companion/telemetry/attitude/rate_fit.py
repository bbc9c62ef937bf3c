"""Fits how the sent body rates differ from the derivative of the attitudes, and corrects the rates.

Autopilots filter their gyroscopes before they send rates (ArduPilot: two poles at 20 Hz, 11 ms late), while the
attitude integrates unfiltered ones. A two-pole filter is undone exactly by

    rate = gain * sent + lag * d(sent)/dt + curve * d2(sent)/dt2

with gain 1, lag 2 zeta / w0 and curve 1 / w0^2, and any other delay nearly so. The three numbers are fitted to the
attitudes' own motion: the compact relation of fourth order between three values and their three slopes,

    s0 + a s- + b s+ = A (f0 - f-) / h- + B (f+ - f0) / h+

holds for neighbouring samples without the error that plain differences have in fast motion.
"""

from __future__ import annotations

from collections.abc import Sequence
from math import acos, atan2, exp, hypot, pi, sqrt

import msgspec

from fwav_companion.geometry.rotations import difference
from fwav_companion.geometry.vectors import Matrix3, Vector3, dot, scale, subtract, transform
from fwav_companion.types import AttitudeSample

MEMORY_S = 3.0
"""Time constant of the fit, seconds: a dozen beats of a slow wing. Filters do not change in flight."""
TRUST_IN_SENT = 1e-3
"""Weight of the prior, the rates as sent, against the data: it decides only what a single frequency cannot
determine."""
SAMPLES_TO_BEGIN = 30
GAINS = (0.85, 3.0)
LAGS_S = (-0.005, 0.04)
"""Range of lags that filters have (22 ms for two poles at 10 Hz), seconds. A fit outside this range means that the
stream is too slow to show the motion; its remainder may fit anything."""
MOST_OF_A_BEAT = 0.3
"""Longest lag as a share of a beat; a longer one also means that the stream is too slow. Two poles at 20 Hz are a
quarter of a beat late at 20 Hz, and seem so at 12 Hz with 30 samples a second; 15 Hz with 25 samples, which looks like
10 Hz backwards, seems late by a third."""
ALTERNATING = 0.9
"""Mean share of each step between rates that the next step undoes, above which the rates only alternate: a beat then
takes less than 2.3 samples (steps of noise undo half). Any lag and any gain fit rates that only alternate."""
SWIFT = 0.6
"""Mean share of each step that the next step undoes, above which the steps themselves show the beat best: it takes less
than 2.8 samples."""
QUIET = 1e-3
"""Rate below which rates count as not sent, rad/s."""


class RateModel(msgspec.Struct, frozen=True):
    """Correction of sent rates: ``rate = gain * sent + lag * d(sent)/dt + curve * d2(sent)/dt2``."""

    gain: float = 1.0
    lag_s: float = 0.0
    curve_s2: float = 0.0

    def response(self, frequency: float) -> tuple[float, float]:
        """(gain, lag in seconds) that the correction undoes at a frequency in rad/s."""
        real, imaginary = self.gain - self.curve_s2 * frequency * frequency, self.lag_s * frequency
        lag_s = atan2(imaginary, real) / frequency if frequency > 0.0 else self.lag_s
        return hypot(real, imaginary), lag_s

    def corrected(self, three: Sequence[AttitudeSample]) -> Vector3:
        """Corrected body rates at the middle one of three samples."""
        sent, slope, curve = _basis(three)
        return _weighted_sum(sent, self.gain, b=slope, of_b=self.lag_s, c=curve, of_c=self.curve_s2)


AS_SENT = RateModel()


class RateFit:
    """Fits the rate model by recursive least squares with a short memory, five samples at a time."""

    __slots__ = (
        "_alternating_share",
        "_count",
        "_normal",
        "_right",
        "_sent2",
        "_step2",
        "_undone2",
        "_weight",
        "_yy",
        "alternates",
        "disagreement",
        "model",
        "sent_rms",
        "usable",
    )

    def __init__(self) -> None:
        self._count = 0
        self._weight = 0.0
        self._normal = [0.0] * 6  # 00 01 02 11 12 22
        self._right = [0.0] * 3
        self._yy = 0.0
        self._sent2 = self._step2 = self._undone2 = 0.0
        self._alternating_share = 0.0
        """Mean share of each step between rates that the next step undoes."""
        self.alternates = False
        """Whether half a period of the motion lies between two samples."""
        self.sent_rms = 0.0
        """RMS of the rates as sent, rad/s."""
        self.disagreement = 0.0
        """RMS difference of the corrected rates and the attitudes' derivative, rad/s. Where the two cannot be compared,
        all alternating motion counts."""
        self.model = AS_SENT
        """Best fit of the correction."""
        self.usable = False
        """Whether rates are sent and, corrected by :attr:`model`, agree with the attitudes as a filter's output
        would."""

    def insert(self, five: Sequence[AttitudeSample], frequency: float, elapsed_s: float) -> None:
        """Update the fit with five neighbouring samples, ``elapsed_s`` after the last ones, and check the model at
        ``frequency``, rad/s.
        """
        columns, course = _equation(five)
        keep = exp(-elapsed_s / MEMORY_S)
        products = [dot(columns[i], columns[j]) for i in range(3) for j in range(i, 3)]
        self._normal = [keep * n + p for n, p in zip(self._normal, products, strict=True)]
        self._right = [keep * r + dot(c, course) for r, c in zip(self._right, columns, strict=True)]
        self._yy = keep * self._yy + dot(course, course)
        self._sent2 = keep * self._sent2 + dot(five[2].rates, five[2].rates)
        step, next_step = (subtract(five[k + 1].rates, five[k].rates) for k in (1, 2))
        self._step2 = keep * self._step2 + dot(step, step)
        self._undone2 = keep * self._undone2 - dot(step, next_step)
        self._weight = keep * self._weight + 1.0
        self._count += 1
        self.sent_rms = sqrt(self._sent2 / self._weight)
        self._alternating_share = min(1.0, self._undone2 / self._step2) if self._step2 > 0.0 else 0.0
        self.alternates = self._alternating_share > ALTERNATING
        if self._count >= SAMPLES_TO_BEGIN:
            spacing_s = (five[3].boot_ns - five[2].boot_ns) * 1e-9
            self._judge(
                [frequency, *([acos(-self._alternating_share) / spacing_s] if self._alternating_share > SWIFT else [])]
            )
        self.disagreement = self._disagreement()

    def _disagreement(self) -> float:
        if self._count < SAMPLES_TO_BEGIN or self.sent_rms < QUIET:
            return 0.0
        if self.alternates:
            return 0.5 * sqrt(self._step2 / self._weight)
        m = (self.model.gain, self.model.lag_s, self.model.curve_s2)
        n00, n01, n02, n11, n12, n22 = self._normal
        quadratic = m[0] * m[0] * n00 + m[1] * m[1] * n11 + m[2] * m[2] * n22
        quadratic += 2.0 * (m[0] * m[1] * n01 + m[0] * m[2] * n02 + m[1] * m[2] * n12)
        rest = self._yy - 2.0 * sum(a * b for a, b in zip(m, self._right, strict=True)) + quadratic
        return sqrt(max(0.0, rest) / self._weight)

    def _judge(self, frequencies: Sequence[float]) -> None:
        """Check the model at each frequency that the motion may have, rad/s."""
        n00, n01, n02, n11, n12, n22 = self._normal
        trust = TRUST_IN_SENT
        solution = _solve(
            (n00 * (1.0 + trust), n01, n02, n11 * (1.0 + trust), n12, n22 * (1.0 + trust)),
            (self._right[0] + trust * n00, self._right[1], self._right[2]),
        )
        self.model, self.usable = AS_SENT, False
        if solution is None or self.sent_rms < QUIET or self.alternates:
            return
        model = RateModel(*solution)
        if all(_is_a_filter(model, frequency) for frequency in frequencies):
            self.model, self.usable = model, True


def _is_a_filter(model: RateModel, frequency: float) -> bool:
    gain, lag_s = model.response(frequency)
    most_s = min(LAGS_S[1], MOST_OF_A_BEAT * 2.0 * pi / frequency) if frequency > 0.0 else LAGS_S[1]
    return GAINS[0] <= gain <= GAINS[1] and LAGS_S[0] <= lag_s <= most_s


def _equation(five: Sequence[AttitudeSample]) -> tuple[list[Vector3], Vector3]:
    """Compact relation about the middle sample: columns of the three unknowns, and the attitudes' side."""
    before, middle, after = five[1], five[2], five[3]
    h1, h2 = (middle.boot_ns - before.boot_ns) * 1e-9, (after.boot_ns - middle.boot_ns) * 1e-9
    whole = h1 + h2
    a, b = (h2 / whole) ** 2, (h1 / whole) ** 2
    total = 1.0 + a + b
    right = (2.0 * h1 * h2 * (h1 - h2) / whole**2 + h1 * total) / whole
    left = total - right
    turn1 = difference(before.ned_from_body, middle.ned_from_body)
    turn2 = difference(after.ned_from_body, middle.ned_from_body)
    from_before, from_after = _slope_from_rates(turn1), _slope_from_rates(turn2)
    a, b, own = a / total, b / total, 1.0 / total
    columns = [
        _weighted_sum(transform(from_before, p), a, b=m, of_b=own, c=transform(from_after, n), of_c=b)
        for p, m, n in zip(_basis(five[0:3]), _basis(five[1:4]), _basis(five[2:5]), strict=True)
    ]
    course = subtract(scale(turn2, right / h2), scale(turn1, left / h1))
    return columns, scale(course, own)


def _basis(three: Sequence[AttitudeSample]) -> tuple[Vector3, Vector3, Vector3]:
    """Sent rates at the middle sample with their first and second derivatives, by the parabola through three
    samples.
    """
    before, middle, after = three
    h1, h2 = (middle.boot_ns - before.boot_ns) * 1e-9, (after.boot_ns - middle.boot_ns) * 1e-9
    first, last = 1.0 / (h1 * (h1 + h2)), 1.0 / (h2 * (h1 + h2))
    p, m, n = before.rates, middle.rates, after.rates
    slope = _weighted_sum(p, -h2 * first, b=m, of_b=(h2 - h1) / (h1 * h2), c=n, of_c=h1 * last)
    return m, slope, _weighted_sum(p, 2.0 * first, b=m, of_b=-2.0 / (h1 * h2), c=n, of_c=2.0 * last)


def _slope_from_rates(turn: Vector3) -> Matrix3:
    """d(turn)/dt of a rotation vector from body rates: the inverse right Jacobian, I + [turn]/2 + [turn]^2/12."""
    x, y, z = turn
    xx, yy, zz = x * x / 12.0, y * y / 12.0, z * z / 12.0
    xy, xz, yz = x * y / 12.0, x * z / 12.0, y * z / 12.0
    x, y, z = 0.5 * x, 0.5 * y, 0.5 * z
    return ((1.0 - yy - zz, xy - z, xz + y), (xy + z, 1.0 - xx - zz, yz - x), (xz - y, yz + x, 1.0 - xx - yy))


def _weighted_sum(a: Vector3, of_a: float, b: Vector3, of_b: float, c: Vector3, of_c: float) -> Vector3:
    """Weighted sum of three vectors."""
    return (
        a[0] * of_a + b[0] * of_b + c[0] * of_c,
        a[1] * of_a + b[1] * of_b + c[1] * of_c,
        a[2] * of_a + b[2] * of_b + c[2] * of_c,
    )


def _solve(n: tuple[float, ...], r: tuple[float, float, float]) -> tuple[float, float, float] | None:
    """Solution of the symmetric 3x3 system (00 01 02 11 12 22), by Cholesky on a unit diagonal; None where singular."""
    if min(n[0], n[3], n[5]) <= 0.0:
        return None
    d0, d1, d2 = (1.0 / sqrt(diagonal) for diagonal in (n[0], n[3], n[5]))
    c01, c02, c12 = n[1] * d0 * d1, n[2] * d0 * d2, n[4] * d1 * d2
    p1 = 1.0 - c01 * c01
    if p1 <= 1e-12:
        return None
    l12 = (c12 - c01 * c02) / p1
    p2 = 1.0 - c02 * c02 - l12 * l12 * p1
    if p2 <= 1e-12:
        return None
    y0, y1, y2 = r[0] * d0, r[1] * d1, r[2] * d2
    y1 -= c01 * y0
    y2 -= c02 * y0 + l12 * y1
    x2 = y2 / p2
    x1 = y1 / p1 - l12 * x2
    x0 = y0 - c01 * x1 - c02 * x2
    return (x0 * d0, x1 * d1, x2 * d2)
