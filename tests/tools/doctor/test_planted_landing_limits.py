"""What makes an autopilot give up a landing, or land without the target: each is named with what to change."""

import msgspec
import pytest
from hearing import codes, found, heard

from fwav_companion.tools.doctor.examination import examine
from fwav_companion.tools.doctor.finding import Level
from sitl_mock import scenario

HEALTHY = scenario("unbiased").but({"seed": 3})
LANDING = ["publish.landing_target=true", "publish.landing_label=target", 'target=[{label = "target"}]']
LIMITS = [
    ("PLND_STRICT", 0.0, Level.WARNING, "lands where it is"),
    ("PLND_STRICT", 2.0, Level.NOTE, "hovers until"),
    ("PLND_RET_MAX", 0.0, Level.WARNING, "no retry"),
    ("PLND_XY_DIST_MAX", 0.9, Level.WARNING, "does not descend while the target is farther"),
    ("PLND_XY_DIST_MAX", 0.0, Level.NOTE, "however far the target is"),
]


def with_parameters(evidence, **parameters):
    """The evidence of an autopilot with these parameters instead."""
    status = msgspec.structs.replace(evidence.status, parameters={**evidence.status.parameters, **parameters})
    return msgspec.structs.replace(evidence, status=status)


def with_telemetry(evidence, **telemetry):
    """The evidence with these parts of the telemetry's report instead."""
    changed = msgspec.structs.replace(evidence.status.telemetry, **telemetry)
    return msgspec.structs.replace(evidence, status=msgspec.structs.replace(evidence.status, telemetry=changed))


def without(evidence, message):
    """The evidence where this message does not arrive."""
    rates_hz = {name: hz for name, hz in evidence.status.telemetry.rates_hz.items() if name != message}
    return with_telemetry(evidence, rates_hz=rates_hz)


def test_a_landing_by_arducopters_defaults_has_nothing_to_change():
    evidence = heard(HEALTHY, LANDING)
    assert found(evidence) == []
    assert {"PLND_STRICT", "PLND_RET_MAX", "PLND_XY_DIST_MAX", "PLND_ALT_MIN", "PLND_ALT_MAX"} <= set(
        evidence.status.parameters
    )


def test_limits_of_a_landing_are_read_only_where_a_label_to_land_on_is_configured():
    assert not {"PLND_STRICT", "PLND_ALT_MAX"} & set(heard(HEALTHY).status.parameters)


@pytest.mark.parametrize(("name", "value", "level", "said"), LIMITS)
def test_limit_that_ends_a_landing_is_named_with_its_value_and_effect(name, value, level, said):
    (finding,) = examine(with_parameters(heard(HEALTHY, LANDING), **{name: value}))
    assert (finding.code, finding.level) == ("landing_gives_up", level)
    assert finding.problem.startswith(f"{name} = {value:g}: ")
    assert said in finding.problem


def test_limit_of_distance_that_the_claims_limit_fits_into_twice_is_enough():
    assert examine(with_parameters(heard(HEALTHY, LANDING), PLND_XY_DIST_MAX=1.0)) == []


def test_limits_do_not_matter_where_no_landing_is_steered():
    assert found(with_parameters(heard(HEALTHY), PLND_STRICT=0.0, PLND_RET_MAX=0.0)) == []


def test_copter_without_a_rangefinder_never_retries():
    evidence = heard(HEALTHY.but({"autopilot.rangefinder": False}), LANDING)
    (finding,) = examine(evidence)
    assert (finding.code, finding.level) == ("landing_no_rangefinder", Level.WARNING)
    assert "whatever PLND_STRICT says" in finding.problem
    assert examine(with_parameters(evidence, PLND_ALT_MIN=0.0, PLND_ALT_MAX=0.0)) == [], "retries at any height"
    assert codes(examine(with_parameters(evidence, PLND_ALT_MIN=0.0))) == ["landing_no_rangefinder"]


