"""The lines to paste express the estimate, and are not offered where another fault must be corrected first."""

import tomllib
from math import radians

import numpy as np
import pytest
from frozen import hold, keys
from hands import FORWARD_DOWN, Hands

from fwav_companion.geometry.mounts import body_from_camera_from_euler
from fwav_companion.tools.shake.shake_report import ShakeReport, is_usable

CONFIGURED = ShakeReport("flight.toml", 0.01)


@pytest.fixture(scope="module")
def shaken():
    return Hands(seed=5).found()


def test_the_lines_round_trip(shaken):
    reported = tomllib.loads("\n".join(CONFIGURED.toml_lines(shaken)))
    mount = reported["camera"]["mount"]
    angles = (radians(mount[f"{axis}_deg"]) for axis in ("roll", "pitch", "yaw"))
    assert np.allclose(body_from_camera_from_euler(*angles), shaken.body_from_camera, atol=1e-4)
    assert reported["camera"]["time_offset_s"] == pytest.approx(0.01 + shaken.delay.value, abs=6e-5)
    assert reported["uncertainty"]["time_offset_sigma_s"] >= shaken.delay.sigma
    assert radians(reported["uncertainty"]["mount_bias_deg"]) >= max(known.sigma for known in shaken.mount)
    assert is_usable(shaken)


def test_near_the_vertical_it_is_said_why_roll_and_yaw_are_large(shaken):
    """A mount that is off by a degree is reported as roll 30, yaw -28."""
    assert any("what counts is their sum" in line for line in CONFIGURED.toml_lines(shaken))
    forward = Hands(seed=5, configured=FORWARD_DOWN).found()
    assert not any("#" in line for line in CONFIGURED.toml_lines(forward))


def test_people_read_it_all(shaken):
    said = "\n".join(CONFIGURED.text(shaken))
    assert "delay of the camera: 4" in said
    assert "camera looks down, image top toward the nose" in said
    assert "cannot be separated from it" in said
    assert "rates come 11." in said or "rates come 10." in said
    for line in CONFIGURED.toml_lines(shaken):
        assert line in said.splitlines()


def test_its_json_has_the_keys_that_others_read(shaken):
    hold("shake", keys([CONFIGURED.json_object(shaken, ok=True)], "shake"))


def test_a_wrong_sign_offers_no_lines_and_its_name():
    shaken = Hands(seed=5, reported_signs=(-1, 1, 1)).found()
    assert CONFIGURED.toml_lines(shaken) == []
    assert "1. roll reversed" in list(CONFIGURED.text(shaken))
    assert not is_usable(shaken)


def test_what_was_not_shown_has_no_lines():
    shaken = Hands(seed=5, turn_deg=0.0).found()
    reported = tomllib.loads("\n".join(CONFIGURED.toml_lines(shaken)))
    assert set(reported) == {"camera", "uncertainty"}
    assert set(reported["camera"]) == {"time_offset_s"}
    assert set(reported["uncertainty"]) == {"time_offset_sigma_s"}
    assert not is_usable(shaken)
