"""The autopilot: is it there, does it send what is requested, how good is its clock, do its parameters fit."""

from __future__ import annotations

from collections.abc import Iterable, Iterator, Mapping
from typing import Final

from fwav_companion.links.url import SerialUrl
from fwav_companion.tools.doctor.evidence import Evidence
from fwav_companion.tools.doctor.finding import Finding, Level
from fwav_companion.tools.doctor.position_findings import position_findings
from fwav_companion.tools.doctor.rate_findings import (
    ATTITUDES_A_SWING,
    rate_setting,
    rates_not_taken,
    takes_no_requests,
)
from fwav_companion.tools.doctor.run_status import ADOPTION_S, MEASURED_S
from fwav_companion.types.flight_status import ClockReport
from fwav_companion.types.messages import ATTITUDE_MESSAGES
from fwav_companion.types.network_status import REQUESTS, PeerStatistics, StreamReport
from fwav_companion.types.status import RunStatus

REACHED: Final = 0.85
"""Least share of the wanted rate: an autopilot's scheduler rounds, and a second's count is off by one."""
LOOP_SHARE: Final = 0.8
"""Largest message rate as a share of SCHED_LOOP_RATE: ArduPilot refuses a shorter interval."""
SMALL_TRIM_DEG: Final = 0.1
"""Least pitch trim that is reported, degrees: the attitude noise that a configuration has by default."""
TRIM_STAYS_ON: Final = 1 << 8
"""FLIGHT_OPTIONS bit 8 (ArduPlane): the pitch in ATTITUDE keeps the trim, and is then the true pitch."""
SWING_MATTERS, SWING_UNKNOWN = 0.01, 0.5
"""Attitude swing, rad: below the first a vehicle needs no fast attitudes; at the second the stream does not show it."""
LONG_ROUND_TRIP_S: Final = 0.05
"""Round trip from which it is reported. It bounds the clock's error by its half: at 5 Hz and 5 deg of flapping, 25 ms
are 3 deg."""
POOR_SIGMA_S: Final = 0.005
ANSWERED: Final = 0.5
"""Least share of TIMESYNC requests with an answer: with fewer, TIMESYNC does not work both ways."""
LOOPBACK: Final = ("localhost", "::1")
REBOOTED: Final = "reboot"
"""Value in ``undone_by``: a restart lost the rate, and no other program took it."""


def autopilot_findings(evidence: Evidence, status: RunStatus) -> Iterator[Finding]:
    """Yield everything about the autopilot."""
    if status.autopilot is None:
        if status.up_s >= ADOPTION_S:
            yield from _not_adopted(evidence, status)
        return
    where = f"autopilot {status.autopilot.system}"
    if status.autopilot_lost:
        yield Finding(
            "autopilot_lost",
            Level.ERROR,
            where,
            problem="its heartbeats stopped",
            fix="check its power and the link to it",
        )
    yield from _neighbours(evidence, status, status.autopilot.system)
    yield from _attitude(evidence, status, where)
    yield from _parameters(evidence, status, where)
    yield from position_findings(evidence, status, where)
    yield from _clock(evidence, status)


def _systems(heard: Iterable[PeerStatistics]) -> list[int]:
    """The vehicles among these senders: an autopilot is component 1, and Betaflight's sends with system 0."""
    return sorted({peer.system for peer in heard if peer.component == 1 or peer.system == 0})


def _heard(evidence: Evidence, status: RunStatus) -> list[PeerStatistics]:
    """Every sender on the autopilot's links."""
    links = [link.name for link in evidence.config.link if link.role == "autopilot"]
    return [peer for name in links for peer in status.traffic_of(name).peers]


def _neighbours(evidence: Evidence, status: RunStatus, ours: int) -> Iterator[Finding]:
    others = [system for system in _systems(_heard(evidence, status)) if system != ours]
    if others and evidence.config.vehicle.system_id == 0:
        also = f"autopilot {others[0]} is" if len(others) == 1 else f"autopilots {', '.join(map(str, others))} are"
        yield Finding(
            "neighbour",
            Level.WARNING,
            "[vehicle] system_id",
            problem=f"{also} heard, too; {ours} was heard first and is used, which may differ at the next start",
            fix=f"set [vehicle] system_id = {ours} if that is yours",
        )


