"""The poses of pictures as the smoother's input."""

from __future__ import annotations

import numpy as np

from fwav_companion.estimation.estimator import Estimator
from fwav_companion.geometry.stamps import s_from_ns
from fwav_companion.types import FrameView, GroundReference, HeightReference


class PictureSamples:
    """Hands the pose of each picture to the smoother, with its frame."""

    level_m: float | None = None
    """No rangefinder shows the ground's level."""

    def restart(self, *, relative: bool) -> None:
        """Do nothing: each picture brings its pose."""

    def feed(self, estimator: Estimator, reference: GroundReference, view: FrameView) -> None:
        """Hand over the pose of the frame's picture. ``reference``: the source of heights."""
        state = view.vehicle
        if state is None or state.position_ned is None:
            return
        north, east, down = state.position_ned
        height_m = reference.level_m if reference.height is HeightReference.CONSTANT else -down
        t = s_from_ns(view.boot_ns)
        if estimator.add_position(t, np.array([north, east, height_m]), np.zeros(3)):
            estimator.add_attitude(t, np.array(state.ned_from_body))
