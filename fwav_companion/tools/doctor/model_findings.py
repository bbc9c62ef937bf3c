"""The model of [vision]: whether it runs, how it is read, and what tiles cost."""

from __future__ import annotations

from collections.abc import Iterator

from fwav_companion.tools.doctor.evidence import Evidence
from fwav_companion.tools.doctor.finding import Finding
from fwav_companion.tools.doctor.finding_table import make_finding


def model_findings(evidence: Evidence) -> Iterator[Finding]:
    """Yield how the configured model is read, and what is wrong with it; nothing without a model."""
    report, vision = evidence.files.model, evidence.config.vision
    if report is None or vision is None:
        return
    if report.error:
        yield make_finding("model", error=report.error)
        return
    yield make_finding("model_reading", reading=report.reading)
    if report.problem:
        yield make_finding("model_implausible", why=report.problem)
    if report.passes > 1:
        columns, rows = vision.model_tiles
        yield make_finding(
            "model_tiles",
            columns=columns,
            rows=rows,
            passes=report.passes,
            seconds=report.seconds,
            pictures_hz=1.0 / max(report.seconds, 1e-3),
        )
