"""The true place of a clicked pixel projects back to that pixel, and moves through the pictures as the camera does."""

from __future__ import annotations

import json
from math import hypot

import pytest

from sitl_mock import Options, Simulation, spot
from sitl_mock.scenarios import DEMO

ARGUMENTS = ["--scenario=demo", "--seed=2", "--seconds=6"]


@pytest.fixture(scope="module")
def simulation():
    return Simulation(Options().but({**DEMO, "seed": 2, "seconds": 6.0}))


@pytest.mark.parametrize("pixel", [(320.0, 240.0), (100.5, 400.25), (500.0, 60.0)])
def test_the_ground_at_a_pixel_is_seen_there(simulation, pixel):
    row0_s = simulation.camera.row0_s(12)
    place = spot.ground_at(simulation.camera, pixel, row0_s)
    assert place is not None
    assert simulation.camera.pixel_of((*place, 0.0), row0_s) == pytest.approx(pixel, abs=1e-4)


def test_a_metre_on_the_ground_is_as_many_pixels_as_the_jacobian_says(simulation):
    row0_s = simulation.camera.row0_s(12)
    north, east = spot.ground_at(simulation.camera, (320.0, 240.0), row0_s)
    (a, b), (c, d) = spot.jacobian(simulation.camera, (north, east), row0_s)
    moved = simulation.camera.pixel_of((north + 0.05, east - 0.03, 0.0), row0_s)
    expected = (320.0 + 0.05 * a - 0.03 * b, 240.0 + 0.05 * c - 0.03 * d)
    assert hypot(moved[0] - expected[0], moved[1] - expected[1]) < 0.05


def test_the_command_reports_where_each_frame_shows_it(simulation, capsys):
    assert spot.main([*ARGUMENTS, "--frame", "12", "--pixel", "300", "200"]) == 0
    reported = json.loads(capsys.readouterr().out)
    sights = {each["frame"]: each for each in reported["sights"]}
    assert sights[12]["pixel"] == pytest.approx([300.0, 200.0], abs=1e-3)
    assert sights[12]["at_s"] == pytest.approx(simulation.camera.row0_s(12))
    assert 0.005 < sights[12]["metres_per_px"] < 0.1
    assert 0.0 < sights[12]["blur_px"] < 20.0
    assert abs(reported["lat"]) > 1.0


def test_a_pixel_above_the_horizon_shows_no_ground(capsys):
    assert spot.main([*ARGUMENTS, "--set=flight.pitch_deg=-60.0", "--frame", "12", "--pixel", "320", "5"]) == 1
    assert capsys.readouterr().out == ""
