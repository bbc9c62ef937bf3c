"""The errors that many fixes share, scaled for filters: a fix weighed with its biases, not only with its noise.

A fix is ``truth + noise + J b`` with biases b that stand (or wander slowly) through a flight. An estimate blended from
fixes has an error that shares those biases: filters here carry ``shared = cov(error, b / sigma)`` beside the covariance
of their noise. Biases are considered, never estimated, and a covariance cannot shrink below what averaging leaves.
"""

from __future__ import annotations

from math import exp, sqrt
from typing import TypeAlias

import msgspec

from fwav_companion.geometry.small_matrices import add_diagonal
from fwav_companion.geometry.stamps import HostNs, s_from_ns
from fwav_companion.geometry.vectors import Matrix3, Vector3, add_matrices, outer, scale
from fwav_companion.tracking.filters.gates import widest_gate
from fwav_companion.types import Bias, ErrorPriors, GroundFix

Row: TypeAlias = tuple[float, ...]
Rows: TypeAlias = tuple[Row, Row, Row]
"""North, east, down by the biases in use."""

TELEMETRY_STEP_S = 0.1
"""Height and position arrive at 10 Hz ([rates] position) and are interpolated: frames that come faster share their
noise, so it averages as the samples do, not as the frames do."""

DOWN_FLOOR_M2 = 0.02**2
"""No ground is flatter: keeps the algebra regular where a plane leaves the height of a fix without any error."""


MOST_TURN_COSINE = 0.7
"""45 degrees: no noise turns a sight more, but right above the target, where no azimuth matters."""

MOST_REMEMBERED = 256
"""Fixes: those of a frame, a megabyte."""


class Measurement(msgspec.Struct, frozen=True, gc=False):
    """A fix as a filter takes it."""

    position: Vector3
    noise: Matrix3
    """Fresh in this fix, m^2."""
    shared: Rows
    """J sigma: metres per sigma of each bias in use."""
    gate: float
    """The widest that it is asked about."""


class ConsiderBiases:
    """The biases that have a prior at all, their scales, and how the wandering ones fade."""

    __slots__ = (
        "_attitude_noise2",
        "_height_noise2",
        "_position_noise2",
        "_remembered",
        "_used",
        "_wander_s",
        "count",
        "timed",
        "wandering",
    )

    def __init__(self, priors: ErrorPriors) -> None:
        # The wandering ones come last, so that standing and wandering parts of a row are two slices.
        last = (Bias.POSITION_NORTH, Bias.POSITION_EAST)
        used = [bias for bias in Bias if priors.sigma(bias) > 0.0 and bias not in last]
        self.wandering = len(used)
        """Where the wandering biases begin."""
        used += [bias for bias in last if priors.sigma(bias) > 0.0]
        self.count = len(used)
        self.timed = used.index(Bias.TIME_OFFSET) if Bias.TIME_OFFSET in used else None
        """Where the time offset stands."""
        self._used = tuple((int(bias), priors.sigma(bias)) for bias in used)
        self._wander_s = priors.position_bias_time_s
        self._remembered: dict[int, tuple[GroundFix, Measurement]] = {}
        self._attitude_noise2 = priors.attitude_noise**2
        self._height_noise2 = priors.height_noise_m**2
        self._position_noise2 = priors.position_noise_m**2

    def weighed(self, fix: GroundFix) -> Measurement:
        """The fix alone with its scaled Jacobian; weighed once for all the tracks that are asked about it."""
        remembered = self._remembered.get(id(fix))
        if remembered is not None and remembered[0] is fix:
            return remembered[1]
        if len(self._remembered) >= MOST_REMEMBERED:
            self._remembered.clear()
        noise, gate = add_diagonal(fix.noise_cov, 0.0, DOWN_FLOOR_M2), widest_gate(fix.sighting.detection)
        weighed = Measurement(fix.position_ned, noise, self._scaled(fix), gate)
        self._remembered[id(fix)] = (fix, weighed)
        return weighed

    def weighed_after(self, fix: GroundFix, since_s: float, target_ned: Vector3 | None = None) -> Measurement:
        """The fix as one that comes so long after another: what they have of the same telemetry is no news.

        ``target_ned``: where the target is believed to stand; the fix's noise is then that of a sight to there.
        """
        weighed = self.weighed(fix)
        noise = weighed.noise
        if since_s < TELEMETRY_STEP_S:
            repeated = TELEMETRY_STEP_S / max(since_s, 1e-3) - 1.0
            noise = self._with_repeats(noise, fix.bias_jacobian[Bias.HEIGHT], repeated)
        if since_s < fix.sighting.state.spacing_s:
            noise = self._with_attitudes(noise, fix, fix.sighting.state.spacing_s / max(since_s, 1e-3) - 1.0)
        if target_ned is not None:
            noise = turned_toward(noise, fix, target_ned)
        return weighed if noise is weighed.noise else Measurement(weighed.position, noise, weighed.shared, weighed.gate)

    def _scaled(self, fix: GroundFix) -> Rows:
        jacobian = fix.bias_jacobian
        north, east, down = [], [], []
        for i, sigma in self._used:
            n, e, d = jacobian[i]
            north.append(n * sigma)
            east.append(e * sigma)
            down.append(d * sigma)
        return (tuple(north), tuple(east), tuple(down))

    def _with_repeats(self, noise: Matrix3, by_height: Vector3, repeated: float) -> Matrix3:
        (nn, ne, nd), (_, ee, ed), (_, _, dd) = noise
        n, e, d = by_height
        height, position = repeated * self._height_noise2, repeated * self._position_noise2
        nn, ne, ee = nn + height * n * n + position, ne + height * n * e, ee + height * e * e + position
        nd, ed, dd = nd + height * n * d, ed + height * e * d, dd + height * d * d
        return ((nn, ne, nd), (ne, ee, ed), (nd, ed, dd))

    def _with_attitudes(self, noise: Matrix3, fix: GroundFix, repeated: float) -> Matrix3:
        """Where attitudes come more slowly than frames, fixes between the same two share their noise."""
        variance = repeated * self._attitude_noise2
        for axis in (Bias.ROLL, Bias.PITCH, Bias.HEADING):
            by_turn = fix.bias_jacobian[axis]
            noise = add_matrices(noise, outer(by_turn, scale(by_turn, variance)))
        return noise

    def kept(self, from_ns: HostNs, to_ns: HostNs) -> float:
        """The share of the wandering biases that is left after this time: the vehicle's position error is forgotten."""
        if self.wandering == self.count or to_ns == from_ns or not self._wander_s > 0.0:
            return 1.0
        return exp(-s_from_ns(to_ns - from_ns) / self._wander_s)


def turned_toward(noise: Matrix3, fix: GroundFix, target_ned: Vector3) -> Matrix3:
    """The noise of a sight in the target's azimuth, of one in the fix's own.

    A fix is sure across its own line of sight, and its own noise has turned that line. Weighed so, many fixes agree
    best where all the lines meet: at the camera, and the target is drawn nearer by centimetres that no claim covers.
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


def faded(rows: Rows, wandering: int, kept: float) -> Rows:
    """Covariances with the biases when only this share of the wandering ones is left."""
    n, e, d = rows
    return (
        n[:wandering] + tuple([c * kept for c in n[wandering:]]),
        e[:wandering] + tuple([c * kept for c in e[wandering:]]),
        d[:wandering] + tuple([c * kept for c in d[wandering:]]) if any(d) else d,
    )
