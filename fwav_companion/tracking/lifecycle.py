"""Life cycle of a track: tentative, confirmed, coasting, dropped, and the reason of its deletion.

The track score is a log-likelihood ratio, target against clutter, in a sequential test (Blackman & Popoli 1999, ch. 6).
A detection adds the likelihood ratio of its fix, a missed detection log(1 - detection probability). Only frames that
could have seen the target are looks; time without a look changes nothing. Missed looks at a confirmed track within
LOOK_S count as one, and 15 of them delete any track.
"""

from __future__ import annotations

from math import log

import msgspec

from fwav_companion.geometry.stamps import NS_PER_MS, NS_PER_S, HostNs, ns_from_s, s_from_ns
from fwav_companion.tracking.detector_model import MOST_PROBABLE, DetectorModel
from fwav_companion.types import Reason, TrackState

LEAST_DETECTIONS = 3
"""Minimum number of detections of a confirmed track: two false detections may have one cause."""
DELETED_LLR = -4.6
"""Score at which a track is deleted: log(0.01). At a detection probability of 0.7, four missed detections delete a
track with a single detection."""
KEPT_LOOKS = 14.5
"""Missed looks in a row after which one more deletes a track that was detected often; at fast frame rates, 3 s."""
LOOK_S = 0.2
"""Duration of one independent look at a confirmed track, seconds: a wing beat of 5 Hz. A cause that hides a target in
one frame, such as motion blur, also hides it in the next."""
MOVING_LOOK_S = 0.4
"""The same for a moving target: a house or a tree hides it for seconds, not for a moment."""
KEEP_STATIC_NS = 300 * NS_PER_S
"""Time without a detection after which a static target is deleted, ns: five minutes, several rounds of any survey."""
KEEP_MOVING_NS = 10 * NS_PER_S
"""The same for a moving target, ns: it can be anywhere within 15 m after that."""
PRIOR_LOOKS = 10.0
"""Weight of the flight's detection probability for a single track, looks: a far target is detected less often."""

TENTATIVE_FRAMES = 30
TENTATIVE_S = 2.0
"""Longest time without a detection of a tentative track out of view: 30 frames, or 2 s where that is longer."""

COASTING_AFTER_NS = 250 * NS_PER_MS
"""Time without a detection after which a confirmed track coasts, ns: longer than a detector's usual gaps, shorter than
a person takes to notice."""


class Life(msgspec.Struct, frozen=True, gc=False):
    """Life-cycle state of one track. Immutable."""

    state: TrackState
    first_ns: HostNs
    """Capture of the first frame that detected it, host clock."""
    last_seen_ns: HostNs
    """Capture of the last frame that detected it, host clock."""
    log_likelihood_ratio: float = 0.0
    """Track score: target against clutter."""
    detections: int = 1
    """Number of frames that detected the track."""
    looks: int = 1
    """Number of frames that detected the track, or could have."""
    misses: int = 0
    """Number of missed detections in a row."""
    confirmed_ns: HostNs | None = None
    """Capture of the frame that confirmed it, host clock; None while tentative."""
    reason: Reason | None = None
    """Reason of the deletion; None while alive."""


def are_photographs(detector: DetectorModel) -> bool:
    """Whether frames come so slowly that one missed detection makes a track coast."""
    return s_from_ns(COASTING_AFTER_NS) * detector.frames_hz < 1.0


def is_steady(life: Life, host_ns: HostNs) -> bool:
    """Whether a track is confirmed and was detected within COASTING_AFTER_NS."""
    return life.confirmed_ns is not None and host_ns - life.last_seen_ns <= COASTING_AFTER_NS


def initiated(host_ns: HostNs) -> Life:
    """The life of a track after its first detection."""
    return Life(TrackState.TENTATIVE, host_ns, host_ns)


