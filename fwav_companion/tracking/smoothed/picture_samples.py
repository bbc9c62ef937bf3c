"""The poses of pictures as the smoother's input."""

from __future__ import annotations

import numpy as np

from fwav_companion.estimation.estimator import Estimator
from fwav_companion.tracking.smoothed.flight_clock import FlightClock
from fwav_companion.types import FrameView, GroundReference, HeightReference


class PictureSamples:
    """Hands the pose of each picture to the smoother, with its frame."""

    def __init__(self, clock: FlightClock) -> None:
        self._clock = clock

    level_m: float | None = None
    """No rangefinder shows the ground's level."""

    def restart(self, *, relative: bool) -> None:
        """Do nothing: each picture brings its pose."""

    def rewind(self) -> None:
        """Do nothing: each picture brings its pose."""

    def feed(self, estimator: Estimator, reference: GroundReference, view: FrameView) -> None:
        """Hand over the pose of the frame's picture. ``reference``: the source of heights."""
        state = view.vehicle
        if state is None or state.position_ned is None:
            return
        north, east, down = state.position_ned
        height_m = reference.level_m if reference.height is HeightReference.CONSTANT else -down
        t = self._clock.seconds(view.boot_ns)
        if estimator.add_position(t, np.array([north, east, height_m]), np.zeros(3)):
            estimator.add_attitude(t, np.array(state.ned_from_body))
