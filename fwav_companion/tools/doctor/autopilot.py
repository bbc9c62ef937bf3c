"""The autopilot: is there one, does it send what is asked, and what in its parameters is against us."""

from __future__ import annotations

from collections.abc import Iterator, Mapping
from typing import Any, Final

from fwav_companion.tools.doctor.evidence import Evidence
from fwav_companion.tools.doctor.finding import Finding, Level

ATTITUDES: Final = ("ATTITUDE_QUATERNION", "ATTITUDE")
REACHED: Final = 0.85
"""Of the wanted rate: an autopilot's scheduler rounds, and a second's count is off by one."""
TOLERABLE_MOTION_HZ: Final = 10.0
"""Attitudes a stroke that the wanted rate is made of: "ten times the flapping, at least"."""
LOOP_SHARE: Final = 0.8
"""Of SCHED_LOOP_RATE: beyond, ArduPilot refuses an interval."""
SMALL_TRIM_DEG: Final = 0.1
"""The attitude noise that a configuration has by default."""
TRIM_STAYS_ON: Final = 1 << 8
"""FLIGHT_OPTIONS bit 8 (ArduPlane): what ground stations are told keeps the trim, and is then the true pitch."""
SWING_MATTERS: Final = 0.01
"""rad: a steadier vehicle needs no fast attitudes."""


def autopilot(evidence: Evidence) -> Iterator[Finding]:
    """All of it."""
    if not evidence.status:
        return
    if evidence.autopilot is None:
        yield from _none(evidence)
        return
    where = f"autopilot {evidence.autopilot.get('system')}"
    if evidence.ask("autopilot_lost"):
        yield Finding(
            "autopilot_lost", Level.STOPS, where, "its heartbeats stopped", "see to its power and the way to it"
        )
    yield from _attitude(evidence, where)
    yield from _parameters(evidence, where)
    yield from _world(evidence, where)


def _none(evidence: Evidence) -> Iterator[Finding]:
    heard = [
        peer
        for link in evidence.config.link
        for peer in evidence.traffic(link.name).get("peers") or ()
        if link.role == "autopilot"
    ]
    systems = sorted({int(peer["system"]) for peer in heard if peer.get("component") == 1})
    configured = evidence.config.vehicle.system_id
    if len(systems) > 1 and configured == 0:
        numbers = ", ".join(map(str, systems))
        yield Finding(
            "several_autopilots", Level.STOPS, "[vehicle] system_id", f"autopilots {numbers} are heard: none is taken",
            f"set [vehicle] system_id to yours: {' or '.join(map(str, systems))}",
        )  # fmt: skip
    elif configured and systems and configured not in systems:
        yield Finding(
            "other_autopilot", Level.STOPS, "[vehicle] system_id",
            f"autopilot {', '.join(map(str, systems))} is heard, and {configured} is configured",
            f"set [vehicle] system_id = {systems[0]}, or 0 to take the one that is there",
        )  # fmt: skip
    elif heard:
        yield Finding(
            "no_autopilot", Level.STOPS, "autopilot",
            "MAVLink comes, but no autopilot's heartbeat: "
            + ", ".join(f"{peer['system']}/{peer['component']}" for peer in heard[:5]),
            "see that this is the vehicle's own link and not a ground station's",
        )  # fmt: skip


def _attitude(evidence: Evidence, where: str) -> Iterator[Finding]:
    rates = evidence.ask("rates") or {}
    source = evidence.ask("telemetry", "attitude_source") or "ATTITUDE"
    heard_hz = max((evidence.number("telemetry", "rates_hz", name) for name in ATTITUDES), default=0.0)
    wanted_hz = evidence.config.rates.attitude
    if heard_hz == 0.0:
        yield Finding(
            "no_attitude", Level.STOPS, where, "neither ATTITUDE nor ATTITUDE_QUATERNION comes",
            "let the autopilot take MAV_CMD_SET_MESSAGE_INTERVAL from us, or set SRn_EXTRA1",
        )  # fmt: skip
        return
    undone_by = next((rate.get("undone_by") for rate in rates.values() if _is_undone(rate)), None)
    measured_hz = evidence.number("telemetry", "rates_hz", source)
    if measured_hz < REACHED * wanted_hz:
        if undone_by:
            yield _undone(source, measured_hz, wanted_hz, undone_by)
        else:
            yield _slow(evidence, source, measured_hz, wanted_hz)
    elif undone_by:
        yield _undone(source, measured_hz, wanted_hz, undone_by, Level.MINDS)
    if evidence.ask("telemetry", "too_slow_for_motion"):
        motion_hz = evidence.number("telemetry", "motion_hz")
        yield Finding(
            "too_slow_for_motion", Level.HARMS, where,
            f"{source} at {measured_hz:.0f} Hz does not show motion of {motion_hz:.1f} Hz",
            f"[rates] attitude = {max(wanted_hz, TOLERABLE_MOTION_HZ * motion_hz):.0f}, on a link that carries it",
        )  # fmt: skip


