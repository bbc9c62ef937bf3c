"""Fixes as measurements of a Schmidt-Kalman filter: their noise is new in each fix, their biases are considered.

A fix is ``truth + noise + J b`` with biases b that are constant through a flight. A filter does not estimate the
biases. It carries ``C = cov(error, b / sigma)`` in addition to the covariance of its noise, so that its covariance
never shrinks below what averaging leaves (Schmidt 1966). The error of the vehicle's position wanders, and its entries
come last in every row: a filter may keep it as a state, or let its share decay.
"""

from __future__ import annotations

from collections.abc import Sequence
from math import sqrt
from typing import TypeAlias

import msgspec

from fwav_companion.geometry.small_matrices import Row, Symmetric2, add_diagonal, add_outer, gram
from fwav_companion.geometry.stamps import HostNs
from fwav_companion.geometry.vectors import ZERO3, Matrix3, Vector3
from fwav_companion.self_calibration.position_path import TELEMETRY_STEP_S
from fwav_companion.tracking.filters.gates import GATE
from fwav_companion.tracking.filters.linearization import SENSITIVE, delay_curvature
from fwav_companion.types import BIAS_COUNT, Bias, ErrorPriors, GroundFix

Rows: TypeAlias = tuple[Row, Row, Row]
"""Rows north, east and down, with one entry for each bias in use."""

BiasShare: TypeAlias = tuple[int, float, float]
"""Index of one of the biases in use, and its scaled sensitivities: north, east."""

DOWN_FLOOR_M2 = 0.02**2
"""Least variance of the ground's level, m^2: keeps the algebra regular where a plane gives a height without error."""
MOST_TURN_COSINE = 0.7
"""Cosine of 45 degrees, the largest angle by which ``turned_toward`` rotates noise. Noise turns a line of sight by more
only right above the target, where its azimuth does not matter."""
SENSITIVITY_SHARE = 0.25
"""Relative error of the sensitivities to attitude, mount and height, one sigma, that the gain allows for.

Over a descent from 15 m the sensitivities change fifteenfold, and the gain uses that. Over a hover they change by a
fifth with the beat of the wings: a gain that uses this change, too, multiplies the noise and gains little. With 0.07,
0.15 and 0.30 the error at the end was, median / worst: hover without any bias 0.08 / 0.13, 0.014 / 0.024, 0.005 /
0.009 m; figure-eight with the camera 35 ms late and the mount off by 0.5, 1, 2 deg 0.11 / 0.26, 0.09 / 0.23, 0.09 /
0.16 m; descent with the mount off by 1 deg 0.021 / 0.08, 0.025 / 0.07, 0.026 / 0.07 m."""
SENSITIVITY_STEP_S = 6.0
"""Twice the correlation time of the sensitivities' error, seconds: it stays the same while the geometry does."""
FIRST_SENSITIVITY_S = 0.1
"""Interval assumed for the first fix of a target, seconds, because no fix precedes it. With the whole correlation time
its noise would stay in the mean of the first seconds; with a frame's interval its sigma would be several times too
wide."""
WANDERING = (Bias.POSITION_NORTH, Bias.POSITION_EAST)


class Measurement(msgspec.Struct, frozen=True, gc=False):
    """A fix in the form that a filter processes."""

    position: Vector3
    """Position of the fix, NED, metres."""
    noise: Matrix3
    """Covariance of the noise, m^2."""
    shared: Rows
    """J sigma: metres per sigma of each bias in use."""
    gate: float
    """Widest gate that applies to the fix."""


LINEAR_DELAY_S = 0.02
"""Largest sigma of the time offset, seconds, that displaces a fix in proportion to its sensitivities: 0.6 rad of a wing
beat of 5 Hz, whose sine is 6 % less."""


