"""The position and the height above the ground: what shows them, and what is missing while they are."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from typing import Final

from fwav_companion.tools.doctor.evidence import Evidence
from fwav_companion.tools.doctor.finding import Finding
from fwav_companion.tools.doctor.finding_table import make_finding
from fwav_companion.tools.doctor.run_status import MEASURED_S
from fwav_companion.types.status import RunStatus

HEIGHT_OF_MODEL: Final = {"fixed": "[ground] height_m", "rangefinder": "the rangefinder"}
"""What shows the height on the grounds that need no height above home."""


def position_findings(evidence: Evidence, status: RunStatus, system: int) -> Iterator[Finding]:
    """Yield what is to say about an adopted autopilot's position and height."""
    yield from _position(evidence, status, system)
    yield from _height(evidence, status, system)


def _position(evidence: Evidence, status: RunStatus, system: int) -> Iterator[Finding]:
    telemetry, relative = status.telemetry, status.telemetry.relative_world
    if status.origin is not None:
        return
    source = HEIGHT_OF_MODEL.get(evidence.config.ground.model, telemetry.height_source)
    height = "unknown" if source is None else "known"
    if evidence.config.vehicle.position == "none" and evidence.config.localizes:
        yield make_finding("below_camera_only", height, system=system, height_source=source)
    elif telemetry.position == "local":
        yield make_finding("local_position", height, system=system, height_source=source)
    elif evidence.config.vehicle.position == "auto" and (relative or status.adopted_s >= MEASURED_S):
        refused = sorted(name for name in telemetry.refused if name.startswith("ODOMETRY"))
        yield make_finding(
            "no_position",
            "relative" if relative else "waiting",
            _no_local(status, refused),
            height,
            system=system,
            height_source=source,
            refused=", ".join(refused),
            trouble=telemetry.local_trouble,
        )


def _height(evidence: Evidence, status: RunStatus, system: int) -> Iterator[Finding]:
    """Report a height that a barometer alone shows, and a barometer that cannot show it."""
    telemetry = status.telemetry
    if evidence.config.ground.model in HEIGHT_OF_MODEL:
        return
    if telemetry.height_source is not None and telemetry.height_source.startswith("barometer"):
        yield make_finding("height_barometric", system=system, height_source=telemetry.height_source)
    elif telemetry.height_source is None and telemetry.barometer_starts_in_air:
        yield make_finding("height_starts_in_air", system=system)


def _no_local(status: RunStatus, refused: Sequence[str]) -> str:
    """Return the case of why the autopilot's local position is not used in place of a global one."""
    telemetry = status.telemetry
    if not telemetry.rates_hz.get("LOCAL_POSITION_NED"):
        if refused:
            return "odometry_refused"
        if not telemetry.rates_hz.get("ODOMETRY"):
            return "nothing_local"
    return "no_report" if telemetry.local_trouble is None else "trouble"