def test_height_that_the_service_sends_itself_is_the_copters_rangefinder():
    evidence = heard(HEALTHY.but({"autopilot.rangefinder": False}), [*LANDING, "publish.distance_sensor=true"])
    assert "landing_no_rangefinder" not in found(evidence)


def test_px4_needs_no_rangefinder_for_a_landing_and_a_global_position():
    px4 = heard(scenario("px4").but({"seed": 3}), LANDING)
    assert found(without(px4, "DISTANCE_SENSOR")) == []
    (finding,) = examine(without(px4, "GLOBAL_POSITION_INT"))
    assert (finding.code, finding.level) == ("landing_needs_global_position", Level.ERROR)
    assert codes(examine(without(heard(HEALTHY, LANDING), "GLOBAL_POSITION_INT"))) == []


def test_px4_that_never_had_a_global_position_is_an_error_although_empty_positions_arrive():
    px4 = heard(scenario("px4").but({"seed": 3, "autopilot.gps": False}), LANDING)
    assert "landing_needs_global_position" in found(px4)


def test_local_position_that_the_filter_does_not_vouch_for_is_named_with_the_reason():
    evidence = heard(HEALTHY, LANDING)
    (finding,) = examine(with_telemetry(evidence, local_trouble="no horizontal velocity"))
    assert (finding.code, finding.level) == ("landing_local_position", Level.WARNING)
    assert "(no horizontal velocity)" in finding.problem
    for not_reported in ("", None):
        assert examine(with_telemetry(evidence, local_trouble=not_reported)) == []
    assert examine(with_telemetry(heard(HEALTHY), local_trouble="no horizontal velocity")) == [], "no landing"


def in_the_world(evidence, **telemetry):
    """The evidence ten seconds after the start without a global position."""
    later = with_telemetry(evidence, **telemetry)
    return msgspec.structs.replace(later, status=msgspec.structs.replace(later.status, origin=None))


def test_local_position_in_use_is_noted_with_what_it_costs():
    evidence = in_the_world(heard(HEALTHY), position="local", relative_world=False)
    (finding,) = examine(evidence)
    assert (finding.code, finding.level) == ("local_position", Level.NOTE)
    assert "no latitude and longitude; height by GLOBAL_POSITION_INT" in finding.problem


@pytest.mark.parametrize(
    ("trouble", "hz", "said"),
    [
        ("", 0.0, "no LOCAL_POSITION_NED or ODOMETRY"),
        (None, 10.0, "no EKF_STATUS_REPORT or ESTIMATOR_STATUS"),
        ("no horizontal velocity", 10.0, "(no horizontal velocity)"),
    ],
)
def test_relative_world_is_reported_with_the_reason_why_the_local_position_is_not_used(trouble, hz, said):
    evidence = heard(HEALTHY)
    rates_hz = {**evidence.status.telemetry.rates_hz, "LOCAL_POSITION_NED": hz}
    (finding,) = examine(
        in_the_world(evidence, position="none", relative_world=True, local_trouble=trouble, rates_hz=rates_hz)
    )
    assert (finding.code, finding.level) == ("no_position", Level.WARNING)
    assert said in finding.problem


@pytest.mark.parametrize(
    ("refused", "said"),
    [
        ({"ODOMETRY (LOCAL_FRD)": 9}, "the odometry is not used: ODOMETRY (LOCAL_FRD)"),
        ({}, "no EKF_STATUS_REPORT or ESTIMATOR_STATUS"),
    ],
)
def test_odometry_that_is_refused_is_named_where_the_world_is_relative(refused, said):
    evidence = heard(HEALTHY)
    rates_hz = {**evidence.status.telemetry.rates_hz, "LOCAL_POSITION_NED": 0.0, "ODOMETRY": 30.0}
    (finding,) = examine(
        in_the_world(
            evidence, position="none", relative_world=True, local_trouble=None, rates_hz=rates_hz, refused=refused
        )
    )
    assert said in finding.problem
