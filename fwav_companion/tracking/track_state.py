"""One live track between frames: its target, its life, and its report."""

from __future__ import annotations

from math import dist

import msgspec

from fwav_companion.geometry.stamps import HostNs
from fwav_companion.geometry.vectors import Matrix3, subtract
from fwav_companion.tracking.detector_ids import CERTAIN_TRUST
from fwav_companion.tracking.detector_model import DetectorModel
from fwav_companion.tracking.filters.base import TargetEstimate, TargetState
from fwav_companion.tracking.filters.standing import StandingTargetState
from fwav_companion.tracking.filters.wander_evidence import NO_EVIDENCE, WanderEvidence
from fwav_companion.tracking.lifecycle import Life, continued, deleted, detected, initiated
from fwav_companion.types import FrameView, GroundFix, Innovation, Reason, Track

MOST_REPLACED = 16
"""Maximum number of ids of merged tracks that a track keeps: the latest ones."""


class LiveTrack(msgspec.Struct, frozen=True, gc=False):
    """One live track. Immutable."""

    id: int
    """Track number, counted from 1; negative for a branch, which is not reported."""
    label: str
    target: TargetState
    """The filter's state, predicted to the newest frame."""
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

    @property
    def confirmed(self) -> bool:
        """Whether the track is confirmed; also true after its deletion."""
        return self.life.confirmed_ns is not None

    @property
    def slant_m(self) -> float:
        """Distance from the camera at the last fix, metres."""
        return dist(self.last_fix.position_ned, self.last_fix.sighting.camera_ned)

    def updated(
        self,
        host_ns: HostNs,
        fix: GroundFix,
        log_likelihood_ratio: float,
        detector: DetectorModel,
        *,
        id_trust: float = CERTAIN_TRUST,
    ) -> LiveTrack:
        """The track after an update with a fix. ``log_likelihood_ratio``: that of the fix, target against clutter.

        ``id_trust``: trust in the detector's id of the fix.
        """
        detector_id = fix.sighting.detection.detector_id
        return msgspec.structs.replace(
            self,
            target=self.target.update(fix),
            life=detected(self.life, host_ns, log_likelihood_ratio, detector, self.label),
            last_fix=fix,
            fix=fix,
            detector_id=self.detector_id if detector_id is None else detector_id,
            id_trust=self.id_trust if detector_id is None else id_trust,
        )

    def deleted(self, reason: Reason) -> LiveTrack:
        """The track, deleted for the given reason."""
        return msgspec.structs.replace(self, life=deleted(self.life, reason))

    def merged(self, junior: LiveTrack) -> tuple[LiveTrack, LiveTrack]:
        """The track after a junior track of the same target was merged into it, and the junior track, deleted."""
        replaces = (*self.replaces, *junior.replaces, junior.id)[-MOST_REPLACED:]
        ended = msgspec.structs.replace(junior.deleted(Reason.REPLACED), replaced_by=self.id)
        return msgspec.structs.replace(self, replaces=replaces), ended

    def reacquired(self, branch: LiveTrack) -> tuple[LiveTrack, LiveTrack]:
        """The track after its branch was confirmed, with the state of the branch; and the branch, deleted."""
        life = continued(self.life, branch.life)
        after = msgspec.structs.replace(branch, id=self.id, life=life, replaces=self.replaces, branch_of=None)
        ended = msgspec.structs.replace(
            branch, life=msgspec.structs.replace(branch.life, confirmed_ns=None), fix=None, replaced_by=self.id
        )
        return after, ended.deleted(Reason.REPLACED)

    def report(self, target: TargetEstimate, view: FrameView) -> Track:
        """The report of the track after this frame. ``target``: the reported estimate, not always by the own filter."""
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
            cov=_with_level(target.cov, last.level_sigma_m),
            apparent_ned=target.apparent_ned,
            vehicle_ned=view.vehicle_ned,
            relative_cov=_with_level(target.relative_cov, last.level_sigma_m),
            velocity_ned=target.velocity_ned,
            velocity_cov=target.velocity_cov,
            fix=self.fix,
            looked_for=self.looked_for,
            innovation=self.innovation,
            first_host_ns=life.first_ns,
            confirmed_host_ns=life.confirmed_ns,
            last_seen_host_ns=life.last_seen_ns,
            last_pixel=(last.sighting.detection.u, last.sighting.detection.v),
        )


def initiate(number: int, fix: GroundFix, target: TargetState, host_ns: HostNs) -> LiveTrack:
    """A new track from a fix that belongs to no other track."""
    detection = fix.sighting.detection
    return LiveTrack(
        id=number,
        label=detection.label,
        target=target,
        life=initiated(host_ns),
        last_fix=fix,
        fix=fix,
        detector_id=detection.detector_id,
    )


def innovation(before: TargetEstimate, fix: GroundFix) -> Innovation:
    """The innovation of a fix against the predicted target."""
    north_m, east_m, _ = subtract(fix.position_ned, before.apparent_ned)
    return Innovation(north_m, east_m, before.gate(fix).nis)


def _with_level(cov: Matrix3, level_sigma_m: float) -> Matrix3:
    """The covariance plus the variance of the ground's level: the same in every fix, so it does not average out."""
    north, east, (down_north, down_east, down_down) = cov
    return (north, east, (down_north, down_east, down_down + level_sigma_m * level_sigma_m))


def opened(target: TargetState, view: FrameView) -> TargetState:
    """The target after a jump of the vehicle's reported position, or a placing of the world on the earth; unchanged
    where its filter does not model the position's error.
    """
    if not isinstance(target, StandingTargetState):
        return target
    placed = target.placed_on_earth(view.placed_sigma_m) if view.placed_sigma_m else target
    return placed.jumped(view.jumped_m) if view.jumped_m else placed


def teaches(fix: GroundFix) -> bool:
    """Whether self-calibration may use a fix: the height of the detected point above the ground is exactly known, and
    so is the vehicle's motion. In a world without a position, targets move as the vehicle does.
    """
    return fix.sighting.anchor_sigma_m == 0.0 and not fix.sighting.relative


def with_shared_evidence(
    tracks: tuple[LiveTrack, ...], known: WanderEvidence | None
) -> tuple[tuple[LiveTrack, ...], WanderEvidence | None]:
    """The tracks with one common evidence of how the vehicle's position wanders, and that evidence.

    It is the newest evidence of a confirmed track, otherwise the ``known`` one, because clutter and moving targets must
    not contribute to it. A user's filter neither contributes evidence nor receives it.
    """
    newest = known
    for track in tracks:
        own = track.target.wander_evidence if isinstance(track.target, StandingTargetState) else None
        if own is not None and track.confirmed and own.until_ns > (newest or NO_EVIDENCE).until_ns:
            newest = own
    if newest is None:
        return tracks, None
    return tuple(
        [
            msgspec.structs.replace(track, target=msgspec.structs.replace(track.target, wander_evidence=newest))
            if isinstance(track.target, StandingTargetState) and track.target.wander_evidence is not newest
            else track
            for track in tracks
        ]
    ), newest
