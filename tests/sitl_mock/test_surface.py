"""The mock's surface: targets stand on it, it hides them, and what it draws is the seed's."""

from math import exp

import pytest

from sitl_mock import FrameTruth, Options, TargetOptions, scenario, simulate
from sitl_mock.surface import Surface

BARE = Options().but({"surface.tree_at": ((0.0, 0.0, 12.0),), "flight.centre": (100.0, 50.0)})


def test_a_tree_is_a_bell_on_level_ground():
    surface = Surface(BARE)
    assert surface.height_m(100.0, 50.0) == pytest.approx(12.0)
    assert surface.height_m(102.0, 50.0) == pytest.approx(12.0 * exp(-0.5))
    assert surface.height_m(100.0, 60.0) == 0.0
    assert Surface(Options()).is_level
    assert Surface(Options()).height_m(5.0, 5.0) == 0.0


def test_home_is_at_height_zero_on_hills():
    surface = Surface(Options().but({"surface.relief_m": 3.0}))
    assert surface.height_m(*Options().autopilot.home_m) == 0.0
    assert surface.height_m(70.0, 0.0) > 1.0


def test_a_tree_hides_what_is_behind_it_and_not_what_is_before_it():
    surface = Surface(BARE)
    eye = (70.0, 50.0, -20.0)
    assert surface.hides((108.0, 50.0, 0.0), eye)
    assert not surface.hides((90.0, 50.0, 0.0), eye)
    assert not surface.hides((120.0, 50.0, 0.0), (118.0, 50.0, -60.0)), "from above it is seen"
    assert not surface.hides((100.0, 50.0, -12.0), eye), "the tree's own top is seen"


def test_houses_have_flat_roofs_and_the_seed_places_them():
    options = Options().but({"surface.houses": 40, "surface.half_size_m": 60.0})
    first, again, other = Surface(options), Surface(options), Surface(options.but({"seed": 2}))
    places = [(40.0 + n, -25.0 + e) for n in range(-60, 60, 3) for e in range(-60, 60, 3)]
    heights = [first.height_m(*place) for place in places]
    assert {height % 6.0 for height in heights} == {0.0}
    assert 0.1 < sum(height > 0.0 for height in heights) / len(heights) < 0.4
    assert heights == [again.height_m(*place) for place in places]
    assert heights != [other.height_m(*place) for place in places]


def test_targets_stand_on_the_surface_in_the_open():
    options = scenario("village").but({"targets": (TargetOptions(label="car"), TargetOptions(label="roof", up=2.0))})
    mock = simulate(options)
    car, roof = (target.at(0.0) for target in mock.scene)
    assert car[2] == -mock.surface.height_m(car[0], car[1])
    assert roof[2] == car[2] - 2.0


def test_hidden_targets_are_not_detected():
    """The same flight round one target, with and without a tree beside it."""
    seen = []
    only = {"targets": (TargetOptions(label="car"),), "surface.trees": 0, "surface.houses": 0, "camera.fps": 1.0}
    for trees in (((-4.0, 0.0, 9.0),), ()):
        mock = simulate(scenario("village").but({"camera.missed": 0.0, "surface.tree_at": trees, **only}))
        seen.append(sum(len(what.visible) for _, what in mock if isinstance(what, FrameTruth)))
    assert 0.3 * seen[1] < seen[0] < 0.97 * seen[1]


def test_the_rangefinder_measures_to_the_surface():
    options = Options().but(
        {"surface.tree_at": ((0.0, 0.0, 6.0),), "flight.pattern": "hover", "flight.pitch_deg": 0.0,
         "flight.wander_m": 0.0, "flight.wander_deg": 0.0, "flight.flapping_pitch_deg": 0.0, "flight.height_m": 20.0}
    )  # fmt: skip
    assert simulate(options).vehicle.belief.range_m(5.0) == pytest.approx(14.0, abs=0.3)
    assert simulate(options.but({"surface.tree_at": ()})).vehicle.belief.range_m(5.0) == pytest.approx(20.0, abs=0.3)