class ConsiderBiases:
    """Converts fixes to measurements: knows the biases with a prior, their scales, and the noise that fixes share."""

    __slots__ = (
        "_delayed",
        "_frame_ns",
        "_remembered",
        "_sensitive",
        "_used",
        "count",
        "curved",
        "nonlinear",
        "priors",
        "timed",
        "wandering",
    )

    def __init__(self, priors: ErrorPriors, *, wandering: bool = True) -> None:
        """``wandering``: whether the error of the vehicle's position is among the biases."""
        self.priors = priors
        used = [bias for bias in Bias if priors.sigma(bias) > 0.0 and bias not in WANDERING]
        self._sensitive = tuple(
            (used.index(bias), k, priors.sigma(bias)) for k, bias in enumerate(SENSITIVE) if bias in used
        )
        self.timed = used.index(Bias.TIME_OFFSET) if Bias.TIME_OFFSET in used else None
        """Index of the time offset."""
        columns = [(int(bias), priors.sigma(bias)) for bias in used]
        self.curved = None if self.timed is None else len(columns)
        """Index of the time offset's square, which displaces a fix on a flapping wing to second order."""
        if self.curved is not None:
            columns.append((BIAS_COUNT, priors.sigma(Bias.TIME_OFFSET)))
        self.wandering = len(columns)
        """Index of the first wandering bias."""
        self.nonlinear = priors.sigma(Bias.TIME_OFFSET) > LINEAR_DELAY_S
        """Whether the time offset may displace fixes out of proportion to their sensitivities."""
        self._delayed = used.index(Bias.POSITION_DELAY) if Bias.POSITION_DELAY in used else None
        columns += [(int(bias), priors.sigma(bias)) for bias in WANDERING if wandering and priors.sigma(bias) > 0.0]
        self.count = len(columns)
        self._used = tuple(columns)
        # The measurements of one frame, by identity of their fixes.
        self._frame_ns = HostNs(0)
        self._remembered: dict[int, tuple[GroundFix, Measurement]] = {}

    def index_of(self, bias: Bias) -> int | None:
        """The index of a bias in every row; None where it has no prior."""
        return next((i for i, (each, _) in enumerate(self._used) if each == bias), None)

    def prepared(self, fix: GroundFix) -> Measurement:
        """The measurement of a fix alone, with its scaled Jacobian; computed once for all tracks of a frame."""
        remembered = self._remembered.get(id(fix))  # the entry keeps the fix, so no other fix has its identity
        if remembered is not None:
            return remembered[1]
        if fix.sighting.frame_host_ns != self._frame_ns:
            self._remembered.clear()
            self._frame_ns = fix.sighting.frame_host_ns
        north, east, (dn, de, dd) = fix.noise_cov
        noise, gate = (north, east, (dn, de, dd + DOWN_FLOOR_M2)), GATE
        prepared = Measurement(fix.position_ned, noise, self._scaled(fix), gate)
        self._remembered[id(fix)] = (fix, prepared)
        return prepared

    def decorrelated(self, fix: GroundFix, since_s: float, toward_ned: Vector3 | None = None) -> Measurement:
        """The measurement of a fix with its noise inflated for time correlation; ``since_s``: since the track's last.

        Fixes closer than TELEMETRY_STEP_S share one sample of position and height, and fixes closer than the interval
        of the attitudes share one attitude (Bar-Shalom, Li & Kirubarajan 2001, ch. 8). ``toward_ned``: estimated
        position of the target; the noise is then rotated into its azimuth.
        """
        prepared, priors = self.prepared(fix), self.priors
        noise = prepared.noise
        if since_s < TELEMETRY_STEP_S:
            repeated = TELEMETRY_STEP_S / max(since_s, 1e-3) - 1.0
            noise = add_outer(noise, repeated * priors.height_noise_m**2, fix.bias_jacobian[Bias.HEIGHT])
            noise = add_diagonal(noise, repeated * priors.position_noise_m**2, 0.0)
        if since_s < fix.sighting.state.spacing_s:
            repeated = fix.sighting.state.spacing_s / max(since_s, 1e-3) - 1.0
            for axis in (Bias.ROLL, Bias.PITCH, Bias.HEADING):
                noise = add_outer(noise, repeated * priors.attitude_noise**2, fix.bias_jacobian[axis])
        if toward_ned is not None:
            noise = turned_toward(noise, fix, toward_ned)
        if noise is prepared.noise:
            return prepared
        return Measurement(prepared.position, noise, prepared.shared, prepared.gate)

    def relinearized(
        self, measurement: Measurement, fix: GroundFix, columns: Sequence[tuple[float, float]], since_s: float
    ) -> Measurement:
        """The measurement of a fix with other sensitivities ``columns``: d(north, east)/d(bias), in the order of
        SENSITIVE. Their error is added to the noise, and the second-order effect of the time offset to the rows.
        """
        north, east, down = list(measurement.shared[0]), list(measurement.shared[1]), measurement.shared[2]
        nn = ne = ee = 0.0
        for i, k, sigma in self._sensitive:
            n, e = columns[k]
            north[i], east[i] = n, e = n * sigma, e * sigma
            nn, ne, ee = nn + n * n, ne + n * e, ee + e * e
        if self.curved is not None:
            north[self.curved], east[self.curved] = delay_curvature(fix, self._used[self.curved][1])
        return _less_certain(measurement, (tuple(north), tuple(east), down), (nn, ne, ee), since_s)

    def at_own_ray(self, measurement: Measurement, fix: GroundFix, since_s: float) -> Measurement:
        """The measurement of a fix with its own sensitivities: their error and the second-order effect of the time
        offset are added as in :meth:`relinearized`.
        """
        (north, east, down), sensitive = measurement.shared, [i for i, _, _ in self._sensitive]
        by_sensitivities = gram(tuple([north[i] for i in sensitive]), tuple([east[i] for i in sensitive]))
        if (i := self.curved) is not None:
            n, e = delay_curvature(fix, self._used[i][1])
            north, east = (*north[:i], n, *north[i + 1 :]), (*east[:i], e, *east[i + 1 :])
        return _less_certain(measurement, (north, east, down), by_sensitivities, since_s)

    def by_delay(self, measurement: Measurement) -> BiasShare | None:
        """Sensitivity of a measurement to the position delay; None where that has no prior."""
        i = self._delayed
        return None if i is None else (i, measurement.shared[0][i], measurement.shared[1][i])

    def shares(self, shared: tuple[Row, Row]) -> dict[Bias, float]:
        """Horizontal variance of an estimate due to each bias in use, m^2. ``shared``: C, north and east."""
        shares = {i: n * n + e * e for (i, _), n, e in zip(self._used, *shared, strict=True)}
        if self.curved is not None:
            shares[Bias.TIME_OFFSET] += shares.pop(BIAS_COUNT)
        return {Bias(i): share for i, share in shares.items()}

    def _scaled(self, fix: GroundFix) -> Rows:
        jacobian, north, east, down = (*fix.bias_jacobian, ZERO3), [], [], []
        for bias, sigma in self._used:
            n, e, d = jacobian[bias]
            north.append(n * sigma)
            east.append(e * sigma)
            down.append(d * sigma)
        return (tuple(north), tuple(east), tuple(down))