def _not_adopted(evidence: Evidence, status: RunStatus) -> Iterator[Finding]:
    heard = _heard(evidence, status)
    systems = _systems(heard)
    configured, numbers = evidence.config.vehicle.system_id, ", ".join(map(str, systems))
    if len(systems) > 1 and configured == 0:
        yield Finding(
            "several_autopilots",
            Level.ERROR,
            "[vehicle] system_id",
            problem=f"autopilots {numbers} are heard: none is adopted",
            fix=f"set [vehicle] system_id to yours: {' or '.join(map(str, systems))}",
        )
    elif configured and systems and configured not in systems:
        yield Finding(
            "other_autopilot",
            Level.ERROR,
            "[vehicle] system_id",
            problem=f"autopilot {numbers} is heard, and {configured} is configured",
            fix=f"set [vehicle] system_id = {systems[0]}, or 0 to adopt the one that is heard"
            if systems[0]
            else "set [vehicle] system_id = 0, which adopts the one that is heard",
        )
    elif heard:
        yield Finding(
            "no_autopilot",
            Level.ERROR,
            "autopilot",
            problem="MAVLink arrives without an autopilot's heartbeat, from "
            + ", ".join(f"{peer.system}/{peer.component}" for peer in heard[:5]),
            fix="check that this is the vehicle's own link and not a ground station's",
        )


def _attitude(evidence: Evidence, status: RunStatus, where: str) -> Iterator[Finding]:
    telemetry, source = status.telemetry, _attitude_source(status)
    if not any(telemetry.rates_hz.get(name) for name in ATTITUDE_MESSAGES):
        if status.adopted_s >= MEASURED_S:
            yield Finding(
                "no_attitude",
                Level.ERROR,
                where,
                problem="neither ATTITUDE nor ATTITUDE_QUATERNION arrives",
                fix="let the autopilot accept MAV_CMD_SET_MESSAGE_INTERVAL from this service, or set SRn_EXTRA1",
            )
        return
    wanted_hz, measured_hz = evidence.config.rates.attitude, measured_attitude_hz(status)
    taken = not takes_no_requests(status)
    undone_by = next((stream.undone_by for stream in status.rates.values() if _is_undone(stream)), "")
    if not taken:
        yield rates_not_taken(status, source, wanted_hz)
    elif undone_by and measured_hz is not None:
        level = Level.WARNING if measured_hz < REACHED * wanted_hz else Level.NOTE
        yield Finding(
            "rates_undone",
            level,
            "rates",
            problem=f"{undone_by} requests other rates: {source} at {measured_hz:.0f} of {wanted_hz:.0f} Hz",
            fix='forward_rate_requests = "merge" on its [[link]]; on a link of its own to the autopilot, MAVProxy: set '
            "streamrate -1; Mission Planner: rates -1",
        )
    elif measured_hz is not None and measured_hz < REACHED * wanted_hz:
        yield _slow(evidence, status, measured_hz)
    if telemetry.too_slow_for_motion and status.adopted_s >= MEASURED_S:
        rate_hz = max(wanted_hz, ATTITUDES_A_SWING * telemetry.motion_hz)
        source_hz = telemetry.rates_hz.get(source, 0.0)
        yield Finding(
            "too_slow_for_motion",
            Level.WARNING,
            where,
            problem=f"{source} at {source_hz:.0f} Hz does not show motion of {telemetry.motion_hz:.1f} Hz",
            fix=f"[rates] attitude = {rate_hz:.0f}, on a link that carries it"
            if taken
            else rate_setting(status, rate_hz),
        )


def measured_attitude_hz(status: RunStatus) -> float | None:
    """Return the rate of attitudes over a full window since it was granted; None while there was none.

    A station that takes the rate away each second restarts that window: then what arrives counts.
    """
    source = _attitude_source(status)
    stream = status.rates.get(source)
    if stream is not None and (stream.measured_hz is not None or status.adopted_s < MEASURED_S):
        return stream.measured_hz
    return status.telemetry.rates_hz.get(source, 0.0)


def _attitude_source(status: RunStatus) -> str:
    """Return the message that attitudes are taken from; ATTITUDE, which every autopilot sends, before the first."""
    return status.telemetry.attitude_source or "ATTITUDE"


def _is_undone(stream: StreamReport) -> bool:
    return bool(stream.undone_by) and REBOOTED not in (stream.undone_by or "")


def _slow(evidence: Evidence, status: RunStatus, measured_hz: float) -> Finding:
    source, wanted_hz = _attitude_source(status), evidence.config.rates.attitude
    swing = status.telemetry.motion_swing
    granted_hz = status.rates.get(source, StreamReport()).asked_hz
    refused = granted_hz is not None and granted_hz < REACHED * wanted_hz
    return Finding(
        "attitude_slow",
        Level.WARNING,
        "rates",
        problem=f"{source} arrives at {measured_hz:.0f} Hz, {wanted_hz:.0f} Hz were requested"
        + (f" and {granted_hz:.0f} Hz granted" if refused else "")
        + (f"; the vehicle swings by {57.3 * swing:.1f} deg" if SWING_MATTERS < swing < SWING_UNKNOWN else ""),
        fix="a faster link, fewer other streams on it, SCHED_LOOP_RATE on ArduPilot, the link's mode (Onboard) on PX4; "
        "INAV sends at most 50 Hz: lower [rates] attitude",
    )


