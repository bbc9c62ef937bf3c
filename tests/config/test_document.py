"""Values that a parsed configuration gives to the rooms."""

import ast
import inspect
import math
from pathlib import Path

import msgspec
import numpy as np
import pytest
from scipy.spatial.transform import Rotation

from fwav_companion.config import (
    READOUT_SIGMA_UNKNOWN_S,
    MountConfig,
    StatusConfig,
    document,
    estimation,
    inputs,
    parse,
)
from fwav_companion.config.document import Document
from fwav_companion.errors import ConfigError
from fwav_companion.publishing import options as publishing_options
from fwav_companion.tracking import options as tracking_options
from fwav_companion.types import Bias
from fwav_companion.vision import task as vision_task

RELAY = '[detections]\nurl = ""\n'
AUTOPILOT = '[[link]]\nname = "a"\nurl = "serial:///dev/ttyAMA0:57600"\nrole = "autopilot"\n'


def test_priors_are_in_si_and_in_the_order_of_the_biases():
    text = """
    [uncertainty]
    attitude_noise_deg = 1.8
    attitude_bias_deg = 18
    heading_bias_deg = 36
    mount_bias_deg = 9
    position_bias_m = 7
    height_bias_m = 8
    terrain_m = 9
    time_offset_sigma_s = 0.5
    position_bias_time_s = 11
    position_delay_sigma_s = 0.3
    lever_arm_sigma_m = 0.2
    [ground]
    model = "terrain"
    terrain = ["N45E007.hgt"]
    terrain_datum = "egm96"
    """
    priors = parse(RELAY + text, "f.toml").priors
    assert priors.attitude_noise == pytest.approx(math.pi / 100)
    assert priors.pixel_noise_px == 4.0
    assert priors.position_noise_m == 0.1
    assert priors.height_noise_m == 0.3
    assert priors.position_bias_time_s == 11.0
    expected = {
        Bias.ROLL: math.pi / 10, Bias.PITCH: math.pi / 10, Bias.HEADING: math.pi / 5,
        Bias.MOUNT_X: math.pi / 20, Bias.MOUNT_Y: math.pi / 20, Bias.MOUNT_Z: math.pi / 20,
        Bias.TIME_OFFSET: 0.5, Bias.READOUT: READOUT_SIGMA_UNKNOWN_S, Bias.HEIGHT: 8.0,
        Bias.POSITION_NORTH: 7.0, Bias.POSITION_EAST: 7.0, Bias.TERRAIN: 9.0,
        Bias.POSITION_DELAY: 0.3, Bias.LEVER_X: 0.2, Bias.LEVER_Y: 0.2, Bias.LEVER_Z: 0.2,
        Bias.TARGET_HEIGHT: 0.0,
    }  # fmt: skip
    assert {bias: priors.sigma(bias) for bias in Bias} == pytest.approx(expected)


def test_a_targets_height_is_a_tenth_uncertain_and_counts_in_its_own_sigmas():
    config = parse(
        f'{RELAY}[[target]]\nlabel = "person"\nheight_m = 1.7\n'
        '[[target]]\nlabel = "pad"\nheight_m = 0.8\nheight_sigma_m = 0.0\nanchor = "top"\n',
        "f.toml",
    )
    assert [(each.label, each.anchor, each.sigma_m) for each in config.target] == [
        ("person", "center", pytest.approx(0.17)),
        ("pad", "top", 0.0),
    ]
    assert config.priors.sigma(Bias.TARGET_HEIGHT) == 1.0


@pytest.mark.parametrize("model", ["home", "fixed", "rangefinder"])
def test_a_ground_that_is_no_elevation_model_has_no_error_of_one(model: str):
    config = parse(f'{RELAY}[ground]\nmodel = "{model}"\n', "f.toml")
    assert config.priors.sigma(Bias.TERRAIN) == 0.0


@pytest.mark.parametrize(("readout", "known"), [("0.02", 0.02), ("0", 0.0), ("-0.03", -0.03)])
def test_a_known_readout_has_no_bias(readout: str, known: float):
    config = parse(f"{RELAY}[camera]\nreadout_s = {readout}\n", "f.toml")
    assert config.camera.known_readout_s == known
    assert config.priors.sigma(Bias.READOUT) == 0.0


def test_an_unknown_readout_is_uniform_over_a_frame_of_thirty_a_second():
    assert parse(RELAY, "f.toml").camera.known_readout_s is None
    assert np.std(np.linspace(0.0, 1.0 / 30.0, 100_001)) == pytest.approx(READOUT_SIGMA_UNKNOWN_S, rel=1e-4)


