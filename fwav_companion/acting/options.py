"""The [act] table of the configuration, and the facts of this installation that acting needs."""

from __future__ import annotations

from typing import Annotated, Literal

import msgspec
from msgspec import Meta


class ActTable(msgspec.Struct, frozen=True, kw_only=True):
    """[act]: what is done about the target that an operator selected in this flight; absent: nothing."""

    point: Literal["none", "gimbal", "roi"] = "none"
    """Keeps the camera on the target: ``gimbal`` commands the gimbal of [camera.mount]; ``roi`` has the autopilot
    point, which turns the nose of a copter without a panning mount."""
    point_rate_deg_s: Annotated[float, Meta(gt=0, le=180)] = 30.0
    """Fastest turn of the gimbal that is commanded, degrees a second."""
    follow_target: bool = False
    """Whether FOLLOW_TARGET of the target is sent, for the pilot's follow mode."""
    follow_system_id: Annotated[int, Meta(ge=0, le=255)] = 0
    """System id that FOLLOW_TARGET is sent from: ArduPilot hears only another system than itself (FOLL_SYSID); 0: the
    vehicle's own, for PX4."""
    follow_max_sigma_m: Annotated[float, Meta(gt=0, le=1000)] = 3.0
    """Largest sigma of the target, larger semi-axis, metres, at which it is sent to be followed."""

    @property
    def acts(self) -> bool:
        """Whether anything is commanded or sent."""
        return self.point != "none" or self.follow_target


class ActOptions(ActTable, frozen=True, kw_only=True):
    """The [act] table, and the facts of this installation."""

    gimbal_device_id: int = 0
    """Gimbal that carries the camera, as [camera.mount] has it."""
    mount_pitch: float = 0.0
    """Pitch of the camera's axis against the gimbal's, radians."""
    mount_yaw: float = 0.0
    """Yaw of the camera's axis against the gimbal's, radians."""
    companion_component: int = 191
    gcs_links: frozenset[str] = frozenset()
    """Names of the links with role gcs: an unsigned selection counts there."""
    signed: bool = False
    """Whether a key is configured: then every command that was obeyed was signed, whatever its link."""
