"""Options of publishing: [publish] of the configuration in SI units, the camera, and our ids."""

from __future__ import annotations

import msgspec

from fwav_companion.geometry.vectors import ZERO3, Vector3


class PublishOptions(msgspec.Struct, frozen=True, kw_only=True):
    """Options with the configuration's defaults."""

    select: str = "best"
    """``best``: the oldest confirmed track; ``operator``: only what was clicked."""
    label: str = ""
    """Only tracks of this label are selected; "": any."""
    rate_hz: float = 10.0
    camera_tracking: bool = True
    landing_target: bool = False
    landing_label: str = ""
    landing_max_sigma_m: float = 0.5
    statustext: bool = True
    named_values: bool = True
    adsb: bool = False
    cot: bool = False
    cot_type: str = "a-u-G"
    cot_callsign: str = ""
    cot_rate_hz: float = 1.0
    cot_stale_s: float = 10.0
    video_uri: str = ""
    video_delay_s: float = 0.3

    image_size: tuple[int, int] = (0, 0)
    """Width, height of the calibration, pixels; (0, 0) without a camera."""
    hfov_deg: float = 0.0
    """Horizontal field of view by the calibration, degrees; 0: unknown."""
    gimbal_device_id: int = 0
    """Of the gimbal that carries the camera, as [camera.mount] has it; 0: none."""
    camera_position_m: Vector3 = ZERO3
    """[camera.mount] position_m, body FRD: without a global position targets are relative to the camera."""
    companion_component: int = 191
    camera_component: int = 100
    version: tuple[int, int, int] = (0, 0, 0)
    """Version of this package, sent as the camera's firmware version."""
    unit: str = ""
    """Permanent name of this board: the uid of Cursor on Target is the same after a restart."""
