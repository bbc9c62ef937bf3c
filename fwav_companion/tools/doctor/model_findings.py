"""The model of [vision]: whether it runs, how it is read, and what tiles cost."""

from __future__ import annotations

from collections.abc import Iterator

from fwav_companion.tools.doctor.evidence import Evidence
from fwav_companion.tools.doctor.finding import Finding, Level


def model_findings(evidence: Evidence) -> Iterator[Finding]:
    """Yield how the configured model is read, and what is wrong with it; nothing without a model."""
    report, vision = evidence.files.model, evidence.config.vision
    if report is None or vision is None:
        return
    if report.error:
        yield Finding(
            "model",
            Level.ERROR,
            "[vision] model",
            problem=report.error,
            fix="change what it names; the handbook's page of detectors has a line for each kind of model",
        )
        return
    yield Finding(
        "model_reading",
        Level.NOTE,
        "[vision] model",
        problem=f"read as {report.reading}",
        fix="look at some pictures: `detect PICTURES --config FILE --draw DIR`",
    )
    if report.problem:
        yield Finding(
            "model_implausible",
            Level.WARNING,
            "[vision] model_format",
            problem=report.problem,
            fix="set the format, then look at some pictures: `detect PICTURES --config FILE --draw DIR`",
        )
    if report.passes > 1:
        columns, rows = vision.model_tiles
        yield Finding(
            "model_tiles",
            Level.NOTE,
            "[vision] model_tiles",
            problem=f"{columns} x {rows} tiles and the whole picture are {report.passes} passes of the model for each "
            f"picture: {report.seconds:.2f} s here, {1.0 / max(report.seconds, 1e-3):.1f} pictures/s",
            fix="fewer tiles, or more threads, if that is too slow: the newest picture is taken, others are skipped",
        )
