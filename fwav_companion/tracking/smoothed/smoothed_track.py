"""One track of the smoother between frames: its life and its report. Its state is in the estimator, by its number."""

from __future__ import annotations

from math import dist
from typing import TYPE_CHECKING

import msgspec

from fwav_companion.geometry.small_matrices import add_diagonal
from fwav_companion.geometry.stamps import HostNs
from fwav_companion.geometry.vectors import Matrix3
from fwav_companion.tracking.detector_ids import CERTAIN_TRUST
from fwav_companion.tracking.lifecycle import Life, continued, deleted, initiated
from fwav_companion.types import FrameView, GroundFix, Innovation, Reason, Track

if TYPE_CHECKING:
    from fwav_companion.tracking.smoothed.smoothed_target import SmoothedTarget

MOST_REPLACED = 16
"""Maximum number of ids of merged tracks that a track keeps: the latest ones."""


class SmoothedTrack(msgspec.Struct, frozen=True, gc=False):
    """One live track. Immutable."""

    id: int
    """Track number, counted from 1; negative for a branch, which is not reported. Also its number in the estimator."""
    label: str
    moving: bool
    life: Life
    last_fix: GroundFix
    fix: GroundFix | None = None
    """Fix of the newest frame; None where the frame brought none."""
    detector_id: int | None = None
    """The detector's id of the last fix that had one."""
    id_trust: float = CERTAIN_TRUST
    """Trust in ``detector_id``: twice the log-odds that it is of this target."""
    looked_for: bool = False
    """Whether the newest frame covers the target, although it brought no fix of it."""
    innovation: Innovation | None = None
    """Innovation of the newest frame's fix, where requested."""
    replaced_by: int | None = None
    """Id of the senior track of the same target."""
    replaces: tuple[int, ...] = ()
    """Ids of tracks that were merged into this one."""
    branch_of: int | None = None
    """Id of the coasting track that this branch may continue; None unless the track is a branch."""
    together: frozenset[int] = frozenset()
    """Ids of tracks that a frame showed together with this one: two targets."""

    @property
    def confirmed(self) -> bool:
        """Whether the track is confirmed; also true after its deletion."""
        return self.life.confirmed_ns is not None

    @property
    def slant_m(self) -> float:
        """Distance from the camera at the last fix, metres."""
        return dist(self.last_fix.position_ned, self.last_fix.sighting.camera_ned)

    def deleted(self, reason: Reason) -> SmoothedTrack:
        """The track, deleted for the given reason."""
        return msgspec.structs.replace(self, life=deleted(self.life, reason))

    def merged(self, junior: SmoothedTrack) -> tuple[SmoothedTrack, SmoothedTrack]:
        """The track after a junior track of the same target was merged into it, and the junior track, deleted."""
        replaces = (*self.replaces, *junior.replaces, junior.id)[-MOST_REPLACED:]
        ended = msgspec.structs.replace(junior.deleted(Reason.REPLACED), replaced_by=self.id)
        return msgspec.structs.replace(self, replaces=replaces), ended

    def reacquired(self, branch: SmoothedTrack) -> tuple[SmoothedTrack, SmoothedTrack]:
        """The track after its branch was confirmed, which it continues with; and the branch, deleted."""
        life = continued(self.life, branch.life)
        after = msgspec.structs.replace(
            branch, id=self.id, life=life, replaces=self.replaces, branch_of=None, together=self.together
        )
        ended = msgspec.structs.replace(
            branch, life=msgspec.structs.replace(branch.life, confirmed_ns=None), fix=None, replaced_by=self.id
        )
        return after, ended.deleted(Reason.REPLACED)

    def report(self, target: SmoothedTarget, view: FrameView, misplaced_m: float = 0.0) -> Track:
        """The report of the track after this frame.

        ``misplaced_m``: while the mount is known to be wrong, one sigma of places by that, each axis. A wrong mount
        shifts the place in a direction that turns, so the target's own motion is not known then.
        """
        life, last = self.life, self.last_fix
        return Track(
            id=self.id,
            label=self.label,
            state=life.state,
            reason=life.reason,
            replaced_by=self.replaced_by,
            replaces=self.replaces,
            host_ns=view.host_ns,
            boot_ns=view.boot_ns,
            frame=view.frame,
            position_ned=target.position_ned,
            cov=_with_level(add_diagonal(target.cov, misplaced_m**2, 0.0), last.level_sigma_m),
            apparent_ned=target.apparent_ned,
            vehicle_ned=view.vehicle_ned,
            relative_cov=_with_level(add_diagonal(target.relative_cov, misplaced_m**2, 0.0), last.level_sigma_m),
            velocity_ned=None if misplaced_m else target.velocity_ned,
            velocity_cov=None if misplaced_m else target.velocity_cov,
            fix=None if misplaced_m else self.fix,
            looked_for=self.looked_for,
            innovation=None if misplaced_m else self.innovation,
            first_host_ns=life.first_ns,
            confirmed_host_ns=life.confirmed_ns,
            last_seen_host_ns=life.last_seen_ns,
            last_pixel=(last.sighting.detection.u, last.sighting.detection.v),
        )


def new_track(number: int, fix: GroundFix, host_ns: HostNs, *, moving: bool) -> SmoothedTrack:
    """A new track from a fix that belongs to no other track."""
    detection = fix.sighting.detection
    return SmoothedTrack(
        number, detection.label, moving, initiated(host_ns), fix, fix, detector_id=detection.detector_id
    )


def _with_level(cov: Matrix3, level_sigma_m: float) -> Matrix3:
    """The covariance plus the variance of the ground's level: the same in every fix, so it does not average out."""
    north, east, (down_north, down_east, down_down) = cov
    return (north, east, (down_north, down_east, down_down + level_sigma_m * level_sigma_m))