def _is_undone(rate: Any) -> bool:
    return isinstance(rate, Mapping) and bool(rate.get("undone_by")) and "reboot" not in str(rate.get("undone_by"))


def _undone(source: str, measured_hz: float, wanted_hz: float, by: str, level: Level = Level.HARMS) -> Finding:
    return Finding(
        "rates_undone", level, "rates",
        f"{by} asks the autopilot for other rates: {source} at {measured_hz:.0f} of {wanted_hz:.0f} Hz",
        "forward_rate_requests = false on its [[link]]; in MAVProxy set streamrate -1, in Mission Planner rates to -1",
    )  # fmt: skip


def _slow(evidence: Evidence, source: str, measured_hz: float, wanted_hz: float) -> Finding:
    swing = evidence.number("telemetry", "motion_swing")
    refused = evidence.ask("rates", source, "asked_hz")
    why = f"; it grants {refused:.0f}" if isinstance(refused, int | float) and refused < REACHED * wanted_hz else ""
    return Finding(
        "attitude_slow",
        Level.HARMS,
        "rates",
        f"{source} comes at {measured_hz:.0f} Hz, {wanted_hz:.0f} were asked for{why}"
        + (f"; the vehicle swings by {57.3 * swing:.1f} deg" if swing > SWING_MATTERS else ""),
        "a faster link, fewer other streams on it, SCHED_LOOP_RATE on ArduPilot, the link's mode (Onboard) on PX4",
    )


def _parameters(evidence: Evidence, where: str) -> Iterator[Finding]:
    parameters = evidence.ask("parameters") or {}
    loop_hz, wanted_hz = parameters.get("SCHED_LOOP_RATE"), evidence.config.rates.attitude
    if isinstance(loop_hz, int | float) and LOOP_SHARE * loop_hz < wanted_hz:
        yield Finding(
            "loop_rate", Level.HARMS, where,
            f"SCHED_LOOP_RATE {loop_hz:.0f} lets at most {LOOP_SHARE * loop_hz:.0f} of {wanted_hz:.0f} Hz through",
            f"set SCHED_LOOP_RATE to {_round_up(wanted_hz / LOOP_SHARE):.0f}, or [rates] attitude lower",
        )  # fmt: skip
    trim_deg = _trim_deg(parameters)
    by_euler = evidence.ask("telemetry", "attitude_source") == "ATTITUDE"
    if by_euler and abs(trim_deg) > SMALL_TRIM_DEG and not int(parameters.get("FLIGHT_OPTIONS") or 0) & TRIM_STAYS_ON:
        undone = bool(evidence.ask("telemetry", "pitch_trim_undone_deg"))
        yield Finding(
            "pitch_trim", Level.MINDS if undone else Level.HARMS, where,
            f"ATTITUDE is turned by the pitch trim of {trim_deg:.1f} deg, and ATTITUDE_QUATERNION does not come"
            + (": the trim is put back here" if undone else ""),
            '[vehicle] attitude_message = "ATTITUDE_QUATERNION"; or set FLIGHT_OPTIONS bit 8, or the trim to 0',
        )  # fmt: skip


def _trim_deg(parameters: Mapping[str, Any]) -> float:
    if isinstance(parameters.get("PTCH_TRIM_DEG"), int | float):
        return float(parameters["PTCH_TRIM_DEG"])
    return float(parameters.get("TRIM_PITCH_CD") or 0.0) / 100.0


def _round_up(rate_hz: float) -> float:
    return 50.0 * -(-rate_hz // 50.0)


def _world(evidence: Evidence, where: str) -> Iterator[Finding]:
    if evidence.config.vehicle.position == "auto" and evidence.ask("origin") is None:
        decided = evidence.ask("telemetry", "relative_world")
        yield Finding(
            "no_position", Level.HARMS, where,
            "no global position came: targets are relative to the vehicle" if decided else "no global position yet",
            'wait for GPS before take-off; [vehicle] position = "none" where there is none on purpose',
        )  # fmt: skip
