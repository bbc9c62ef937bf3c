"""A vehicle, a target and the messages of both, by hand; and acting on it, with an autopilot that answers."""

from __future__ import annotations

from math import degrees, radians
from types import SimpleNamespace
from typing import Any

from handmade import KnownErrors, a_sighting
from scipy.spatial.transform import Rotation

from fwav_companion.acting.acting import Acting
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
    ErrorBudget,
    GimbalAt,
    GroundFix,
    Message,
    NoticeCode,
    Outgoing,
    Ray,
    Situation,
    Track,
    TrackState,
    VehicleState,
)

S = 10**9
T0 = 500 * S
ORIGIN = Geodetic.from_degrees(47.397742, 8.545594, 488.0)
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
        from_axis = Ray(ray, (1.5e-3, 0.0, 0.0), (0.0, 1.5e-3, 0.0))
        sighting = a_sighting(now, state(now), ray=from_axis, camera_ned=(0.0, 0.0, -20.0))
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


NOBODY, OURS = (0, 0), (1, 191)


class Acted:
    """Acting in a flight: the autopilot answers, its gimbal manager gives the control, its gimbal obeys at once."""

    def __init__(self, point: str, *, limits_deg: tuple[float, float] | None = None, **changes: Any) -> None:
        """``limits_deg``: of yaw to each side, by the manager's information; None: it has none."""
        self.acting = Acting(options(**{"point": point, "follow_max_sigma_m": 10.0, **changes}))
        self.sent: list[tuple[int, Outgoing]] = []
        self.look: tuple[float, float] | None = (-45.0, 0.0)
        """Pitch and yaw of the gimbal by its report, degrees."""
        self.obeys = True
        self._limits, self._primary = limits_deg, NOBODY
        self.texts: list[str] = []
        self.codes: list[NoticeCode] = []
        self.hear(heartbeat(), T0)

    def hear(self, each: Message, now: int, autopilot: Autopilot | None = AUTOPILOT) -> None:
        self.acting.on_message(each, autopilot, HostNs(now))

    def select(self, now: int = T0, place: tuple[float, float, float] = (20.0, 0.0, 0.0)) -> None:
        self.acting.on_selected(click(), a_track(now, place), AUTOPILOT, HostNs(now))

    def step(self, now: int, track: Track | None, *, station: bool = True, beat: Message | None = None) -> None:
        """The autopilot and the station are heard, a frame shows the target, and what is due is sent."""
        self.hear(beat or heartbeat(), now)
        if station:
            self.hear(heartbeat(STATION, link="ground"), now)
        self.acting.on_tracks(track, HostNs(now), awaited=False)
        due = self.acting.wake_at
        made = (
            self.acting.on_wake(HostNs(now), situation(now, state(now, look=self.look))) if due and due <= now else []
        )
        for each in made:
            self.sent.append((now, each))
            self._answer(each, now)
        for notice in self.acting.notices():
            self.texts.append(notice.text)
            self.codes.append(notice.code)

    def commands(self, *numbers: int, since: int = T0) -> list[Outgoing]:
        return [each for now, each in self.sent if now >= since and each.fields.get("command") in numbers]

    def looks_deg(self, since: int = T0) -> list[tuple[float, float]]:
        """Pitch and yaw of each command to the gimbal."""
        sent = [each.fields for now, each in self.sent if now >= since and each.name == "GIMBAL_MANAGER_SET_PITCHYAW"]
        return [(degrees(fields["pitch"]), degrees(fields["yaw"])) for fields in sent]

    def count(self, name: str, since: int = T0) -> int:
        return sum(now >= since and each.name == name for now, each in self.sent)

    def be_primary(self, primary: tuple[int, int], now: int, flags: int = 12) -> None:
        """The manager's status names this one."""
        self._primary = primary
        fields = {"primary_control_sysid": primary[0], "primary_control_compid": primary[1], "flags": flags}
        self.hear(message("GIMBAL_MANAGER_STATUS", gimbal_device_id=1, **fields), now)

    def _answer(self, each: Outgoing, now: int) -> None:
        fields = each.fields
        if each.name == "GIMBAL_MANAGER_SET_PITCHYAW" and self.obeys:
            self.look = (degrees(fields["pitch"]), degrees(fields["yaw"]))
        number = fields.get("command")
        if number == CONFIGURE:
            self._primary = (int(fields["param1"]), int(fields["param2"]))
        elif number == ROI:
            self.hear(message("COMMAND_ACK", command=ROI, result=0), now)
        elif number == REQUEST and fields["param1"] == 281.0:
            self.be_primary(self._primary, now)
        elif number == REQUEST and self._limits is not None:
            low, high = self._limits
            angles = {"pitch_min": radians(-90.0), "pitch_max": radians(30.0)}
            angles |= {"yaw_min": radians(low), "yaw_max": radians(high)}
            self.hear(message("GIMBAL_MANAGER_INFORMATION", gimbal_device_id=1, **angles), now)
