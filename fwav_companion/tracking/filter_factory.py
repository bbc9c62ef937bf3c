"""Construction of the tracker that a configuration selects."""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from typing import TYPE_CHECKING

from fwav_companion.geometry.stamps import NS_PER_S
from fwav_companion.geometry.vectors import Vector3
from fwav_companion.self_calibration import KeptCalibration
from fwav_companion.tracking.filters.base import Filter
from fwav_companion.tracking.filters.kalman import StaticKalman
from fwav_companion.tracking.filters.kalman_by_label import KalmanByLabel
from fwav_companion.tracking.filters.lowpass import LowPass
from fwav_companion.tracking.frame_tracker import FrameTracker
from fwav_companion.tracking.motions import Motions
from fwav_companion.tracking.options import TrackingOptions
from fwav_companion.tracking.tracker import Tracker
from fwav_companion.types import ErrorPriors, GroundReference, Landmark

if TYPE_CHECKING:
    from fwav_companion.self_calibration.calibrator import Calibrator
    from fwav_companion.self_calibration.delayed_poses import StateAt
    from fwav_companion.tracking.landmarks.landmark_target import LandmarkTracking
    from fwav_companion.tracking.smoothed.sample_source import SampleSource
    from fwav_companion.tracking.smoothed.solve_jobs import SmootherOptions

PATIENCE_NS = 10 * NS_PER_S
"""Where targets may move: least time within the gate of a static target before self-calibration uses a target, ns. The
gate is a metre or two wide, as delay and mount are not known yet: a walking person leaves it within seconds."""

PREDICTED_NS = 20 * NS_PER_S
"""Where targets may move: time over which a mount must predict sights, ns. A walking person is 30 m away by then."""


def make_tracker(
    options: TrackingOptions,
    priors: ErrorPriors,
    state_at: StateAt | None = None,
    kept: KeptCalibration | None = None,
    *,
    landmarks: Sequence[Landmark] = (),
    calibrating: FrameTracker | None = None,
    motion_of: Mapping[str, str] | None = None,
) -> Tracker:
    """The tracker that [tracking] selects.

    ``state_at`` returns the vehicle's state at an instant of the last second or so; self-calibration finds a large
    time offset only with it. ``kept``: a calibration of an earlier flight with this camera. ``calibrating``: of the
    low-pass, as of :func:`tracker_with`. ``motion_of``: motion of the targets of some labels, where it is not that of
    all targets.
    """
    if options.filter == "lowpass":
        paper, self_calibration = LowPass(options.alpha, options.alpha_rate_hz, priors), options.self_calibration
        return tracker_with(paper, priors, state_at, kept, self_calibration=self_calibration, calibrating=calibrating)
    motions, calibrator = _motions(options, motion_of), None
    if options.self_calibration:
        calibrator = _calibrator(priors, state_at, kept, PREDICTED_NS if motions.any_moves else None)
    if not motions.any_moves:
        corrected = _landmark_tracking(priors, landmarks, state_at) if landmarks else None
        return Tracker(StaticKalman(priors), calibrator, landmarks=corrected)
    kalman = KalmanByLabel(priors, motions)
    if calibrator is None:
        return Tracker(kalman)
    # A second tracker treats all targets as static: only a target known to be where it was can calibrate.
    calibrating = Tracker(StaticKalman(priors), calibrator, patience_ns=PATIENCE_NS)
    return Tracker(kalman, calibrating=calibrating)


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


def tracker_with(
    belief_filter: Filter,
    priors: ErrorPriors,
    state_at: StateAt | None = None,
    kept: KeptCalibration | None = None,
    *,
    self_calibration: bool = False,
    calibrating: FrameTracker | None = None,
) -> Tracker:
    """A tracker with a filter that self-calibration does not correct: the paper's or a user's own.

    Self-calibration then runs in parallel: its values are reported and not applied. ``calibrating``: the tracker that
    does; None: this one.
    """
    calibrator = _calibrator(priors, state_at, kept) if self_calibration and calibrating is None else None
    return Tracker(belief_filter, calibrator, corrects=False, calibrating=calibrating)


def _motions(options: TrackingOptions, motion_of: Mapping[str, str] | None) -> Motions:
    by_label = {label: motion == "moving" for label, motion in (motion_of or {}).items()}
    return Motions(options.motion == "moving", by_label)


def _landmark_tracking(
    priors: ErrorPriors, landmarks: Sequence[Landmark], state_at: StateAt | None
) -> LandmarkTracking:
    """Landmarks before the first frame. They need numpy, as self-calibration does."""
    from fwav_companion.tracking.landmarks.landmark_target import LandmarkTracking
    from fwav_companion.tracking.landmarks.state_vector import SharedErrors

    return LandmarkTracking.start(SharedErrors(priors, landmarks), state_at)


def _calibrator(
    priors: ErrorPriors, state_at: StateAt | None, kept: KeptCalibration | None, predicted_ns: int | None = None
) -> Calibrator:
    """Self-calibration before the first frame. It needs numpy, which is otherwise not loaded in flight."""
    from fwav_companion.self_calibration.calibration_context import CalibrationContext
    from fwav_companion.self_calibration.calibrator import Calibrator
    from fwav_companion.self_calibration.mount_check import MountCheck

    mount_check = MountCheck() if predicted_ns is None else MountCheck(predicted_ns)
    return Calibrator(CalibrationContext(priors, state_at, kept), mount_check=mount_check)
