"""Detection probability and clutter density of the detector: priors that the flight updates.

Both are conjugate: the detection probability has a Beta prior, the number of false detections in a frame a Gamma prior.
The priors alone count until the flight has FIRST_LOOKS looks or frames. The threshold of confirmation follows from an
acceptable rate of false tracks (Blackman & Popoli 1999, ch. 6).
"""

from __future__ import annotations

from math import exp, inf, log

import msgspec

from fwav_companion.geometry.stamps import HostNs, s_from_ns
from fwav_companion.tracking.crowd import NO_CROWD, Crowd
from fwav_companion.tracking.detector_ids import IdEvidence

DETECTED_PRIOR, MISSED_PRIOR = 3.5, 1.5
"""Beta prior of the detection probability: 0.7 on average, worth five looks."""
FALSE_PRIOR, FRAMES_PRIOR = 0.5, 5.0
"""Gamma prior of the false detections in a frame: one in ten frames on average, worth five frames."""
FIRST_LOOKS = 20
"""Number of looks, and of frames, from which the flight updates the priors."""
MEMORY = 1000.0
"""Number of looks, and of frames, beyond which older ones count half: a detector changes with light and height."""

MOST_PROBABLE, LEAST_PROBABLE = 0.95, 0.05
"""Bounds of the detection probability: one miss in twenty has a cause that looks do not share, such as occlusion."""
LEAST_FALSE = 0.03
"""Lower bound of the false detections in a frame: a detector that was clean for a minute may still fail."""

FALSE_TRACKS_PER_HOUR = 0.1
"""Acceptable rate of confirmed tracks of clutter: one in ten hours."""
LEAST_CONFIRMING_LLR = 5.0
"""Lower bound of the threshold: odds of 150 to one, however rare false detections are."""
FIRST_INTERVAL_S = 1.0 / 30.0
"""Frame interval before the second frame, seconds."""


class DetectorModel(msgspec.Struct, frozen=True, gc=False):
    """Detection statistics of this flight so far. Immutable."""

    detected: float = 0.0
    """Number of looks at confirmed tracks with a detection."""
    looks: float = 0.0
    """Number of looks at confirmed tracks. Misses count once the track is detected again: targets that left do not."""
    false: float = 0.0
    """Expected number of false detections among the fixes of tracks that were deleted and never confirmed."""
    undecided: float = 0.0
    """Expected number of false detections among the fixes of the tracks that are tentative now."""
    frames: float = 0.0
    """Number of frames."""
    seconds: float = 0.0
    """Total time of those frames, seconds."""
    last_ns: HostNs | None = None
    """Capture of the newest frame, host clock."""
    detection_probability: float = DETECTED_PRIOR / (DETECTED_PRIOR + MISSED_PRIOR)
    """The probability that a look at a target detects it."""
    ids: IdEvidence = IdEvidence()
    """How far the detector's own track ids persist."""
    crowd: Crowd = NO_CROWD
    """The labels of which more detections fit no track than new targets explain."""

    def after_frame(
        self,
        host_ns: HostNs,
        *,
        detected: int,
        looks: int,
        false: float,
        undecided: float = 0.0,
        ids: IdEvidence | None = None,
        crowd: Crowd = NO_CROWD,
    ) -> DetectorModel:
        """The model after one more frame with its looks at confirmed tracks and its false detections."""
        looked, framed = self.looks + looks, self.frames + 1.0
        old, older = (0.5 if looked > MEMORY else 1.0), (0.5 if framed > MEMORY else 1.0)
        hits, looked = old * (self.detected + detected), old * looked
        return DetectorModel(
            hits,
            looked,
            older * (self.false + false),
            undecided,
            older * framed,
            older * (self.seconds + self.elapsed_s(host_ns)),
            host_ns,
            _detection_probability(hits, looked),
            self.ids if ids is None else ids,
            crowd,
        )

    def elapsed_s(self, host_ns: HostNs) -> float:
        """Time since the newest frame, seconds."""
        return FIRST_INTERVAL_S if self.last_ns is None else s_from_ns(host_ns - self.last_ns)

    def interval_s(self, host_ns: HostNs) -> float:
        """Mean interval of the frames, this one included, seconds."""
        return (self.seconds + self.elapsed_s(host_ns)) / (self.frames + 1.0)

    @property
    def false_per_frame(self) -> float:
        """Mean number of false detections in a frame; at least the prior's mean in the first frames."""
        least = LEAST_FALSE if self.frames >= FIRST_LOOKS else FALSE_PRIOR / FRAMES_PRIOR
        return max(least, (FALSE_PRIOR + self.false + self.undecided) / (FRAMES_PRIOR + self.frames))

    @property
    def frames_hz(self) -> float:
        """Mean rate of frames, Hz."""
        return self.frames / self.seconds if self.seconds > 0.0 else 1.0 / FIRST_INTERVAL_S

    def confirming_llr(self, label: str) -> float:
        """Threshold of the track score for confirmation; infinite while the label is crowded.

        The score of a chain of clutter ever exceeds ``t`` with a probability of at most exp(-t). So the rate of false
        tracks is at most the rate of false detections times exp(-t).
        """
        if self.crowd.is_crowded(label):
            return inf
        false_per_frame = max(self.false_per_frame, self.crowd.false_per_frame(label))
        false_per_hour = 3600.0 * self.frames_hz * false_per_frame
        return max(LEAST_CONFIRMING_LLR, log(false_per_hour / FALSE_TRACKS_PER_HOUR))


def false_share(log_likelihood_ratio: float) -> float:
    """Probability that a track with this score is clutter, if a new track is equally likely a target or clutter."""
    return 1.0 / (1.0 + exp(log_likelihood_ratio))


def _detection_probability(detected: float, looks: float) -> float:
    """Posterior mean of the detection probability, within its bounds; prior mean before FIRST_LOOKS looks."""
    if looks < FIRST_LOOKS:
        detected, looks = 0.0, 0.0
    mean = (DETECTED_PRIOR + detected) / (DETECTED_PRIOR + MISSED_PRIOR + looks)
    return min(MOST_PROBABLE, max(LEAST_PROBABLE, mean))