def _parameters(evidence: Evidence, status: RunStatus, where: str) -> Iterator[Finding]:
    parameters, wanted_hz = status.parameters, evidence.config.rates.attitude
    loop_hz = parameters.get("SCHED_LOOP_RATE")
    if loop_hz is not None and LOOP_SHARE * loop_hz < wanted_hz:
        yield Finding(
            "loop_rate",
            Level.WARNING,
            where,
            problem=f"SCHED_LOOP_RATE {loop_hz:.0f} allows at most {LOOP_SHARE * loop_hz:.0f} of {wanted_hz:.0f} Hz",
            fix=f"set SCHED_LOOP_RATE to {50.0 * -(-wanted_hz / LOOP_SHARE // 50.0):.0f}, or [rates] attitude lower",
        )
    trim_deg, stays_on = _trim_deg(parameters), int(parameters.get("FLIGHT_OPTIONS", 0.0)) & TRIM_STAYS_ON
    if _attitude_source(status) == "ATTITUDE" and abs(trim_deg) > SMALL_TRIM_DEG and not stays_on:
        removed = bool(status.telemetry.pitch_trim_undone_deg)
        yield Finding(
            "pitch_trim",
            Level.NOTE if removed else Level.WARNING,
            where,
            problem=f"ATTITUDE lacks the pitch trim of {trim_deg:.1f} deg, and ATTITUDE_QUATERNION does not arrive"
            + (": this service adds the trim again" if removed else ""),
            fix='[vehicle] attitude_message = "ATTITUDE_QUATERNION"; or set FLIGHT_OPTIONS bit 8, or the trim to 0',
        )


def _trim_deg(parameters: Mapping[str, float]) -> float:
    return parameters.get("PTCH_TRIM_DEG", parameters.get("TRIM_PITCH_CD", 0.0) / 100.0)


def _clock(evidence: Evidence, status: RunStatus) -> Iterator[Finding]:
    clock, timesync = status.clock, status.timesync
    asked = timesync.requests >= REQUESTS
    if clock.status == "unknown" and asked:
        yield Finding(
            "no_clock",
            Level.ERROR,
            "clock",
            problem="nothing that the autopilot sends holds its time",
            fix="let it answer TIMESYNC (every ArduPilot and PX4 does), on a link that works both ways: check TX",
        )
    elif clock.status == "arrivals" and asked and timesync.exchanges < ANSWERED * timesync.requests:
        yield Finding(
            "timesync_unanswered",
            Level.WARNING,
            "clock",
            problem="the autopilot does not answer TIMESYNC: its clock is known by arrivals, late by the link's delay",
            fix="check that what this service sends reaches it (on a wire our TX on its RX)",
        )
    elif clock.status == "followed":
        yield _followed(clock)
    elif clock.sigma_s is not None and clock.sigma_s > POOR_SIGMA_S and timesync.exchanges >= REQUESTS:
        yield Finding(
            "clock_unsettled",
            Level.WARNING,
            "clock",
            problem=f"the autopilot's clock is known to {1e3 * clock.sigma_s:.1f} ms (one sigma)",
            fix=f"check again in ten seconds; if it stays so, the delay varies: {_varying_delay_fix(evidence, status)}",
        )
    if clock.round_trip_s is not None and clock.round_trip_s > LONG_ROUND_TRIP_S:
        yield Finding(
            "long_round_trip",
            Level.WARNING,
            "clock",
            problem=f"the best round trip to the autopilot takes {1e3 * clock.round_trip_s:.0f} ms",
            fix="a faster or emptier link: the clock can be wrong by half of it",
        )


def _followed(clock: ClockReport) -> Finding:
    runs = f"runs {abs(clock.skew) * 1e2:.2g} % {'slow' if clock.skew > 0.0 else 'fast'}"
    known = "" if clock.sigma_s is None else f"; it is followed, to {1e3 * clock.sigma_s:.1f} ms (one sigma)"
    return Finding(
        "clock_followed",
        Level.WARNING if clock.sigma_s is None or clock.sigma_s > POOR_SIGMA_S else Level.NOTE,
        "clock",
        problem=f"the autopilot's clock {runs if clock.rate_differs else 'slips'} against this board's" + known,
        fix="usual in a simulator under load: less load, or a lower simulation speed; on real hardware check the load "
        "of the autopilot and of this board",
    )


def _varying_delay_fix(evidence: Evidence, status: RunStatus) -> str:
    """Return what to change, by the link that the autopilot is heard on."""
    name = status.autopilot.link if status.autopilot is not None else ""
    url = next((link.parsed_url for link in evidence.config.link if link.name == name), None)
    if isinstance(url, SerialUrl):
        return "fewer streams on the link, or a higher baud rate"
    if url is not None and (url.host in LOOPBACK or url.host.startswith("127.")):
        return "check the load of this computer"
    return "a wire instead of a radio"
