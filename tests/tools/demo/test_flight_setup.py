"""The service's configuration and the mock's priors are the same numbers."""

import argparse

from fwav_companion.config import parse
from fwav_companion.tools.demo.flight_setup import PRIORS, FlightSetup
from sitl_mock.arguments import add_flight_arguments, options_from
from sitl_mock.draws import draw


def options(setting: FlightSetup):
    config = parse(setting.config_text(14540, 14550), "demo.toml")
    parser = argparse.ArgumentParser()
    add_flight_arguments(parser)
    return config, options_from(parser.parse_args(setting.mock_arguments(config)), 60.0)


def test_the_mock_draws_from_the_priors_that_the_configuration_states():
    config, mock = options(FlightSetup(seed=3, seconds=12.0))
    assert mock.seed == 3
    assert mock.seconds == 12.0
    automatic = {"position_bias_m": 1.0, "position_bias_time_s": 60.0}  # a receiver without a word of its own
    for name in PRIORS:
        stated = getattr(config.uncertainty, name)
        assert getattr(mock.priors, name) == (automatic[name] if stated == "auto" else stated)
    assert mock.draw_biases
    assert mock.camera.readout_s == config.camera.readout_s
    assert mock.camera.time_offset_s == config.camera.time_offset_s
    assert mock.camera.mount_deg == (0.0, config.camera.mount.pitch_deg, 0.0)


def test_the_seed_changes_everything_that_is_wrong():
    drawn = [draw(options(FlightSetup(seed=seed, seconds=30.0))[1]) for seed in (1, 2)]
    for name in ("attitude_roll_deg", "heading_deg", "mount_deg", "time_offset_s", "height_m", "readout_s"):
        assert getattr(drawn[0], name) != getattr(drawn[1], name)
    assert all(0.01 < each.readout_s < 0.04 for each in drawn)


def test_the_configuration_is_one_that_a_user_could_have():
    config, _ = options(FlightSetup(seed=1, seconds=30.0))
    config.require_links()
    assert config.localizes
    assert config.vision is not None
    assert config.detections.parsed_url is None
