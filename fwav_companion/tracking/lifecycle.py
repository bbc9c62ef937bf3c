"""The life of a track: tentative, confirmed, coasting, dropped, and why.

Only a frame that could have seen the target speaks against it. Time counts where frames are few, frames where they
are many: a target is not given up for one second of a slow camera, nor kept for ten seconds of a fast one.
"""

from __future__ import annotations

import msgspec

from fwav_companion.geometry.stamps import NS_PER_MS, NS_PER_S, HostNs
from fwav_companion.types import Reason, TrackState

CONFIRMING_SIGHTS = 5
"""Sights before a track is believed. With one false detection in ten frames, two of them within one gate of 1 m^2 on
a footprint of 50 m^2 meet once in 500 frames; five of them never."""
CONFIRMING_SCORE = 15.0
"""Log-likelihood ratio of those sights against false detections, summed. A sight where it was expected within noise
makes 8, one in a gate ten times as wide as the noise 4; chains of clutter in a wide gate make 1 each."""
TENTATIVE_LOOKS = 10
"""Frames within which those sights must have come."""
TENTATIVE_MISSES = 3
"""Frames in a row that saw nothing, which end a tentative track: a true one misses three of three once in 1000."""
TENTATIVE_NS = 2 * NS_PER_S
"""Unseen for so long, however few frames there were."""

COASTING_AFTER_NS = 250 * NS_PER_MS
"""Longer than a detector's usual gaps, shorter than a person takes to notice."""

GIVE_UP_NS = 3 * NS_PER_S
"""A believed target is given up after so much looking, with no sight between, that saw nothing."""
LOOK_NS = 200 * NS_PER_MS
"""What one look counts at most: between two frames a minute apart nobody looked for a minute. So it takes 15 looks."""


class Life(msgspec.Struct, frozen=True, gc=False):
    """One track's life so far. Immutable."""

    state: TrackState
    first_ns: HostNs
    last_seen_ns: HostNs
    last_frame_ns: HostNs
    sights: int = 1
    score: float = 0.0
    """How much likelier a target than clutter: a logarithm."""
    looks: int = 1
    """Frames that saw it, or could have."""
    misses: int = 0
    """Looks in a row that saw nothing."""
    missing_ns: int = 0
    """The looking time of those."""
    confirmed_ns: HostNs | None = None
    reason: Reason | None = None


def born(host_ns: HostNs) -> Life:
    """After the first sight."""
    return Life(TrackState.TENTATIVE, host_ns, host_ns, host_ns)


def seen(life: Life, host_ns: HostNs, likelier: float) -> Life:
    """After a frame that saw it, by a fix so much likelier its own than a false one (a logarithm)."""
    sights, score = life.sights + 1, life.score + likelier
    confirmed_ns = life.confirmed_ns
    if confirmed_ns is None and sights >= CONFIRMING_SIGHTS and score >= CONFIRMING_SCORE:
        confirmed_ns = host_ns
    return Life(
        TrackState.TENTATIVE if confirmed_ns is None else TrackState.CONFIRMED,
        life.first_ns,
        host_ns,
        host_ns,
        sights,
        score,
        life.looks + 1,
        confirmed_ns=confirmed_ns,
    )


def unseen(life: Life, host_ns: HostNs, *, looked: bool, keep_ns: int) -> Life:
    """After a frame that did not see it; ``looked``: it could have. ``keep_ns``: how long a believed target is kept.

    A tentative track is not given the benefit of the doubt: nobody knows yet where to look for it.
    """
    looked = looked or life.confirmed_ns is None
    life = msgspec.structs.replace(
        life,
        last_frame_ns=host_ns,
        looks=life.looks + looked,
        misses=life.misses + looked,
        missing_ns=life.missing_ns + (min(host_ns - life.last_frame_ns, LOOK_NS) if looked else 0),
    )
    reason = _end(life, host_ns - life.last_seen_ns, keep_ns)
    if reason is not None:
        return msgspec.structs.replace(life, state=TrackState.DROPPED, reason=reason)
    if life.confirmed_ns is not None and host_ns - life.last_seen_ns > COASTING_AFTER_NS:
        return msgspec.structs.replace(life, state=TrackState.COASTING)
    return life


def ended(life: Life, reason: Reason) -> Life:
    """Dropped for a reason from outside."""
    return msgspec.structs.replace(life, state=TrackState.DROPPED, reason=reason)


def _end(life: Life, unseen_ns: int, keep_ns: int) -> Reason | None:
    if life.confirmed_ns is None:
        hopeless = life.misses >= TENTATIVE_MISSES or life.looks >= TENTATIVE_LOOKS or unseen_ns > TENTATIVE_NS
        return Reason.NEVER_CONFIRMED if hopeless else None
    if life.missing_ns >= GIVE_UP_NS:
        return Reason.NOT_SEEN
    return Reason.NOT_SEEN_LONG if unseen_ns > keep_ns else None
