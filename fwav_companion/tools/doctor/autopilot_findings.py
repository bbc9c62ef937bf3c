"""The autopilot: is it there, does it send what is requested, how good is its clock, do its parameters fit."""

from __future__ import annotations

from collections.abc import Iterable, Iterator, Mapping
from typing import Final

from fwav_companion.links.url import SerialUrl
from fwav_companion.tools.doctor.evidence import Evidence
from fwav_companion.tools.doctor.finding import Finding
from fwav_companion.tools.doctor.finding_table import make_finding
from fwav_companion.tools.doctor.position_findings import position_findings
from fwav_companion.tools.doctor.run_status import ADOPTION_S, MEASURED_S
from fwav_companion.types.flight_status import ClockReport
from fwav_companion.types.messages import ATTITUDE_MESSAGES
from fwav_companion.types.network_status import REQUESTS, PeerStatistics, StreamReport
from fwav_companion.types.situation import AutopilotKind
from fwav_companion.types.status import RunStatus

ATTITUDES_A_SWING: Final = 10.0
"""Attitudes needed a wing beat or swing: the wanted rate is at least ten times its frequency."""
SMALL_FIRMWARES_HZ: Final = 50.0
"""Highest telemetry rate of INAV and Betaflight (TELEMETRY_MAVLINK_MAXRATE in src/main/telemetry/mavlink.c)."""
NOT_TAKEN: Final = frozenset({"unanswered", "unsupported", "denied"})
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
    system = status.autopilot.system
    if status.autopilot_lost:
        yield make_finding("autopilot_lost", system=system)
    yield from _neighbours(evidence, status, system)
    yield from _attitude(evidence, status, system)
    yield from _parameters(evidence, status, system)
    yield from position_findings(evidence, status, system)
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
        case = "one" if len(others) == 1 else "several"
        yield make_finding("neighbour", case, system=ours, others=", ".join(map(str, others)))


def _not_adopted(evidence: Evidence, status: RunStatus) -> Iterator[Finding]:
    heard = _heard(evidence, status)
    systems = _systems(heard)
    configured, numbers = evidence.config.vehicle.system_id, ", ".join(map(str, systems))
    if len(systems) > 1 and configured == 0:
        yield make_finding("several_autopilots", systems=numbers, choices=" or ".join(map(str, systems)))
    elif configured and systems and configured not in systems:
        yield make_finding(
            "other_autopilot",
            "numbered" if systems[0] else "zero",
            systems=numbers,
            configured=configured,
            first=systems[0],
        )
    elif heard:
        yield make_finding("no_autopilot", senders=", ".join(f"{peer.system}/{peer.component}" for peer in heard[:5]))


def _attitude(evidence: Evidence, status: RunStatus, system: int) -> Iterator[Finding]:
    telemetry, source = status.telemetry, _attitude_source(status)
    if not any(telemetry.rates_hz.get(name) for name in ATTITUDE_MESSAGES):
        if status.adopted_s >= MEASURED_S:
            yield make_finding("no_attitude", system=system)
        return
    wanted_hz, measured_hz = evidence.config.rates.attitude, measured_attitude_hz(status)
    taken = not _takes_no_requests(status)
    undone_by = next((stream.undone_by for stream in status.rates.values() if _is_undone(stream)), "")
    if not taken:
        yield _rates_not_taken(status, source, wanted_hz)
    elif undone_by and measured_hz is not None:
        yield make_finding(
            "rates_undone",
            "slow" if measured_hz < REACHED * wanted_hz else "enough",
            undone_by=undone_by,
            source=source,
            hz=measured_hz,
            wanted_hz=wanted_hz,
        )
    elif measured_hz is not None and measured_hz < REACHED * wanted_hz:
        yield _slow(evidence, status, measured_hz)
    if telemetry.too_slow_for_motion and status.adopted_s >= MEASURED_S:
        rate_hz = max(wanted_hz, ATTITUDES_A_SWING * telemetry.motion_hz)
        yield make_finding(
            "too_slow_for_motion",
            "requests" if taken else "no_requests",
            _kind(status),
            system=system,
            source=source,
            hz=telemetry.rates_hz.get(source, 0.0),
            motion_hz=telemetry.motion_hz,
            rate_hz=rate_hz,
            small_firmware_hz=min(rate_hz, SMALL_FIRMWARES_HZ),
        )


