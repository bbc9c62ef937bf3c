"""The point at which the sensitivities of a fix to its biases are evaluated: near the fix, but without its noise.

A Schmidt-Kalman gain compares the sensitivities of fixes with one another. Sensitivities at the fix itself contain its
noise of attitude and height, and the gain takes that noise for information about mount and height: a hover with 0.3 m
of height noise ended 2.2 m off with a normalised squared error of 7 (at this point 1.1 m and 1.7). Sensitivities at the
predicted target are wrong near the ground, where an error of the prediction is as large as the height. So the point
follows the fixes: it is their running mean, seen from the camera at a smoothed height.
"""

from __future__ import annotations

from math import exp, expm1, sqrt

import msgspec

from fwav_companion.geometry.rotations import body_axes_ned
from fwav_companion.geometry.small_matrices import Symmetric2
from fwav_companion.geometry.vectors import Vector3, combination
from fwav_companion.self_calibration.position_path import TELEMETRY_STEP_S
from fwav_companion.types import Bias, ErrorPriors, GroundFix

MEAN_S = 0.7
"""Time constant of the running mean of the fixes, seconds: three wing beats of 5 Hz. Between 0.5 and 1 s the errors
at the end of hovers, descents and figure-eights differ by less than a tenth."""
CLIMB_DENSITY = 0.05
"""Spectral density of the vertical acceleration, m^2/s^3: the climb changes by 0.2 m/s within a second."""
START_CLIMB_VARIANCE = 1.0
"""Variance of the first vertical speed, (m/s)^2."""
LEAST_HEIGHT_SIGMA_M = 0.02
"""Smallest sigma of one height, metres: its resolution, and the level of the ground."""
SENSITIVE = (Bias.ROLL, Bias.PITCH, Bias.MOUNT_X, Bias.MOUNT_Y, Bias.MOUNT_Z, Bias.HEIGHT, Bias.TARGET_HEIGHT)
"""Biases whose sensitivities contain the noise of the fix."""
SLOWEST = 1e-3
"""Smallest angular frequency of a swing, rad/s: a slower swing is as good as a constant acceleration."""


class LinearizationPoint(msgspec.Struct, frozen=True, gc=False):
    """Point at which sensitivities are evaluated: smoothed height above the target, and running mean of the fixes."""

    height_m: float
    """Height of the camera above the target's ground, metres."""
    climb_m_s: float
    height_cov: Symmetric2
    """Covariance of height and climb."""
    north_m: float
    """Running mean of the fixes, NED, metres."""
    east_m: float
    count: int = 1
    """Number of fixes."""

    def with_fix(
        self, height_m: float, north_m: float, east_m: float, *, interval_s: float, sigma_m: float
    ) -> LinearizationPoint:
        """The point after one more fix.

        A Kalman filter of nearly constant vertical velocity smooths the height. ``sigma_m``: noise of ``height_m``.
        """
        dt, (hh, hc, cc), count = interval_s, self.height_cov, self.count + 1
        predicted_m = self.height_m + dt * self.climb_m_s
        hh += dt * (2.0 * hc + dt * (cc + CLIMB_DENSITY * dt / 3.0))
        hc += dt * (cc + CLIMB_DENSITY * dt / 2.0)
        cc += CLIMB_DENSITY * dt
        by_height = 1.0 / (hh + height_variance(sigma_m, dt))
        height_gain, climb_gain = hh * by_height, hc * by_height
        innovation_m = height_m - predicted_m
        share = max(1.0 / count, 1.0 - exp(-dt / MEAN_S))
        return LinearizationPoint(
            predicted_m + height_gain * innovation_m,
            self.climb_m_s + climb_gain * innovation_m,
            (hh - height_gain * hh, hc - height_gain * hc, cc - climb_gain * hc),
            self.north_m + share * (north_m - self.north_m),
            self.east_m + share * (east_m - self.east_m),
            count,
        )


def first_point(fix: GroundFix, sigma_m: float) -> LinearizationPoint:
    """The point of a first fix: the fix itself. ``sigma_m``: noise of its height."""
    height_cov = (height_variance(sigma_m, TELEMETRY_STEP_S), 0.0, START_CLIMB_VARIANCE)
    return LinearizationPoint(fix.height_above_target_m, 0.0, height_cov, fix.position_ned[0], fix.position_ned[1])


