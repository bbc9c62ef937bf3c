"""Update of the live tracks by one frame: each track is detected, missed, or out of view."""

from __future__ import annotations

from collections.abc import Sequence

import msgspec

from fwav_companion.tracking import reacquisition
from fwav_companion.tracking.detector_model import DetectorModel
from fwav_companion.tracking.displacement import NONE_ABSENT, Absent, absent
from fwav_companion.tracking.frame_association import Taken
from fwav_companion.tracking.lifecycle import LOOK_S, MOVING_LOOK_S, are_photographs, not_detected
from fwav_companion.tracking.self_calibrated import TargetChoice
from fwav_companion.tracking.track_state import LiveTrack, innovation
from fwav_companion.tracking.visibility import is_missed_detection
from fwav_companion.types import FrameView, GroundFix


class FrameUpdate(msgspec.Struct, frozen=True):
    """The update of all tracks by one frame."""

    view: FrameView
    choice: TargetChoice
    detector: DetectorModel
    keep_ns: int
    """Time without a detection after which a track ends, ns."""
    corrects: bool
    """Whether self-calibration moves the tracks."""
    reports_innovations: bool

    def after(self, predicted: Sequence[LiveTrack], taken: Taken) -> tuple[list[LiveTrack], list[LiveTrack]]:
        """The tracks after the frame, and the tracks of ``predicted`` that the frame missed."""
        unseen, missed, displaced = dict[int, LiveTrack](), list[LiveTrack](), NONE_ABSENT
        if len(taken) < len(predicted):
            unseen = {track.id: self._unseen(track) for track in predicted if track.id not in taken}
            missed = [t for t in predicted if t.id in unseen and unseen[t.id].life.misses > t.life.misses]
        if missed:
            displaced = absent(predicted, missed, taken, photographs=are_photographs(self.detector))
        after = [
            unseen[track.id] if track.id in unseen else self._seen(track, *taken[track.id], displaced)
            for track in predicted
        ]
        return reacquisition.reacquired(after, self.view.host_ns), missed

    def _unseen(self, track: LiveTrack) -> LiveTrack:
        """The track after a frame without a fix for it."""
        missed = is_missed_detection(self.view, track.label, self.choice.target(track), self._margin_m(track))
        look_s = LOOK_S if track.target.velocity_cov is None else MOVING_LOOK_S
        life = not_detected(
            track.life, self.view.host_ns, missed=missed, keep_ns=self.keep_ns, detector=self.detector, look_s=look_s
        )
        return track if life is track.life else msgspec.structs.replace(track, life=life, looked_for=missed)

    def _margin_m(self, track: LiveTrack) -> float | None:
        """Largest likely displacement of the target in the image by the mount error, known and unknown, metres.

        None for a tentative track, because the likelihood ratio of clutter is 1 on average only if every look counts.
        """
        if not track.confirmed:
            return None
        calibrator = self.choice.calibrator if self.corrects else None
        return 0.0 if calibrator is None else calibrator.mount_off * track.slant_m

    def _seen(self, track: LiveTrack, fix: GroundFix, llr: float, missed: Absent) -> LiveTrack:
        """The track after a frame with a fix for it. ``missed``: confirmed tracks whose displaced fix this may be."""
        if not (track.confirmed or track.branch_of) and missed.may_explain(fix):
            llr = min(llr, 0.0)
        rests = self.choice.rests(track, fix)
        after = track.updated(self.view.host_ns, fix, llr, self.detector, rests=rests)
        if not self.reports_innovations:
            return after
        apparent = msgspec.structs.replace(self.choice, vehicle=None)
        return msgspec.structs.replace(after, innovation=innovation(apparent.target(track), fix))
