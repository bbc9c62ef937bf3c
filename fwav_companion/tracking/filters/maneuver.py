"""Manoeuvre detection by the fading mean of innovations (Bar-Shalom, Li & Kirubarajan 2001, ch. 11).

A constant-velocity filter lags by metres behind a walker who turns around, and loses the track. The fixes then lie on
one side of the prediction. Noise scatters them to all sides, a time offset forward and back with every wing beat: the
running mean of the innovations separates the three causes. A jump of the vehicle's position shows in the same way.
"""

from __future__ import annotations

from math import sqrt

import msgspec

from fwav_companion.geometry.small_matrices import Symmetric2
from fwav_companion.geometry.vectors import Matrix3

SHARE = 0.15
"""Share of a new innovation in the running mean: at 30 frames/s it looks back 0.2 s, a beat of 5 Hz."""
MEAN_VARIANCE = SHARE / (2.0 - SHARE)
"""Variance of the running mean over that of a single innovation."""
JUMPED = 20.0
"""Threshold of a jump: squared Mahalanobis distance of the running mean (2 degrees of freedom), which noise alone
exceeds once in 20 000 times."""
TURNED = 9.0
"""Threshold of a turn of a moving target, same statistic: noise alone exceeds it once in 90 times, and inflating the
covariance of a target that did not turn costs little. The error of a walker who stops, turns and walks on falls from
0.36 m (at 20) to 0.24; that of a walker with the model's own random accelerations is 1.06 times the optimum (1.00 at
20, 1.12 at 7)."""
LAGS = 0.8
"""Share of the squared running mean in the variance of the position: until a turn is detected, the estimate lags by the
mean. For the walker who turns, 96 % of the 95 % regions hold the truth (70 % without it, and with TURNED at 20); those
of a steady walker are 5 to 9 % wider."""
MOST_NIS = 28.0
"""Largest NIS of one innovation in the running mean: longer innovations are shortened to it (Huber 1964). A turn then
needs two innovations at least; otherwise one beyond 5 sigma, which is a false detection, would show a turn alone."""


class ManeuverLag(msgspec.Struct, frozen=True, gc=False):
    """Running mean of the innovations, horizontal. Immutable."""

    north_m: float = 0.0
    east_m: float = 0.0
    back_s: float = 0.0
    """Mean age of the innovations in the mean, seconds."""

    def with_fix(self, north_m: float, east_m: float, since_s: float) -> ManeuverLag:
        """The mean with one more innovation, ``since_s`` after the one before."""
        return ManeuverLag(
            self.north_m + SHARE * (north_m - self.north_m),
            self.east_m + SHARE * (east_m - self.east_m),
            (1.0 - SHARE) * (self.back_s + since_s),
        )

    def with_clipped(self, north_m: float, east_m: float, since_s: float, expected: Symmetric2) -> ManeuverLag:
        """The mean with one more innovation, shortened to MOST_NIS. ``expected``: its covariance by noise, m^2."""
        nn, ne, ee = expected
        weighted = ee * north_m * north_m - 2.0 * ne * north_m * east_m + nn * east_m * east_m
        most = MOST_NIS * (nn * ee - ne * ne)
        share = sqrt(most / weighted) if weighted > most > 0.0 else 1.0
        return self.with_fix(share * north_m, share * east_m, since_s)

    def is_turn(self, expected: Symmetric2, beyond: float) -> bool:
        """Whether the mean is too large for noise.

        ``expected``: covariance of a single innovation; ``beyond``: threshold of the squared Mahalanobis distance.
        """
        n, e, (nn, ne, ee) = self.north_m, self.east_m, expected
        return ee * n * n - 2.0 * ne * n * e + nn * e * e > beyond * MEAN_VARIANCE * (nn * ee - ne * ne)

    @property
    def position_cov(self) -> Matrix3:
        """Covariance of the position due to this lag: outer product of the mean with itself, m^2."""
        n, e = self.north_m, self.east_m
        return ((n * n, n * e, 0.0), (n * e, e * e, 0.0), (0.0, 0.0, 0.0))
