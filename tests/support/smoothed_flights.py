"""The tracker by the smoother over the small world's flights: telemetry by the truth, frames as configured."""

from __future__ import annotations

import numpy as np
from handmade import BOOT_NS, boot_ns

from fwav_companion.tracking.motions import Motions
from fwav_companion.tracking.smoothed.smoothed_tracker import SmoothedTracker
from fwav_companion.types import AttitudeSample

BEFORE_S, AHEAD_S, ATTITUDE_HZ, POSITION_HZ = 0.8, 0.2, 50.0, 10.0
"""Telemetry begins this long before the first frame and is this much ahead of each: pictures wait for attitudes."""


class WorldSamples:
    """A world's telemetry up to an instant."""

    def __init__(self, world):
        self.world, self.now_s = world, 0.0

    def _times(self, since_ns, rate_hz):
        begin = -BEFORE_S if since_ns < 0 else (since_ns - BOOT_NS) * 1e-9 + 1e-6
        first = np.ceil(begin * rate_hz)
        return [boot_ns(k / rate_hz) for k in np.arange(first, np.floor(self.now_s * rate_hz) + 1)]

    def attitudes_after(self, since_ns):
        states = [self.world.state_at(t) for t in self._times(since_ns, ATTITUDE_HZ)]
        return [AttitudeSample(state.boot_ns, state.ned_from_body, state.rates) for state in states]

    def positions_after(self, since_ns):
        return [(t, False) for t in self._times(since_ns, POSITION_HZ)]

    def state_at(self, instant_ns):
        return self.world.state_at(instant_ns)


def tracked(world, views=None, *, motions=None, kept=None, consider=False):
    """(tracker, tracks) after each frame."""
    samples = WorldSamples(world)
    tracker = SmoothedTracker(
        world.flight.priors, samples, lever_m=(0.0, 0.0, 0.0), kept=kept, motions=motions or Motions(),
        consider=consider,
    )  # fmt: skip
    for view in world.frames() if views is None else views:
        samples.now_s = min((view.boot_ns - BOOT_NS) * 1e-9 + AHEAD_S, world.flight.seconds + 0.5)
        yield tracker, tracker.on_frame(view)


def confirmed(tracks):
    """The reported tracks that are confirmed now."""
    return [track for track in tracks if track.state == "confirmed"]
