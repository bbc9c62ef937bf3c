"""A vehicle, a target and the messages of both, by hand: what acting on a target is asked about."""

from __future__ import annotations

from types import SimpleNamespace
from typing import Any

from handmade import KnownErrors
from scipy.spatial.transform import Rotation

from fwav_companion.acting.options import ActOptions
from fwav_companion.geometry.earth import Geodetic, TangentPlane
from fwav_companion.geometry.stamps import HostNs
from fwav_companion.types import (
    BIAS_COUNT,
    Autopilot,
    AutopilotKind,
    ClockEstimate,
    ClockStatus,
    Command,
    Detection,
    ErrorBudget,
    GimbalAt,
    GroundFix,
    Message,
    Ray,
    Sighting,
    Situation,
    Track,
    TrackState,
    VehicleState,
)

S = 10**9
T0 = 500 * S
ORIGIN = Geodetic.from_degrees(47.397742, 8.545594, 488.0)
IDENTITY = ((1.0, 0.0, 0.0), (0.0, 1.0, 0.0), (0.0, 0.0, 1.0))
ARMED, ACTIVE, STANDBY, CRITICAL = 128, 4, 3, 5
TRACK_POINT, STOP, CONFIGURE, REQUEST, ROI, ROI_NONE = 2004, 2010, 1001, 512, 195, 197
AUTOPILOT = Autopilot(system=1, component=1, kind=AutopilotKind.ARDUPILOT, vehicle_type=2, armed=True, link="fc")
STATION = (255, 190)


def options(**changes: Any) -> ActOptions:
    return ActOptions(**{"gimbal_device_id": 1, "gcs_links": frozenset({"ground"}), **changes})


def quaternion(yaw: float, pitch: float = 0.0) -> tuple[float, float, float, float]:
    x, y, z, w = Rotation.from_euler("ZYX", [yaw, pitch, 0.0], degrees=True).as_quat().tolist()
    return (w, x, y, z)


def state(
    now: int = T0,
    place: tuple[float, float, float] | None = (0.0, 0.0, -20.0),
    velocity: tuple[float, float, float] = (0.0, 0.0, 0.0),
    *,
    heading: float = 0.0,
    look: tuple[float, float] | None = None,
) -> VehicleState:
    """``look``: pitch and yaw from the vehicle of the gimbal by its report, degrees."""
    gimbal = None if look is None else GimbalAt(quaternion(heading + look[1], look[0]), (0.0, 0.0, 0.0), 0.0, 0.0)
    return VehicleState(
        boot_ns=now,
        ned_from_body=quaternion(heading),
        rates=(0.0, 0.0, 0.0),
        attitude_sigma=0.0,
        gap_s=0.0,
        position_ned=place,
        velocity_ned=velocity,
        position_sigma_m=0.0,
        height_above_home_m=20.0,
        gimbal=gimbal,
    )


def situation(now: int = T0, vehicle: VehicleState | None = None, autopilot: Autopilot | None = AUTOPILOT) -> Situation:
    vehicle = vehicle or state(now)
    clock = ClockEstimate(HostNs(now), 0, 0.0, 1e-4, 1e-3, 0.0, ClockStatus.SETTLED)
    return Situation(
        now_ns=HostNs(now),
        autopilot=autopilot,
        plane=TangentPlane(ORIGIN),
        newest_state=lambda: vehicle,
        clock_estimate=lambda: clock,
    )


def diagonal(*sigmas: float) -> Any:
    return tuple(tuple(sigma**2 if i == j else 0.0 for j in range(3)) for i, sigma in enumerate(sigmas))


def a_track(
    now: int = T0,
    place: tuple[float, float, float] = (20.0, 0.0, 0.0),
    *,
    number: int = 1,
    ray: tuple[float, float, float] | None = None,
    sigma_m: float = 0.5,
    velocity: tuple[float, float, float] | None = None,
    last_seen: int | None = None,
) -> Track:
    """``ray``: direction of the target in the camera of this frame; None: the frame does not show it."""
    cov = diagonal(sigma_m, 0.8 * sigma_m, 0.1)
    fix = None
    if ray is not None:
        sighting = Sighting(
            frame=1,
            index=0,
            frame_host_ns=HostNs(now),
            host_ns=HostNs(now),
            detection=Detection(u=320.0, v=240.0),
            ray=Ray(ray, (1.5e-3, 0.0, 0.0), (0.0, 1.5e-3, 0.0)),
            pixel_sigma=(4.0, 4.0),
            row_fraction=0.0,
            time_noise_s=0.0,
            state=state(now),
            body_from_camera=IDENTITY,
            ned_from_camera=IDENTITY,
            camera_ned=(0.0, 0.0, -20.0),
            camera_height_above_home_m=20.0,
            relative=False,
        )
        budget = ErrorBudget(0.1, 0.1, 0.1, 0.1, 0.1, 0.1, 0.1, 0.1)
        fix = GroundFix(sighting, place, cov, ((0.0, 0.0, 0.0),) * BIAS_COUNT, KnownErrors(cov, cov, budget), "home")
    return Track(
        id=number,
        label="person",
        state=TrackState.CONFIRMED,
        host_ns=HostNs(now),
        boot_ns=now,
        frame=1,
        position_ned=place,
        cov=cov,
        apparent_ned=place,
        relative_cov=cov,
        vehicle_ned=(0.0, 0.0, -20.0),
        velocity_ned=velocity,
        fix=fix,
        first_host_ns=HostNs(now),
        confirmed_host_ns=HostNs(now),
        last_seen_host_ns=HostNs(now if last_seen is None else last_seen),
    )


def message(name: str, sender: tuple[int, int] = (1, 1), link: str = "fc", **fields: Any) -> Message:
    return Message(name, sender[0], sender[1], link, SimpleNamespace(**fields))


def heartbeat(
    sender: tuple[int, int] = (1, 1), *, armed: bool = True, status: int = ACTIVE, mode: int = 5, link: str = "fc"
) -> Message:
    base_mode = ARMED if armed else 0
    return message("HEARTBEAT", sender, link, base_mode=base_mode, system_status=status, custom_mode=mode, type=2)


def click(link: str = "ground", sender: tuple[int, int] = STATION, number: int = TRACK_POINT) -> Command:
    params = (0.5, 0.5, 0.0, 0.0, 0.0, 0.0, 0.0)
    return Command(number=number, params=params, system=sender[0], component=sender[1], link=link, to_component=100)