def _less_certain(measurement: Measurement, shared: Rows, by_sensitivities: Symmetric2, since_s: float) -> Measurement:
    """The measurement with the rows ``shared``, and with their error added to its noise.

    ``by_sensitivities``: Gram matrix of the rows' entries for SENSITIVE, m^2.
    """
    share = SENSITIVITY_SHARE**2 * max(1.0, SENSITIVITY_STEP_S / max(since_s, 1e-3))
    ((nn, ne, nd), (_, ee, ed), down), (by_nn, by_ne, by_ee) = measurement.noise, by_sensitivities
    nn, ne, ee = nn + share * by_nn, ne + share * by_ne, ee + share * by_ee
    return Measurement(measurement.position, ((nn, ne, nd), (ne, ee, ed), down), shared, measurement.gate)


def turned_toward(noise: Matrix3, fix: GroundFix, target_ned: Vector3) -> Matrix3:
    """The covariance of a fix's noise, rotated into the azimuth of the target.

    A fix is certain across its own line of sight, but its noise has turned that line. Many fixes with such weights
    agree best where all lines meet: at the camera. They would draw the estimate towards the camera by centimetres that
    its covariance does not cover.
    """
    camera_n, camera_e, _ = fix.sighting.camera_ned
    fix_n, fix_e = fix.position_ned[0] - camera_n, fix.position_ned[1] - camera_e
    to_n, to_e = target_ned[0] - camera_n, target_ned[1] - camera_e
    both = sqrt((fix_n * fix_n + fix_e * fix_e) * (to_n * to_n + to_e * to_e))
    if fix_n * to_n + fix_e * to_e <= MOST_TURN_COSINE * both:
        return noise
    c, s = (fix_n * to_n + fix_e * to_e) / both, (fix_n * to_e - fix_e * to_n) / both
    (nn, ne, nd), (_, ee, ed), (_, _, dd) = noise
    turned_nn = c * c * nn - 2.0 * c * s * ne + s * s * ee
    turned_ne = c * s * (nn - ee) + (c * c - s * s) * ne
    turned_ee = s * s * nn + 2.0 * c * s * ne + c * c * ee
    turned_nd, turned_ed = c * nd - s * ed, s * nd + c * ed
    return ((turned_nn, turned_ne, turned_nd), (turned_ne, turned_ee, turned_ed), (turned_nd, turned_ed, dd))