def height_noise_m(fix: GroundFix, priors: ErrorPriors) -> float:
    """One sigma of the noise of a fix's height, metres; 0, which is the least one, of a height by a tag's size.

    Low over a pad a height that is smoothed by the barometer's noise lags behind the descent, and passes the ground.
    """
    return priors.height_noise_m if fix.best_height_m is None else 0.0


def height_variance(sigma_m: float, interval_s: float) -> float:
    """Variance of one height, as if its noise were independent: heights between two telemetry samples repeat them."""
    repeats = max(1.0, TELEMETRY_STEP_S / max(interval_s, 1e-3))
    return max(sigma_m * sigma_m, LEAST_HEIGHT_SIGMA_M**2) * repeats


def is_level(fix: GroundFix) -> bool:
    """Whether sensitivities at another point need no terrain: the ground is level, and the height is above home."""
    return fix.ground == "home" and not fix.sighting.relative


def level_columns(fix: GroundFix, north_m: float, east_m: float, height_m: float) -> tuple[tuple[float, float], ...]:
    """d(north, east)/d(bias) of a point on level ground, (north, east) from the camera and ``height_m`` below it.

    One column for each bias of SENSITIVE. At the fix itself they equal those of ``localization.propagation``.
    """
    ray = (north_m, east_m, height_m)
    x, y, z = body_axes_ned(fix.sighting.state.ned_from_carrier)
    (roll_n, roll_e), (pitch_n, pitch_e), (yaw_n, yaw_e) = _turned(x, ray), _turned(y, ray), _turned(z, ray)
    per_n, per_e, target_m = north_m / height_m, east_m / height_m, fix.sighting.anchor_sigma_m
    return (
        (roll_n, roll_e),
        (pitch_n, pitch_e),
        (-roll_n, -roll_e),
        (-pitch_n, -pitch_e),
        (-yaw_n, -yaw_e),
        (per_n, per_e),
        (-target_m * per_n, -target_m * per_e),
    )


def _turned(axis: Vector3, ray: Vector3) -> tuple[float, float]:
    """d(north, east)/d(rotation w about an axis) of a point on the ground: w x r, then along the ray r to ground."""
    (x, y, z), (north_m, east_m, height_m) = axis, ray
    down = x * east_m - y * north_m
    return (
        y * height_m - z * east_m - down * (north_m / height_m),
        z * north_m - x * height_m - down * (east_m / height_m),
    )


def delay_curvature(fix: GroundFix, sigma_s: float) -> tuple[float, float]:
    """One sigma of the second-order displacement of a fix by a delay of this sigma, north and east, metres.

    The ray r to level ground turns at the rate w with the acceleration a. With the relative change of its length
    k = (w x r)_z / r_z, its derivatives are r' = w x r - k r and r'' = a x r + w x r' - k r' - k' r. A fix that swings
    as sin(f t) is displaced by r'' (1 - cos(f d)) / f^2. Over the delays d this is uncorrelated with sin(f d), and its
    sigma is (1 - exp(-f^2 sigma^2)) / sqrt(2) times r'' / f^2: for slow swings r'' sigma^2 / sqrt(2).
    """
    state, (north_m, east_m, down_m) = fix.sighting.state, fix.position_ned
    camera_n, camera_e, camera_d = fix.sighting.camera_ned
    north_m, east_m, height_m = north_m - camera_n, east_m - camera_e, down_m - camera_d
    axes = body_axes_ned(state.ned_from_carrier)
    if height_m <= 0.0:
        return (0.0, 0.0)
    w_n, w_e, w_d = combination(axes, state.carrier_rates)
    a_n, a_e, a_d = combination(axes, state.carrier_acceleration)
    k = (w_n * east_m - w_e * north_m) / height_m
    by_n, by_e = w_e * height_m - w_d * east_m - k * north_m, w_d * north_m - w_n * height_m - k * east_m
    k_more = (a_n * east_m - a_e * north_m + w_n * by_e - w_e * by_n) / height_m
    more_n = a_e * height_m - a_d * east_m - w_d * by_e - k * by_n - k_more * north_m
    more_e = a_d * north_m - a_n * height_m + w_d * by_n - k * by_e - k_more * east_m
    f2 = max(state.turning_frequency, SLOWEST) ** 2
    size = -expm1(-f2 * sigma_s * sigma_s) * sqrt(0.5) / f2
    return (size * more_n, size * more_e)
