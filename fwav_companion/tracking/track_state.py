"""One live track between frames: what is known of it, how a fix changes it, and how it is told."""

from __future__ import annotations

import msgspec

from fwav_companion.geometry.stamps import HostNs
from fwav_companion.geometry.vectors import Matrix3, norm, subtract
from fwav_companion.tracking.filters.base import TargetState
from fwav_companion.tracking.lifecycle import Life, born, ended, seen
from fwav_companion.types import FrameView, GroundFix, Innovation, Reason, Track

MOST_REPLACED = 16
"""Of the ended tracks that a live one turned out to be, the last are remembered."""


class LiveTrack(msgspec.Struct, frozen=True):
    """One live track. Immutable."""

    id: int
    label: str
    belief: TargetState
    life: Life
    detector_id: int | None = None
    last_pixel: tuple[float, float] | None = None
    fix: GroundFix | None = None
    """Of the newest frame."""
    slant_m: float = 0.0
    """From the camera to it when it was last seen."""
    level_sigma_m: float = 0.0
    """Of the ground's level by the newest fix: the same in every fix, so no number of them takes it away."""
    innovation: Innovation | None = None
    """Of the newest frame's fix, where it is asked for."""
    replaced_by: int | None = None
    """The senior track that is the same target."""
    replaces: tuple[int, ...] = ()
    """Ended tracks that turned out to be this one."""

    def seen_in(self, host_ns: HostNs, fix: GroundFix, likelier: float) -> LiveTrack:
        """After a frame that saw it, by a fix so much likelier its own than a false one (a logarithm)."""
        detection = fix.sighting.detection
        detector_id = detection.detector_id if detection.detector_id is not None else self.detector_id
        life = seen(self.life, host_ns, likelier)
        after = _by_fix(self.id, self.label, self.belief.update(fix), life, detector_id, fix)
        return msgspec.structs.replace(after, replaces=self.replaces) if self.replaces else after

    def ended(self, reason: Reason) -> LiveTrack:
        """Dropped for a reason from outside."""
        return msgspec.structs.replace(self, life=ended(self.life, reason))

    def replacing(self, junior: LiveTrack) -> tuple[LiveTrack, LiveTrack]:
        """With a junior that turned out to be the same target; and that one, ended."""
        replaces = (*self.replaces, *junior.replaces, junior.id)[-MOST_REPLACED:]
        ended = msgspec.structs.replace(junior.ended(Reason.REPLACED), replaced_by=self.id)
        return msgspec.structs.replace(self, replaces=replaces), ended

    def told(self, belief: TargetState, view: FrameView) -> Track:
        """After this frame, by a belief that may be another than its own filter's."""
        life = self.life
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
            position_ned=belief.position_ned,
            cov=_with_level(belief.cov, self.level_sigma_m),
            apparent_ned=belief.apparent_ned,
            vehicle_ned=view.vehicle_ned,
            relative_cov=_with_level(belief.relative_cov, self.level_sigma_m),
            velocity_ned=belief.velocity_ned,
            velocity_cov=belief.velocity_cov,
            fix=self.fix,
            innovation=self.innovation,
            first_host_ns=life.first_ns,
            confirmed_host_ns=life.confirmed_ns,
            last_seen_host_ns=life.last_seen_ns,
            last_pixel=self.last_pixel,
        )


def initiate(number: int, fix: GroundFix, belief: TargetState, host_ns: HostNs) -> LiveTrack:
    """A new track, by the fix that belongs to no other."""
    detection = fix.sighting.detection
    return _by_fix(number, detection.label, belief, born(host_ns), detection.detector_id, fix)


def innovation(before: TargetState, fix: GroundFix) -> Innovation:
    """How little a fix was expected of what was believed just before."""
    north_m, east_m, _ = subtract(fix.position_ned, before.position_ned)
    return Innovation(north_m, east_m, before.gate(fix).nis)


def _by_fix(
    number: int, label: str, belief: TargetState, life: Life, detector_id: int | None, fix: GroundFix
) -> LiveTrack:
    detection = fix.sighting.detection
    return LiveTrack(
        id=number,
        label=label,
        belief=belief,
        life=life,
        detector_id=detector_id,
        last_pixel=(detection.u, detection.v),
        fix=fix,
        slant_m=norm(subtract(fix.position_ned, fix.sighting.camera_ned)),
        level_sigma_m=fix.level_sigma_m,
    )


def _with_level(cov: Matrix3, level_sigma_m: float) -> Matrix3:
    """What is not known of the ground's own level stands in every fix, and so in the track."""
    north, east, (down_north, down_east, down_down) = cov
    return (north, east, (down_north, down_east, down_down + level_sigma_m * level_sigma_m))