@pytest.mark.parametrize("angles", [(0.0, -90.0, 0.0), (10.0, -60.0, 30.0), (-5.0, 20.0, 170.0)])
def test_the_mount_is_that_of_another_library(angles: tuple[float, float, float]):
    roll, pitch, yaw = angles
    forward = np.array([[0, 0, 1], [1, 0, 0], [0, 1, 0]])
    expected = Rotation.from_euler("ZYX", [yaw, pitch, roll], degrees=True).as_matrix() @ forward
    mount = MountConfig(roll_deg=roll, pitch_deg=pitch, yaw_deg=yaw)
    np.testing.assert_allclose(np.array(mount.body_from_camera), expected, atol=1e-15)


def test_on_a_gimbal_straight_down_is_not_taken_for_what_was_meant():
    with pytest.raises(ConfigError, match=r"pitch_deg: on a gimbal the angles count from its own axes"):
        parse(RELAY + "[camera.mount]\ngimbal_device_id = 1\n", "f.toml")
    mount = parse(RELAY + "[camera.mount]\npitch_deg = 0.0\ngimbal_device_id = 1\n", "f.toml").camera.mount
    assert (mount.gimbal_device_id, mount.pitch_deg) == (1, 0.0)


def test_the_default_mount_looks_down_with_the_image_top_to_the_nose():
    np.testing.assert_allclose(np.array(MountConfig().body_from_camera), [[0, -1, 0], [1, 0, 0], [0, 0, 1]], atol=1e-15)


@pytest.mark.parametrize(
    ("stamp", "on_pi", "rule"),
    [
        ("auto", True, "row0_end"),
        ("auto", False, "row0_mid"),
        ("row0_start", True, "row0_start"),
        ("row0_mid", True, "row0_mid"),
    ],
)
def test_what_a_stamp_marks(stamp: str, on_pi: bool, rule: str):
    config = parse(f'{RELAY}[camera]\nstamp = "{stamp}"\n', "f.toml")
    assert config.camera.stamp_rule(libcamera_on_raspberry_pi=on_pi) == rule


def test_paths_count_from_the_file():
    config = parse('[camera]\ncalibration = "lens/camera.yaml"\n', "/etc/fwav/f.toml")
    assert config.calibration_path == Path("/etc/fwav/lens/camera.yaml")
    assert config.resolve("/abs/x") == Path("/abs/x")
    assert config.status_path is None
    named = msgspec.structs.replace(config, status=StatusConfig(file="run/status.json"))
    assert named.status_path == Path("/etc/fwav/run/status.json")


def test_what_one_command_needs_and_another_does_not():
    relay = parse(RELAY, "f.toml")
    with pytest.raises(ConfigError, match=r"f.toml: \[camera\] calibration: missing"):
        _ = relay.calibration_path
    with pytest.raises(ConfigError, match=r'f.toml: \[\[link\]\]: no link has role = "autopilot"'):
        relay.require_links()
    parse(RELAY + AUTOPILOT, "f.toml").require_links()


def test_a_header_holds_every_key_and_not_where_the_file_lies():
    here, there = (parse(RELAY + AUTOPILOT, name).as_builtins() for name in ("a/f.toml", "/b/g.toml"))
    assert here == there
    assert here["uncertainty"]["terrain_m"] == "auto"
    assert set(here) == set(Document.__struct_fields__)


def test_parsed_urls():
    config = parse(AUTOPILOT + '[detections]\nurl = "unix:///run/x"\n[camera]\ncalibration = "c"\n', "f.toml")
    assert str(config.link[0].parsed_url) == "serial:///dev/ttyAMA0:57600"
    assert str(config.detections.parsed_url) == "unix:///run/x"
    assert config.map_server is None


@pytest.mark.parametrize("module", [inputs, estimation, document, publishing_options, tracking_options, vision_task])
def test_every_key_is_explained_where_it_is_declared(module: object):
    explained = 0
    for section in ast.parse(inspect.getsource(module)).body:
        if not isinstance(section, ast.ClassDef):
            continue
        for statement, following in zip(section.body, [*section.body[1:], None], strict=True):
            if isinstance(statement, ast.AnnAssign):
                assert isinstance(following, ast.Expr), f"{section.name}.{ast.unparse(statement.target)}"
                assert isinstance(following.value, ast.Constant)
                explained += 1
    assert explained > 4


@pytest.mark.parametrize(
    ("model", "terrain_m", "sigma_m"),
    [
        ("home", '"auto"', 0.0),
        ("home", "4.0", 0.0),  # as files from before `auto` have it for every ground
        ("home", "2.5", 2.5),
        ("fixed", "1.0", 1.0),
        ("terrain", '"auto"', 4.0),
        ("terrain", "4.0", 4.0),
        ("terrain", "7.0", 7.0),
    ],
)
def test_the_grounds_own_height_counts_where_it_is_set(model, terrain_m, sigma_m):
    config = parse(f'{RELAY}[ground]\nmodel = "{model}"\n[uncertainty]\nterrain_m = {terrain_m}\n', "here.toml")
    assert config.priors.sigma(Bias.TERRAIN) == sigma_m
