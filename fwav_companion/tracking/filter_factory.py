"""Construction of the tracker that a configuration selects."""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from typing import TYPE_CHECKING

from fwav_companion.geometry.vectors import Vector3
from fwav_companion.tracking.filters.base import Filter
from fwav_companion.tracking.filters.filter_tracker import FilterTracker
from fwav_companion.tracking.filters.lowpass import LowPass
from fwav_companion.tracking.frame_tracker import FrameTracker
from fwav_companion.tracking.motions import Motions
from fwav_companion.tracking.options import TrackingOptions
from fwav_companion.types import ErrorPriors, GroundReference, Landmark
from fwav_companion.types.calibration_report import KeptCalibration

if TYPE_CHECKING:
    from fwav_companion.tracking.smoothed.sample_source import SampleSource
    from fwav_companion.tracking.smoothed.solve_jobs import SmootherOptions


def filter_tracker(
    options: TrackingOptions,
    priors: ErrorPriors,
    own_filter: Filter | None = None,
    *,
    calibrating: FrameTracker | None = None,
) -> FilterTracker:
    """The tracker by the paper's low-pass, or by a filter of one's own. It needs no numpy.

    ``calibrating``: the tracker by the smoother, whose values are reported and not applied; None: no self-calibration.
    """
    return FilterTracker(own_filter or LowPass(options.alpha, options.alpha_rate_hz, priors), calibrating)


def smoothed_tracker(
    options: TrackingOptions,
    priors: ErrorPriors,
    source: SampleSource | None,
    kept: KeptCalibration | None = None,
    *,
    lever_m: Vector3,
    smoother: SmootherOptions,
    ground: Callable[[], GroundReference],
    landmarks: Sequence[Landmark] = (),
    motion_of: Mapping[str, str] | None = None,
    own_poses: bool = False,
) -> FrameTracker:
    """The tracker by the smoother, for static and moving targets. It needs numpy.

    ``source``: the vehicle's telemetry; None: each picture has its own pose. ``motion_of``: motion of the targets of
    some labels, where it is not that of all targets. ``own_poses``: each frame's pose has errors of its own.
    """
    from fwav_companion.tracking.smoothed.smoothed_tracker import SmoothedTracker

    return SmoothedTracker(
        priors, source, lever_m=lever_m, kept=kept, consider=not options.self_calibration, smoother=smoother,
        landmarks=landmarks, ground=ground, motions=_motions(options, motion_of),
        own_poses=own_poses,
    )  # fmt: skip


def _motions(options: TrackingOptions, motion_of: Mapping[str, str] | None) -> Motions:
    by_label = {label: motion == "moving" for label, motion in (motion_of or {}).items()}
    return Motions(options.motion == "moving", by_label)
