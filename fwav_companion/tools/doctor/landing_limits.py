"""What makes an autopilot give up a precision landing: its limits, its sensors, its position.

ArduPilot's rules are those of AC_PrecLand_StateMachine: after the loss of a target it retries by PLND_STRICT only while
a rangefinder shows a height between PLND_ALT_MIN and PLND_ALT_MAX; without one it descends straight on. PX4's precision
landing needs a global position (docs/en/advanced_features/precland.md).
"""

from __future__ import annotations

from collections.abc import Callable, Iterator, Mapping
from typing import Final

import msgspec

from fwav_companion.tools.doctor.evidence import Evidence
from fwav_companion.tools.doctor.finding import Finding
from fwav_companion.tools.doctor.finding_table import make_finding
from fwav_companion.tools.doctor.run_status import MEASURED_S
from fwav_companion.types.status import RunStatus

SPREAD: Final = 2.0
"""Sigmas within which the reported place of a target moves: nearer limits than this hold the descent up."""


class LandingLimit(msgspec.Struct, frozen=True, kw_only=True):
    """A value of one of ArduPilot's parameters with which it gives up, or never does."""

    parameter: str
    effect: str
    """Case of ``landing_gives_up`` in the table of findings."""
    applies: Callable[[float, float], bool]
    """Whether it does with this value; the second argument is landing_max_sigma_m."""


LANDING_LIMITS: Final = (
    LandingLimit(parameter="PLND_STRICT", effect="lands_anywhere", applies=lambda value, _: value == 0),
    LandingLimit(parameter="PLND_STRICT", effect="hovers", applies=lambda value, _: value == 2),
    LandingLimit(parameter="PLND_RET_MAX", effect="no_retry", applies=lambda value, _: value == 0),
    LandingLimit(
        parameter="PLND_XY_DIST_MAX", effect="narrow", applies=lambda value, limit_m: 0 < value < SPREAD * limit_m
    ),
    LandingLimit(parameter="PLND_XY_DIST_MAX", effect="no_bound", applies=lambda value, _: value == 0),
)


def landing_limit_findings(evidence: Evidence, status: RunStatus) -> Iterator[Finding]:
    """Yield what makes the adopted autopilot give up a landing, or land without the target."""
    kind = "" if status.autopilot is None else status.autopilot.kind
    if kind == "ardupilot":
        yield from _limits(status.parameters, evidence.config.publish.landing_max_sigma_m)
    if status.adopted_s < MEASURED_S:
        return
    if kind == "ardupilot" and not evidence.config.publish.distance_sensor:
        yield from _no_rangefinder(status)
    elif kind == "px4":
        yield from _no_global_position(evidence, status)
    yield from _local_position(status)


def _limits(parameters: Mapping[str, float], limit_m: float) -> Iterator[Finding]:
    for limit in LANDING_LIMITS:
        value = parameters.get(limit.parameter)
        if value is not None and limit.applies(value, limit_m):
            yield make_finding("landing_gives_up", limit.effect, value=value)


def _no_rangefinder(status: RunStatus) -> Iterator[Finding]:
    """Report the lack of a rangefinder, unless both limits of height are 0, which is how ArduPilot ignores them."""
    heights = [status.parameters.get(f"PLND_ALT_{end}") for end in ("MIN", "MAX")]
    if status.telemetry.rates_hz.get("DISTANCE_SENSOR") or heights == [0.0, 0.0]:
        return
    yield make_finding("landing_no_rangefinder")


def _no_global_position(evidence: Evidence, status: RunStatus) -> Iterator[Finding]:
    expected = evidence.config.vehicle.position != "none"
    if status.telemetry.rates_hz.get("GLOBAL_POSITION_INT") and not (expected and status.origin is None):
        return
    yield make_finding("landing_needs_global_position")


def _local_position(status: RunStatus) -> Iterator[Finding]:
    trouble = status.telemetry.local_trouble
    if trouble:
        yield make_finding("landing_local_position", trouble=trouble)
