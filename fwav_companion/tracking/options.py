"""The options of the tracker: the [tracking] table of the configuration."""

from __future__ import annotations

from typing import Annotated, Literal

import msgspec
from msgspec import Meta


class TrackingOptions(msgspec.Struct, frozen=True, kw_only=True):
    """[tracking]: how fixes become targets.

    Tracks are confirmed and deleted by a likelihood ratio, target against clutter. Its priors: detection probability
    Beta(3.5, 1.5), 0.7 on average, and false detections in a frame Gamma(0.5, 5), 0.1 on average. The flight updates
    both, the detection probability after 20 looks at confirmed targets. A target is confirmed by three detections or
    more, at a rate of one false target in ten hours. It is deleted when frames that cover it do not show it: after at
    most 15 missed looks in a row, at fast frame rates after 3 s; sooner if it was detected only a few times.
    """

    filter: Annotated[
        str, Meta(pattern=r"^(kalman|lowpass|[A-Za-z_][\w.]*:[A-Za-z_]\w*)$", description='"kalman" | "lowpass"')
    ] = "kalman"
    """Filter of one target; ``lowpass`` is the paper's. Only ``replay`` accepts a user's filter, ``module:Class``."""
    alpha: Annotated[float, Meta(gt=0, le=1)] = 0.125
    """Share of a new fix in the low-pass after 1 / alpha_rate_hz seconds."""
    alpha_rate_hz: Annotated[float, Meta(ge=0)] = 30.0
    """Rate to which alpha refers, hertz; 0: the paper's recursion, one step a frame, one sample late."""
    motion: Literal["static", "moving"] = "static"
    """Motion of the targets: at rest, or at nearly constant velocity."""
    self_calibration: bool = False
    """Whether time offset, mount and height are estimated in flight, from static targets that are seen again and again.

    The tracks of static targets are corrected by it. With ``lowpass``, a user's own filter or ``moving`` the result is
    reported and kept, and not applied to the tracks.
    """

    @property
    def is_own_filter(self) -> bool:
        """Whether ``filter`` names a class of the user's."""
        return ":" in self.filter
