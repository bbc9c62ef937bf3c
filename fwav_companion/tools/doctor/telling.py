"""What the doctor heard and found, as lines for people. Pure."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from math import degrees
from typing import Any

from fwav_companion.tools.doctor.evidence import Evidence
from fwav_companion.tools.doctor.finding import Finding, Level

MARK = {Level.STOPS: "STOPS", Level.HARMS: "harms", Level.MINDS: "minds"}


def told(evidence: Evidence, findings: Sequence[Finding], how: str) -> Iterator[str]:
    """All of it, line by line. ``how`` it was heard."""
    yield how
    for link in evidence.config.link:
        yield from _link(evidence, link.name, link.url)
    yield from _streams(evidence)
    yield _clock(evidence)
    yield from _camera(evidence)
    yield ""
    if not findings:
        yield "all is well: nothing to change"
    for number, finding in enumerate(findings, start=1):
        yield f"{number}. {MARK[finding.level]}  {finding.where}: {finding.what}"
        yield f"          {finding.do}"


def _link(evidence: Evidence, name: str, url: str) -> Iterator[str]:
    state, traffic = evidence.ask("links", name, "state") or "not opened", evidence.traffic(name)
    yield f"link {name} ({url}): {state}, {traffic.get('bytes_in') or 0} bytes in"
    for peer in traffic.get("peers") or ():
        received, lost = peer.get("received") or 0, peer.get("lost") or 0
        loss = 100.0 * lost / (received + lost) if received + lost else 0.0
        rate_hz = sum((peer.get("rates_hz") or {}).values())
        yield f"  {peer['system']}/{peer['component']}: {rate_hz:.0f} messages/s, {loss:.1f} % lost"


def _streams(evidence: Evidence) -> Iterator[str]:
    autopilot = evidence.autopilot
    if autopilot is None:
        yield "autopilot: none"
        return
    armed = "armed" if autopilot.get("armed") else "disarmed"
    yield f"autopilot: {autopilot.get('kind')}, system {autopilot.get('system')}, {armed}"
    for name, rate in (evidence.ask("rates") or {}).items():
        measured, asked = rate.get("measured_hz"), rate.get("asked_hz")
        if asked is None:
            continue
        heard = "not yet measured" if measured is None else f"{measured:.1f} Hz"
        undone = f", undone by {rate['undone_by']}" if rate.get("undone_by") else ""
        yield f"  {name}: {heard} of {asked:g} Hz asked ({rate.get('state')}){undone}"


def _clock(evidence: Evidence) -> str:
    clock = evidence.ask("clock") or {}
    if clock.get("status") in (None, "unknown"):
        return "clock: not known"
    trip = clock.get("round_trip_s")
    return (
        f"clock: {clock['status']}, one sigma {_ms(clock.get('sigma_s'))}, hard bound {_ms(clock.get('bound_s'))}"
        f", best round trip {_ms(trip) if trip is not None else 'none'}"
    )


def _camera(evidence: Evidence) -> Iterator[str]:
    if not evidence.config.localizes:
        yield "camera: none; a relay alone"
        return
    calibration = evidence.files.calibration
    if calibration is not None:
        width, height = calibration.image_size
        yield f"camera: {width} x {height}, calibrated to {degrees(calibration.lens.max_angle):.0f} deg from the axis"
    came, age_s = evidence.number("intake", "came"), evidence.ask("intake", "age_s")
    last = "" if age_s is None else f", the last {age_s:.1f} s ago"
    used = f"{evidence.number('detections'):.0f} detections, {evidence.number('fixes'):.0f} of them on the ground"
    yield f"frames: {came:.0f}{last}; {used}"
    dropped = evidence.ask("dropped") or {}
    if dropped:
        yield "  not used: " + ", ".join(f"{count} {reason}" for reason, count in dropped.items())


def _ms(seconds: Any) -> str:
    return f"{1e3 * seconds:.2f} ms" if isinstance(seconds, int | float) else "unknown"
