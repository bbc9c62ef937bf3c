"""Pairs of tracks and fixes of a frame, by the live filter's joint innovation covariance.

Noise that the frame's detections share and the vehicle's errors are in the joint covariance: targets displaced alike
are one surprise. Pairs without a rival show the displacement of the frame, and the gates of the other pairs are those
given it.
"""

from __future__ import annotations

from collections.abc import Sequence
from math import log, pi, prod

import numpy as np

from fwav_companion.estimation.errors import Bools
from fwav_companion.estimation.frame_prediction import FramePrediction
from fwav_companion.tracking.clutter import Clutter, noise_area_px2
from fwav_companion.tracking.live_track import LiveTrack
from fwav_companion.tracking.pair_assignment import FramePairs
from fwav_companion.types import GroundFix
from fwav_companion.types.tracks import GateResult


def label_pairs(tracks: Sequence[LiveTrack], fixes: Sequence[GroundFix]) -> Bools:
    """Mask (D, T) of fixes and tracks of one label."""
    labels = [fix.sighting.detection.label for fix in fixes]
    return np.array([[track.label == label for track in tracks] for label in labels], np.bool_)


def frame_pairs(
    fixes: Sequence[GroundFix], prediction: FramePrediction | None, steady: set[int], against: Clutter
) -> FramePairs:
    """The pairs of a prediction. ``steady``: ids of tracks whose pairs may show the frame's displacement."""
    # A detection's pixel noise is the unit of its residual; clutter is compared with all of a fix's own noise.
    areas_px2 = [noise_area_px2(fix) for fix in fixes]
    clutter_llr = [
        against.llr_of(fix, area_px2) + against.detection_odds for fix, area_px2 in zip(fixes, areas_px2, strict=True)
    ]
    if prediction is None:
        return FramePairs(fixes, against, {}, {}, clutter_llr)
    own = [
        2.0 * log(area_px2 / (2.0 * pi * prod(fix.sighting.pixel_sigma)))
        for fix, area_px2 in zip(fixes, areas_px2, strict=True)
    ]
    alone = gates = _results(prediction, own)
    if len(prediction.target) > 1:
        certain = prediction.unambiguous(np.array([k in steady for k in prediction.target.tolist()], np.bool_))
        if 0 < len(certain) < len(prediction.target):
            gates = _results(prediction.given(certain), own)
    return FramePairs(fixes, against, gates, alone, clutter_llr)


def _results(prediction: FramePrediction, own: Sequence[float]) -> dict[tuple[int, int], GateResult]:
    rows = zip(
        prediction.detection.tolist(), prediction.target.tolist(), prediction.visible.tolist(),
        prediction.distance2.tolist(), prediction.log_det.tolist(), strict=True,
    )  # fmt: skip
    return {
        (target, fix): GateResult(distance2, log_det - own[fix])
        for fix, target, visible, distance2, log_det in rows
        if visible
    }
