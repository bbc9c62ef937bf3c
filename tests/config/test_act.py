"""[act]: its defaults, and what it needs of other tables."""

import pytest
from configured_links import AUTOPILOT

from fwav_companion.config import parse
from fwav_companion.errors import ConfigError

TEXT = AUTOPILOT + '[camera]\ncalibration = "camera.yaml"\n'
GIMBAL = ["camera.mount.gimbal_device_id=154", "camera.mount.pitch_deg=0.0"]


def test_nothing_is_commanded_without_the_table_and_by_its_defaults():
    assert parse(TEXT, "flight.toml").act is None
    act = parse(TEXT + "[act]\n", "flight.toml").act
    assert act is not None
    assert not act.acts
    assert (act.point, act.follow_target, act.follow_system_id) == ("none", False, 0)
    assert (act.point_rate_deg_s, act.follow_max_sigma_m) == (30.0, 3.0)


@pytest.mark.parametrize(
    ("settings", "key"),
    [
        (['act.point="gimbal"'], "gimbal_device_id"),
        (['act.point="elsewhere"'], "point"),
        (['act.point="roi"', "publish.camera_tracking=false"], "camera_tracking"),
        (["act.follow_target=true", "act.follow_system_id=255"], "follow_system_id"),
        (["act.follow_target=true", "act.follow_system_id=7", "vehicle.system_id=7"], "follow_system_id"),
        (["act.follow_target=true", "act.follow_system_id=256"], "follow_system_id"),
        (["act.point_rate_deg_s=0"], "point_rate_deg_s"),
    ],
)
def test_contradictions_are_one_line_that_names_the_key(settings, key):
    with pytest.raises(ConfigError, match=key) as error:
        parse(TEXT, "flight.toml", settings)
    assert "\n" not in str(error.value)


@pytest.mark.parametrize(
    "settings",
    [
        [*GIMBAL, 'act.point="gimbal"'],
        ['act.point="roi"'],
        ["act.follow_target=true", "act.follow_system_id=17", "vehicle.system_id=7"],
    ],
)
def test_what_fits_together_is_accepted(settings):
    assert parse(TEXT, "flight.toml", settings).act.acts


@pytest.mark.parametrize(("levelled", "value"), [("true", True), ("false", False), ('"auto"', "auto")])
def test_levelled_is_a_truth_or_auto(levelled, value):
    mount = parse(TEXT, "flight.toml", [*GIMBAL, f"camera.mount.levelled={levelled}"]).camera.mount
    assert mount.levelled == value
    assert (mount.gimbal_yaw_bias_deg, mount.gimbal_delay_s) == (3.0, 0.0)


def test_gimbals_heading_and_delay_are_in_the_priors():
    fixed, carried = parse(TEXT, "flight.toml").priors, parse(TEXT, "flight.toml", GIMBAL).priors
    assert carried.sigma(2) ** 2 - fixed.sigma(2) ** 2 == pytest.approx((3.0 * 0.017453292519943295) ** 2)
    assert carried.sigma(6) ** 2 - fixed.sigma(6) ** 2 == pytest.approx(0.05**2)
