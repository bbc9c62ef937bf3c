"""What an event means to a person: one line each, for the log and for ground stations. Pure."""

from __future__ import annotations

from fwav_companion.mavlink.client.identity import (
    Adopted,
    AutopilotBack,
    AutopilotLost,
    IdentityEvent,
    SeveralHeard,
)
from fwav_companion.telemetry import (
    AttitudeSource,
    HomeMoved,
    OriginSet,
    PitchTrimUndone,
    Rebooted,
    RelativeWorld,
    StampDelay,
    TelemetryEvent,
)
from fwav_companion.types import Notice, Severity


def notice_text(event: IdentityEvent | TelemetryEvent) -> tuple[Notice, ...]:
    """Nothing for what people need not know."""
    if isinstance(event, Adopted | SeveralHeard | AutopilotLost | AutopilotBack | Rebooted):
        return (_of_the_autopilot(event),)
    match event:
        case OriginSet(origin, late):
            text = f"origin {origin.lat_deg:.7f}, {origin.lon_deg:.7f}, {origin.alt_amsl_m:.1f} m AMSL"
            return (Notice(Severity.INFO, text + (": tracks until now are dropped" if late else "")),)
        case RelativeWorld():
            text = "no global position: targets are relative to the point below the camera"
            return (Notice(Severity.WARNING, text, to_ground=True),)
        case HomeMoved(down_m):
            return (Notice(Severity.INFO, f"home surface moved to {-down_m:+.2f} m above the origin", to_ground=True),)
        case AttitudeSource(message, before):
            return (Notice(Severity.INFO, f"attitude from {message} instead of {before}"),)
        case PitchTrimUndone(deg):
            return (Notice(Severity.INFO, f"ATTITUDE lacks the pitch trim: {deg:.1f} deg are put back"),)
        case StampDelay(in_step=True):
            return (Notice(Severity.INFO, "attitudes keep step with their stamps: these are taken at their word"),)
        case StampDelay(delay_s):
            return (Notice(Severity.INFO, f"attitudes are stamped up to {delay_s * 1e3:.1f} ms late"),)
        case _:
            return ()


def _of_the_autopilot(event: Adopted | SeveralHeard | AutopilotLost | AutopilotBack | Rebooted) -> Notice:
    match event:
        case Adopted(autopilot):
            where = f"system {autopilot.system}" + (f", on link {autopilot.link!r}" if autopilot.link else "")
            return Notice(Severity.INFO, f"autopilot found: {autopilot.kind.value}, {where}")
        case SeveralHeard(systems):
            numbers = ", ".join(map(str, systems))
            text = f"several autopilots heard ({numbers}), none adopted: set [vehicle] system_id"
            return Notice(Severity.ERROR, text, to_ground=True)
        case AutopilotLost():
            return Notice(Severity.WARNING, "autopilot lost: five heartbeats missed", to_ground=True)
        case AutopilotBack():
            return Notice(Severity.INFO, "autopilot back", to_ground=True)
        case Rebooted():
            return Notice(Severity.WARNING, "autopilot rebooted: clock and rates anew", to_ground=True)
