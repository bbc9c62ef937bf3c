"""Notices of the autopilot's and telemetry's events, for the log and for ground stations. Pure."""

from __future__ import annotations

from math import hypot

from fwav_companion.mavlink.client.identity_events import (
    Adopted,
    AutopilotBack,
    AutopilotLost,
    IdentityEvent,
    NeighbourHeard,
    SeveralHeard,
)
from fwav_companion.telemetry import (
    AttitudeSource,
    ClockRate,
    ClockSlipped,
    GimbalHeadingDiffers,
    GimbalUnused,
    HomeMoved,
    LocalWorld,
    OriginSet,
    PitchTrimUndone,
    PositionJumped,
    PositionSource,
    Rebooted,
    RelativeWorld,
    StampDelay,
    TelemetryEvent,
)
from fwav_companion.types import Notice, NoticeCode, Severity


def notice_text(event: IdentityEvent | TelemetryEvent) -> tuple[Notice, ...]:
    """The notices of an event; empty for events that people need not know."""
    if isinstance(event, Adopted | SeveralHeard | NeighbourHeard | AutopilotLost | AutopilotBack | Rebooted):
        return (_of_the_autopilot(event),)
    return (_of_the_clock(event),) if isinstance(event, ClockSlipped | ClockRate) else _of_the_vehicle(event)


def _of_the_vehicle(event: IdentityEvent | TelemetryEvent) -> tuple[Notice, ...]:
    match event:
        case OriginSet() | RelativeWorld() | LocalWorld() | PositionSource() | HomeMoved() | PositionJumped():
            return (_of_the_world(event),)
        case AttitudeSource(message, before):
            return (Notice(NoticeCode.ATTITUDE_SOURCE, Severity.INFO, f"attitude from {message}, no longer {before}"),)
        case GimbalUnused() | GimbalHeadingDiffers():
            return (_of_the_gimbal(event),)
        case PitchTrimUndone(deg):
            text = f"ATTITUDE lacks the pitch trim: {deg:.1f} deg are added"
            return (Notice(NoticeCode.PITCH_TRIM_RESTORED, Severity.INFO, text),)
        case StampDelay(in_step=True):
            text = "attitude timestamps are synchronous with sampling: no stamp-delay correction applied"
            return (Notice(NoticeCode.ATTITUDE_STAMPS, Severity.INFO, text),)
        case StampDelay(delay_s):
            text = f"attitude timestamps are up to {delay_s * 1e3:.1f} ms late: the mean is corrected"
            return (Notice(NoticeCode.ATTITUDE_STAMPS, Severity.INFO, text),)
        case _:
            return ()


def _of_the_world(
    event: OriginSet | RelativeWorld | LocalWorld | PositionSource | HomeMoved | PositionJumped,
) -> Notice:
    match event:
        case OriginSet(origin, late):
            text = f"origin {origin.lat_deg:.7f}, {origin.lon_deg:.7f}, {origin.alt_amsl_m:.1f} m AMSL"
            text += ": a position came late, all tracks start again" if late else ""
            return Notice(NoticeCode.ORIGIN_SET, Severity.INFO, text, to_ground=late)
        case RelativeWorld():
            text = "no global position: targets are relative to the point below the camera"
            return Notice(NoticeCode.RELATIVE_WORLD, Severity.WARNING, text, to_ground=True)
        case LocalWorld(late):
            text = "no global position: targets are in the autopilot's local frame"
            text += ", all tracks start again" if late else ""
            return Notice(NoticeCode.LOCAL_WORLD, Severity.WARNING, text, to_ground=True)
        case PositionSource(local=local):
            text = "global position lost: the local one carries on" if local else "global position: tracks stay"
            severity = Severity.WARNING if local else Severity.NOTICE
            return Notice(NoticeCode.POSITION_SOURCE, severity, text, to_ground=True)
        case HomeMoved(down_m):
            text = f"home moved: its surface is now {-down_m:+.2f} m above the origin"
            return Notice(NoticeCode.HOME_MOVED, Severity.INFO, text, to_ground=True)
        case PositionJumped(_, north_m, east_m):
            text = f"the autopilot's position jumped by {hypot(north_m, east_m):.1f} m: its filter was reset"
            return Notice(NoticeCode.POSITION_JUMPED, Severity.WARNING, text, to_ground=True)


