"""The report of `check` as lines of text."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from math import degrees

from fwav_companion.config import LinkConfig
from fwav_companion.tools.doctor.autopilot_findings import REBOOTED
from fwav_companion.tools.doctor.evidence import Evidence
from fwav_companion.tools.doctor.finding import Finding
from fwav_companion.tools.doctor.link_findings import judged_loss
from fwav_companion.types.camera import DeliveryReport
from fwav_companion.types.network_status import StreamReport
from fwav_companion.types.status import RunStatus


def report_lines(evidence: Evidence, findings: Sequence[Finding], how: str) -> Iterator[str]:
    """Yield the report: what was heard, then the findings. ``how``: where the status comes from."""
    yield how
    status = evidence.status
    if status is not None:
        for link in evidence.config.link:
            yield from _link(link, status)
        yield from _streams(status)
        yield _clock(status)
        yield from _camera(evidence, status)
    yield ""
    if not findings:
        yield "all is well: nothing to change"
    for number, finding in enumerate(findings, start=1):
        yield f"{number}. {finding.level:<8} {finding.where}: {finding.problem}"
        yield f"            fix: {finding.fix}"
        yield from _consequences(finding, depth=1)


def _consequences(finding: Finding, depth: int) -> Iterator[str]:
    for effect in finding.consequences:
        yield f"{' ' * (8 + 4 * depth)}follows: {effect.where}: {effect.problem}"
        yield from _consequences(effect, depth + 1)


def _link(link: LinkConfig, status: RunStatus) -> Iterator[str]:
    traffic = status.traffic_of(link.name)
    yield f"link {link.name} ({link.url}): {status.link(link.name).state}, {traffic.bytes_in} bytes in"
    for peer in traffic.peers:
        loss = judged_loss(status, link, peer)
        lost = "" if loss is None else f", {100.0 * loss:.1f} % lost"
        yield f"  {peer.system}/{peer.component}: {sum(peer.rates_hz.values()):.0f} messages/s{lost}"


def _streams(status: RunStatus) -> Iterator[str]:
    autopilot = status.autopilot
    if autopilot is None:
        yield "autopilot: none"
        return
    armed = "armed" if autopilot.armed else "disarmed"
    yield f"autopilot: {autopilot.kind}, system {autopilot.system}, {armed}"
    for name, stream in status.rates.items():
        if stream.asked_hz is not None:
            measured = "not yet measured" if stream.measured_hz is None else f"{stream.measured_hz:.1f} Hz"
            yield f"  {name}: {measured} of {stream.asked_hz:g} Hz requested ({stream.state}){_overridden_by(stream)}"
        elif stream.measured_hz:
            yield f"  {name}: {stream.measured_hz:.1f} Hz as it comes"


def _overridden_by(stream: StreamReport) -> str:
    if not stream.undone_by:
        return ""
    return f", requested again: {stream.undone_by}" if REBOOTED in stream.undone_by else f", lost to {stream.undone_by}"


def _clock(status: RunStatus) -> str:
    clock = status.clock
    if clock.status == "unknown":
        return "clock: not known"
    trip = "none" if clock.round_trip_s is None else _ms(clock.round_trip_s)
    sigma, bound = _ms(clock.sigma_s), _ms(clock.bound_s)
    return f"clock: {clock.status}, one sigma {sigma}, hard bound {bound}, best round trip {trip}"


def _camera(evidence: Evidence, status: RunStatus) -> Iterator[str]:
    if not evidence.config.localizes:
        yield "camera: none; a relay alone"
        return
    calibration = evidence.files.calibration
    if calibration is not None:
        width, height = calibration.image_size
        yield f"camera: {width} x {height}, calibrated to {degrees(calibration.lens.max_angle):.0f} deg from the axis"
    if status.vision is not None and status.vision.delivery is not None:
        yield _delivery(status.vision.delivery)
    last = "" if status.intake.age_s is None else f", the last {status.intake.age_s:.1f} s ago"
    used = f"{status.detections} detections, {status.fixes} of them localized"
    yield f"frames: {status.intake.came}{last}; {used}"
    if status.dropped:
        yield "  not used: " + ", ".join(f"{count} {reason}" for reason, count in status.dropped.items())


def _delivery(delivery: DeliveryReport) -> str:
    """Description of the camera's delivery, and of the rate that the detector reaches on this board."""
    exposure = "" if delivery.exposure_s is None else f", exposure {1e3 * delivery.exposure_s:.2f} ms"
    age = "" if delivery.age_s is None else f", {1e3 * delivery.age_s:.0f} ms old on arrival"
    width, height = delivery.size
    return (
        f"pictures: {width} x {height}, {delivery.fps:.1f} Hz{exposure}; stamps by {delivery.clock}{age}; "
        f"the detector can process {delivery.detector_hz:.1f} Hz, {delivery.skipped} skipped"
    )


def _ms(seconds: float | None) -> str:
    return "unknown" if seconds is None else f"{1e3 * seconds:.2f} ms"