def detected(
    life: Life, host_ns: HostNs, log_likelihood_ratio: float, detector: DetectorModel, label: str = ""
) -> Life:
    """The life of a track after a detection. ``log_likelihood_ratio``: that of its fix, target against clutter."""
    probability = _detection_probability(life, detector)
    detections, llr = life.detections + 1, life.log_likelihood_ratio + log_likelihood_ratio + log(probability)
    confirmed_ns = life.confirmed_ns
    if confirmed_ns is None and detections >= LEAST_DETECTIONS and llr >= detector.confirming_llr(label):
        confirmed_ns = host_ns
    if confirmed_ns is not None:  # a bound on tentative tracks could lie below the threshold of confirmation
        llr = min(llr, DELETED_LLR - KEPT_LOOKS * log(1.0 - probability))
    return Life(
        TrackState.TENTATIVE if confirmed_ns is None else TrackState.CONFIRMED,
        life.first_ns,
        host_ns,
        llr,
        detections,
        life.looks + 1,
        confirmed_ns=confirmed_ns,
    )


def not_detected(life: Life, host_ns: HostNs, *, missed: bool, moving: bool, detector: DetectorModel) -> Life:
    """The life of a track after a frame without a fix for it. ``missed``: whether the frame could have seen the target.

    ``moving``: whether the target may move. It is deleted after KEEP_MOVING_NS or KEEP_STATIC_NS, regardless of the
    number of looks.
    """
    keep_ns, look_s = (KEEP_MOVING_NS, MOVING_LOOK_S) if moving else (KEEP_STATIC_NS, LOOK_S)
    llr, misses = life.log_likelihood_ratio, life.misses
    if missed:
        share = 1.0 if life.confirmed_ns is None else min(1.0, detector.elapsed_s(host_ns) / look_s)
        llr, misses = llr + share * log(1.0 - _detection_probability(life, detector)), misses + 1
    unseen_ns = host_ns - life.last_seen_ns
    if life.confirmed_ns is None:
        keep_ns = min(keep_ns, ns_from_s(max(TENTATIVE_S, TENTATIVE_FRAMES * detector.interval_s(host_ns))))
    state, reason = life.state, None
    if llr <= DELETED_LLR or unseen_ns > keep_ns:
        state, reason = TrackState.DROPPED, _deletion(life, llr)
    elif life.confirmed_ns is not None and unseen_ns > COASTING_AFTER_NS:
        state = TrackState.COASTING
    elif not missed:
        return life
    return msgspec.structs.replace(
        life, state=state, log_likelihood_ratio=llr, looks=life.looks + missed, misses=misses, reason=reason
    )


def continued(life: Life, branch: Life) -> Life:
    """The life of a coasting track after its branch was confirmed (``reacquisition``): the evidence of both.

    The track has already counted the looks of the branch, as missed ones.
    """
    return msgspec.structs.replace(
        branch,
        first_ns=life.first_ns,
        confirmed_ns=life.confirmed_ns,
        log_likelihood_ratio=max(life.log_likelihood_ratio, branch.log_likelihood_ratio),
        detections=life.detections + branch.detections,
        looks=life.looks,
    )


def deleted(life: Life, reason: Reason) -> Life:
    """The life of a track that is deleted for the given reason."""
    return msgspec.structs.replace(life, state=TrackState.DROPPED, reason=reason)


def _deletion(life: Life, llr: float) -> Reason:
    if life.confirmed_ns is None:
        return Reason.NEVER_CONFIRMED
    return Reason.NOT_SEEN if llr <= DELETED_LLR else Reason.NOT_SEEN_LONG


def _detection_probability(life: Life, detector: DetectorModel) -> float:
    """The flight's detection probability, updated by this track's looks until its last detection."""
    detections, looks = life.detections, life.looks - life.misses
    mean = (PRIOR_LOOKS * detector.detection_probability + detections) / (PRIOR_LOOKS + looks)
    return min(MOST_PROBABLE, mean)