def _of_the_gimbal(event: GimbalUnused | GimbalHeadingDiffers) -> Notice:
    match event:
        case GimbalUnused(device_id):
            text = f"a gimbal is heard: if it carries the camera, set gimbal_device_id = {device_id}"
            return Notice(NoticeCode.GIMBAL_UNUSED, Severity.WARNING, text, to_ground=True)
        case GimbalHeadingDiffers(deg):
            text = f"the gimbal's heading of the vehicle is {deg:+.0f} deg off the autopilot's, which is used"
            return Notice(NoticeCode.GIMBAL_HEADING, Severity.NOTICE, text, to_ground=True)


def _of_the_clock(event: ClockSlipped | ClockRate) -> Notice:
    match event:
        case ClockSlipped(by_s):
            way = "" if by_s > 0.0 else " ahead"
            text = f"the autopilot's clock slipped{way} by {abs(by_s) * 1e3:.0f} ms: followed"
            return Notice(NoticeCode.CLOCK_SLIPPED, Severity.NOTICE, text)
        case ClockRate(1.0):
            return Notice(NoticeCode.CLOCK_RATE, Severity.NOTICE, "the autopilot's clock runs at its normal rate again")
        case ClockRate(rate):
            way = "slow" if rate < 1.0 else "fast"
            text = f"the autopilot's clock runs {abs(rate - 1.0) * 1e2:.2g} % {way}: followed"
            return Notice(NoticeCode.CLOCK_RATE, Severity.NOTICE, text)


def _of_the_autopilot(
    event: Adopted | SeveralHeard | NeighbourHeard | AutopilotLost | AutopilotBack | Rebooted,
) -> Notice:
    match event:
        case Adopted(autopilot, before) if before is not None:
            text = f"autopilot {autopilot.system} replaces {before.system}: all tracks are dropped, new origin"
            return Notice(NoticeCode.AUTOPILOT_REPLACED, Severity.WARNING, text, to_ground=True)
        case NeighbourHeard(system, ours):
            text = f"vehicle {system} is heard beside ours and never adopted: set [vehicle] system_id = {ours}"
            return Notice(NoticeCode.NEIGHBOUR_HEARD, Severity.INFO, text)
        case Adopted(autopilot):
            where = f"system {autopilot.system}" + (f", on link {autopilot.link!r}" if autopilot.link else "")
            text = f"autopilot found: {autopilot.kind.value}, {where}"
            if autopilot.system == 0:
                text += ": it can be sent no request, its rates stay as they are; we speak as system 1"
            return Notice(NoticeCode.AUTOPILOT_FOUND, Severity.INFO, text)
        case SeveralHeard(systems):
            numbers = ", ".join(map(str, systems))
            text = f"several autopilots heard ({numbers}), none adopted: set [vehicle] system_id"
            return Notice(NoticeCode.SEVERAL_AUTOPILOTS, Severity.ERROR, text, to_ground=True)
        case AutopilotLost():
            text = "autopilot lost: no heartbeat for 5 s, check its power and link"
            return Notice(NoticeCode.AUTOPILOT_LOST, Severity.WARNING, text, to_ground=True)
        case AutopilotBack():
            return Notice(NoticeCode.AUTOPILOT_BACK, Severity.INFO, "autopilot back", to_ground=True)
        case Rebooted():
            text = "autopilot rebooted: clock and message rates start again"
            return Notice(NoticeCode.AUTOPILOT_REBOOTED, Severity.WARNING, text, to_ground=True)
