"""Fixes as samples of a filter: their noise is new in each fix, their biases are the same in all.

A fix is ``truth + noise + J b`` with biases b that are constant through a flight. The low-pass does not estimate them.
It carries ``C = cov(error, b / sigma)`` in addition to the covariance of its noise, so that its covariance never
shrinks below what averaging leaves (consider states; Schmidt 1966). The error of the vehicle's position wanders and is
no such bias: ``position_error``.
"""

from __future__ import annotations

from collections.abc import Mapping
from typing import Final, TypeAlias

import msgspec

from fwav_companion.geometry.small_matrices import Row, add_diagonal, add_outer
from fwav_companion.geometry.stamps import HostNs
from fwav_companion.geometry.vectors import Matrix3, Vector3
from fwav_companion.types import Bias, ErrorPriors, GroundFix

Rows: TypeAlias = tuple[Row, Row, Row]
"""Rows north, east and down, with one entry for each bias in use."""

DOWN_FLOOR_M2 = 0.02**2
"""Least variance of the ground's level, m^2: keeps the algebra regular where a plane gives a height without error."""
TELEMETRY_STEP_S = 0.1
"""Interval of height and position, s: they arrive at 10 Hz ([rates] position) and are interpolated. Frames that come
faster share their noise, and also the noise of the attitudes where those come no faster than the frames."""
WANDERING: Final = (Bias.POSITION_NORTH, Bias.POSITION_EAST)
CAUSES: Final[Mapping[Bias, str]] = {
    Bias.ROLL: "attitude",
    Bias.PITCH: "attitude",
    Bias.HEADING: "heading",
    Bias.MOUNT_X: "mount",
    Bias.MOUNT_Y: "mount",
    Bias.MOUNT_Z: "mount",
    Bias.TIME_OFFSET: "time",
    Bias.READOUT: "readout",
    Bias.HEIGHT: "height",
    Bias.TERRAIN: "terrain",
    Bias.POSITION_DELAY: "position_delay",
    Bias.LEVER_X: "lever_arm",
    Bias.LEVER_Y: "lever_arm",
    Bias.LEVER_Z: "lever_arm",
}
"""Cause of error by its name in ``limits`` of a replay's summary."""


class FixSample(msgspec.Struct, frozen=True, gc=False):
    """A fix in the form that the filter processes."""

    position: Vector3
    """Position of the fix, NED, metres."""
    noise: Matrix3
    """Covariance of the noise, m^2."""
    shared: Rows
    """J sigma: metres per sigma of each bias in use."""


class FixSampler:
    """Converts fixes to samples: knows the biases with a prior, their scales, and the noise that fixes share."""

    __slots__ = ("_columns", "_frame_ns", "_of_frame", "position_delay", "priors", "time_offset")

    def __init__(self, priors: ErrorPriors) -> None:
        self.priors = priors
        used = [bias for bias in Bias if priors.sigma(bias) > 0.0 and bias not in WANDERING]
        self._columns = tuple([(bias, priors.sigma(bias)) for bias in used])
        self.time_offset = used.index(Bias.TIME_OFFSET) if Bias.TIME_OFFSET in used else None
        """Index of the camera's time offset in every row; None where it has no prior."""
        self.position_delay = used.index(Bias.POSITION_DELAY) if Bias.POSITION_DELAY in used else None
        # The samples of one frame, by identity of their fixes: every track of a frame gates the same ones.
        self._frame_ns = HostNs(0)
        self._of_frame: dict[int, tuple[GroundFix, FixSample]] = {}

    def sample(self, fix: GroundFix) -> FixSample:
        """The sample of a fix alone."""
        known = self._of_frame.get(id(fix))  # the entry keeps the fix, so no other fix has its identity
        if known is not None:
            return known[1]
        if fix.sighting.frame_host_ns != self._frame_ns:
            self._of_frame.clear()
            self._frame_ns = fix.sighting.frame_host_ns
        north, east, (dn, de, dd) = fix.noise_cov
        sample = FixSample(fix.position_ned, (north, east, (dn, de, dd + DOWN_FLOOR_M2)), self._scaled(fix))
        self._of_frame[id(fix)] = (fix, sample)
        return sample

    def next_sample(self, fix: GroundFix, since_s: float) -> FixSample:
        """The sample of a fix that comes ``since_s`` after the track's last one, its noise inflated for correlation.

        Fixes closer than TELEMETRY_STEP_S share one sample of position and height, and fixes closer than the interval
        of the attitudes share one attitude (Bar-Shalom, Li & Kirubarajan 2001, ch. 8).
        """
        alone, priors = self.sample(fix), self.priors
        noise = alone.noise
        if since_s < TELEMETRY_STEP_S:
            repeated = TELEMETRY_STEP_S / max(since_s, 1e-3) - 1.0
            noise = add_outer(noise, repeated * priors.height_noise_m**2, fix.bias_jacobian[Bias.HEIGHT])
            noise = add_diagonal(noise, repeated * priors.position_noise_m**2, 0.0)
        if since_s < fix.sighting.state.spacing_s:
            repeated = fix.sighting.state.spacing_s / max(since_s, 1e-3) - 1.0
            for axis in (Bias.ROLL, Bias.PITCH, Bias.HEADING):
                noise = add_outer(noise, repeated * priors.attitude_noise**2, fix.bias_jacobian[axis])
        return alone if noise is alone.noise else FixSample(alone.position, noise, alone.shared)

    def report_displacement(self, sample: FixSample) -> tuple[float, float]:
        """Displacement of the vehicle's report by one sigma of the position delay, north and east, metres."""
        i = self.position_delay
        return (0.0, 0.0) if i is None else (sample.shared[0][i], sample.shared[1][i])

    def shares(self, shared: tuple[Row, Row]) -> dict[str, float]:
        """Horizontal variance of an estimate by cause, m^2. ``shared``: C, north and east."""
        shares: dict[str, float] = {}
        for (bias, _), n, e in zip(self._columns, *shared, strict=True):
            cause = CAUSES[bias]
            shares[cause] = shares.get(cause, 0.0) + (n * n + e * e)
        return shares

    def _scaled(self, fix: GroundFix) -> Rows:
        north, east, down = [], [], []
        for bias, sigma in self._columns:
            n, e, d = fix.bias_jacobian[bias]
            north.append(n * sigma)
            east.append(e * sigma)
            down.append(d * sigma)
        return (tuple(north), tuple(east), tuple(down))
