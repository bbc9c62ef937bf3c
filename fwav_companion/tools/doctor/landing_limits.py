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
from fwav_companion.tools.doctor.finding import Finding, Level
from fwav_companion.tools.doctor.run_status import MEASURED_S
from fwav_companion.types.status import RunStatus

WHERE: Final = "[publish] landing_target"
SPREAD: Final = 2.0
"""Sigmas within which the reported place of a target moves: nearer limits than this hold the descent up."""


class LandingLimit(msgspec.Struct, frozen=True, kw_only=True):
    """A value of one of ArduPilot's parameters with which it gives up, or never does."""

    parameter: str
    applies: Callable[[float, float], bool]
    """Whether it does with this value; the second argument is landing_max_sigma_m."""
    level: Level
    effect: str
    fix: str


LANDING_LIMITS: Final = (
    LandingLimit(
        parameter="PLND_STRICT",
        applies=lambda value, _: value == 0,
        level=Level.WARNING,
        effect="2 s after the target is lost the vehicle lands where it is",
        fix="set PLND_STRICT to 1: it retries, and lands where it is after the last retry",
    ),
    LandingLimit(
        parameter="PLND_STRICT",
        applies=lambda value, _: value == 2,
        level=Level.NOTE,
        effect="after the last retry the vehicle hovers until the pilot or the battery ends it",
        fix="set PLND_STRICT to 1, unless that is intended",
    ),
    LandingLimit(
        parameter="PLND_RET_MAX",
        applies=lambda value, _: value == 0,
        level=Level.WARNING,
        effect="a target that is lost is not searched: no retry",
        fix="set PLND_RET_MAX to 4",
    ),
    LandingLimit(
        parameter="PLND_XY_DIST_MAX",
        applies=lambda value, limit_m: 0 < value < SPREAD * limit_m,
        level=Level.WARNING,
        effect="the vehicle does not descend while the target is farther, which a claim within landing_max_sigma_m may "
        "be by chance",
        fix="set PLND_XY_DIST_MAX to 2.5, or landing_max_sigma_m lower",
    ),
    LandingLimit(
        parameter="PLND_XY_DIST_MAX",
        applies=lambda value, _: value == 0,
        level=Level.NOTE,
        effect="the vehicle descends however far the target is",
        fix="set PLND_XY_DIST_MAX to 2.5, unless that is intended",
    ),
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
            yield Finding(
                "landing_gives_up",
                limit.level,
                WHERE,
                problem=f"{limit.parameter} = {value:g}: {limit.effect}",
                fix=limit.fix,
            )


def _no_rangefinder(status: RunStatus) -> Iterator[Finding]:
    """Report the lack of a rangefinder, unless both limits of height are 0, which is how ArduPilot ignores them."""
    heights = [status.parameters.get(f"PLND_ALT_{end}") for end in ("MIN", "MAX")]
    if status.telemetry.rates_hz.get("DISTANCE_SENSOR") or heights == [0.0, 0.0]:
        return
    yield Finding(
        "landing_no_rangefinder",
        Level.WARNING,
        WHERE,
        problem="no DISTANCE_SENSOR arrives: where the target is lost the vehicle descends straight on and never "
        "retries, whatever PLND_STRICT says",
        fix="a rangefinder, or [publish] distance_sensor over a tag of known size; or PLND_ALT_MIN and PLND_ALT_MAX "
        "both 0, which retries at any height",
    )


def _no_global_position(evidence: Evidence, status: RunStatus) -> Iterator[Finding]:
    expected = evidence.config.vehicle.position != "none"
    if status.telemetry.rates_hz.get("GLOBAL_POSITION_INT") and not (expected and status.origin is None):
        return
    yield Finding(
        "landing_needs_global_position",
        Level.ERROR,
        WHERE,
        problem="PX4 has no global position, and its precision landing needs one",
        fix="wait for GNSS reception; without any only ArduPilot lands on a target",
    )


def _local_position(status: RunStatus) -> Iterator[Finding]:
    trouble = status.telemetry.local_trouble
    if trouble:
        yield Finding(
            "landing_local_position",
            Level.WARNING,
            WHERE,
            problem=f"the autopilot does not vouch for its local position ({trouble}): it lands without the target",
            fix="GNSS reception, optical flow or visual odometry that its filter uses; wait until it has settled",
        )
