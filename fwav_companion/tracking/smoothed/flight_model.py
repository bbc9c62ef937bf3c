"""The estimator's model as it changes in flight: the ground, and the accuracy that the receiver reports."""

from __future__ import annotations

from dataclasses import replace

import msgspec

from fwav_companion.tracking.smoothed.flight_ground import surface_of
from fwav_companion.tracking.smoothed.smoothed_state import SmoothedState
from fwav_companion.types import FrameView, GroundReference, HeightReference


def follow_ground(state: SmoothedState, reference: GroundReference, level_m: float | None) -> None:
    """Take a home or an elevation model that was moved, or a rangefinder's first reading, as the ground.

    ``level_m``: level of the ground by that reading, metres above the origin.
    """
    if reference.height is HeightReference.RANGE and level_m is not None:
        reference = msgspec.structs.replace(reference, level_m=level_m)
    if reference != state.reference:
        state.reference, estimator = reference, state.estimator
        estimator.model = replace(estimator.model, ground=surface_of(reference))
        if estimator.live is not None:
            estimator.live.model = estimator.model


def follow_receiver(state: SmoothedState, view: FrameView, t: float, least_stamp_sigma_s: float) -> None:
    """Take the receiver's own accuracy at the frame's instant t, s, and the stamps' noise, from the next solve on."""
    vehicle, estimator = view.vehicle, state.estimator
    if vehicle is None:
        return
    path, noise = estimator.carrier.path, estimator.model.noise
    if vehicle.position_bias_m is not None and not state.relative:
        path.add_accuracy(t, vehicle.position_bias_m)
    worst_m = max([each.sigma_m for each in path.accuracies], default=noise.position_wander_m)
    stamp_sigma_s = max(least_stamp_sigma_s, vehicle.stamp_sigma_s)
    if (worst_m, stamp_sigma_s) != (noise.position_wander_m, noise.stamp_jitter_s):
        new = replace(noise, position_wander_m=worst_m, stamp_jitter_s=stamp_sigma_s)
        estimator.model = replace(estimator.model, noise=new)