def _takes_no_requests(status: RunStatus) -> bool:
    """Return whether some request for a rate failed, and none was granted.

    A firmware of another kind may still take the group request that follows (INAV), while attitude is asked for.
    """
    rows = status.rates.values()
    granted = any(row.state == "granted" and row.asked_hz is not None for row in rows)
    other = status.autopilot is not None and status.autopilot.kind == AutopilotKind.OTHER.value
    asking = other and any(status.rates[name].state == "asking" for name in ATTITUDE_MESSAGES if name in status.rates)
    return not granted and not asking and any(row.state in NOT_TAKEN for row in rows)


def _rates_not_taken(status: RunStatus, source: str, wanted_hz: float) -> Finding:
    """Return the finding. ``source``: the message that attitudes are taken from."""
    hz = status.telemetry.rates_hz.get(source, 0.0)
    return make_finding(
        "rates_not_taken",
        "enough" if hz >= wanted_hz else "slow",
        _kind(status),
        source=source,
        hz=hz,
        swing_hz=hz / ATTITUDES_A_SWING,
        rate_hz=wanted_hz,
        small_firmware_hz=min(wanted_hz, SMALL_FIRMWARES_HZ),
    )


def _kind(status: RunStatus) -> str:
    """Return the case of ``rate_setting`` in the table of findings: where the vehicle's attitude rate is set."""
    return "" if status.autopilot is None else status.autopilot.kind


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
    return make_finding(
        "attitude_slow",
        source=source,
        hz=measured_hz,
        wanted_hz=wanted_hz,
        granted_hz=granted_hz if refused else None,
        swing_deg=57.3 * swing if SWING_MATTERS < swing < SWING_UNKNOWN else None,
    )


def _parameters(evidence: Evidence, status: RunStatus, system: int) -> Iterator[Finding]:
    parameters, wanted_hz = status.parameters, evidence.config.rates.attitude
    loop_hz = parameters.get("SCHED_LOOP_RATE")
    if loop_hz is not None and LOOP_SHARE * loop_hz < wanted_hz:
        yield make_finding(
            "loop_rate",
            system=system,
            loop_hz=loop_hz,
            most_hz=LOOP_SHARE * loop_hz,
            wanted_hz=wanted_hz,
            needed_hz=50.0 * -(-wanted_hz / LOOP_SHARE // 50.0),
        )
    trim_deg, stays_on = _trim_deg(parameters), int(parameters.get("FLIGHT_OPTIONS", 0.0)) & TRIM_STAYS_ON
    if _attitude_source(status) == "ATTITUDE" and abs(trim_deg) > SMALL_TRIM_DEG and not stays_on:
        yield make_finding(
            "pitch_trim",
            "added" if status.telemetry.pitch_trim_undone_deg else "missing",
            system=system,
            trim_deg=trim_deg,
        )


def _trim_deg(parameters: Mapping[str, float]) -> float:
    return parameters.get("PTCH_TRIM_DEG", parameters.get("TRIM_PITCH_CD", 0.0) / 100.0)


def _clock(evidence: Evidence, status: RunStatus) -> Iterator[Finding]:
    clock, timesync = status.clock, status.timesync
    asked = timesync.requests >= REQUESTS
    if clock.status == "unknown" and asked:
        yield make_finding("no_clock")
    elif clock.status == "arrivals" and asked and timesync.exchanges < ANSWERED * timesync.requests:
        yield make_finding("timesync_unanswered")
    elif clock.status == "followed":
        yield _followed(clock)
    elif clock.sigma_s is not None and clock.sigma_s > POOR_SIGMA_S and timesync.exchanges >= REQUESTS:
        yield make_finding("clock_unsettled", _way(evidence, status), sigma_ms=1e3 * clock.sigma_s)
    if clock.round_trip_s is not None and clock.round_trip_s > LONG_ROUND_TRIP_S:
        yield make_finding("long_round_trip", round_trip_ms=1e3 * clock.round_trip_s)


def _followed(clock: ClockReport) -> Finding:
    sigma_s = clock.sigma_s
    return make_finding(
        "clock_followed",
        "rate" if clock.rate_differs else "slips",
        "poor" if sigma_s is None or sigma_s > POOR_SIGMA_S else "precise",
        percent=abs(clock.skew) * 1e2,
        tempo="slow" if clock.skew > 0.0 else "fast",
        sigma_ms=None if sigma_s is None else 1e3 * sigma_s,
    )


def _way(evidence: Evidence, status: RunStatus) -> str:
    """Return the kind of link that the autopilot is heard on, which says what varies the delay."""
    name = status.autopilot.link if status.autopilot is not None else ""
    url = next((link.parsed_url for link in evidence.config.link if link.name == name), None)
    if isinstance(url, SerialUrl):
        return "serial"
    if url is not None and (url.host in LOOPBACK or url.host.startswith("127.")):
        return "loopback"
    return "network"
