"""The position and the height above the ground: what shows them, and what is missing while they are."""

from __future__ import annotations

from collections.abc import Iterator
from typing import Final

from fwav_companion.tools.doctor.evidence import Evidence
from fwav_companion.tools.doctor.finding import Finding, Level
from fwav_companion.tools.doctor.run_status import MEASURED_S
from fwav_companion.types.status import RunStatus

HEIGHT_OF_MODEL: Final = {"fixed": "[ground] height_m", "rangefinder": "the rangefinder"}
"""What shows the height on the grounds that need no height above home."""


def position_findings(evidence: Evidence, status: RunStatus, where: str) -> Iterator[Finding]:
    """Yield what is to say about an adopted autopilot's position and height."""
    yield from _position(evidence, status, where)
    yield from _height(evidence, status, where)


def _position(evidence: Evidence, status: RunStatus, where: str) -> Iterator[Finding]:
    relative = status.telemetry.relative_world
    if status.origin is not None:
        return
    if evidence.config.vehicle.position == "none" and evidence.config.localizes:
        yield Finding(
            "below_camera_only",
            Level.NOTE,
            where,
            problem=f"localizes below the camera only, as configured; {_height_source(evidence, status)}",
            fix='[vehicle] position = "auto" where the autopilot knows its position',
        )
    elif status.telemetry.position == "local":
        yield Finding(
            "local_position",
            Level.NOTE,
            where,
            problem="no global position came: the autopilot's local one is used, which its filter vouches for; targets "
            f"have no latitude and longitude; {_height_source(evidence, status)}",
            fix='GNSS reception before the start gives places on the map; [vehicle] position = "none" uses neither',
        )
    elif evidence.config.vehicle.position == "auto" and (relative or status.adopted_s >= MEASURED_S):
        yield Finding(
            "no_position",
            Level.WARNING,
            where,
            problem=f"no global position came, and {_why_not_local(status)}: localizes below the camera only, targets "
            f"are relative to the vehicle; {_height_source(evidence, status)}"
            if relative
            else "no global position yet",
            fix='wait for GPS before take-off; [vehicle] position = "none" where there is none on purpose',
        )


def _height(evidence: Evidence, status: RunStatus, where: str) -> Iterator[Finding]:
    """Report a height that a barometer alone shows, and a barometer that cannot show it."""
    telemetry = status.telemetry
    if evidence.config.ground.model in HEIGHT_OF_MODEL:
        return
    if telemetry.height_source is not None and telemetry.height_source.startswith("barometer"):
        yield Finding(
            "height_barometric",
            Level.NOTE,
            where,
            problem=f"the height is that of the {telemetry.height_source}: 1 m (one sigma), 1 m more in 10 min",
            fix='a rangefinder with [ground] model = "rangefinder" where this is too coarse',
        )
    elif telemetry.height_source is None and telemetry.barometer_starts_in_air:
        yield Finding(
            "height_starts_in_air",
            Level.WARNING,
            where,
            problem="no height: the vehicle was first heard armed, so that its barometer has no mean on the ground",
            fix='start the service before arming; or a rangefinder, or [ground] model = "fixed"',
        )


def _why_not_local(status: RunStatus) -> str:
    """Return why the autopilot's local position is not used in place of a global one."""
    telemetry = status.telemetry
    if not telemetry.rates_hz.get("LOCAL_POSITION_NED"):
        refused = sorted(name for name in telemetry.refused if name.startswith("ODOMETRY"))
        if refused:
            return f"no LOCAL_POSITION_NED, and the odometry is not used: {', '.join(refused)}"
        if not telemetry.rates_hz.get("ODOMETRY"):
            return "no LOCAL_POSITION_NED or ODOMETRY"
    trouble = telemetry.local_trouble
    if trouble is None:
        return "no EKF_STATUS_REPORT or ESTIMATOR_STATUS that vouches for the local one"
    return f"the autopilot's filter does not vouch for the local one ({trouble})"


def _height_source(evidence: Evidence, status: RunStatus) -> str:
    """Return what shows the height above the ground in a world without a global position."""
    source = HEIGHT_OF_MODEL.get(evidence.config.ground.model, status.telemetry.height_source)
    return "no height yet" if source is None else f"height by {source}"
