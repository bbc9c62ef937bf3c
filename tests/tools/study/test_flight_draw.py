"""One flight drawn from the priors: repeatable, a stream for each cause, and truth apart from claim."""

import msgspec
import numpy as np
import pytest
from study_plans import fly, make_plan

from fwav_companion.camera import BrownConrady
from fwav_companion.replay import read_telemetry
from fwav_companion.tools.study.causes import NOISES
from fwav_companion.tools.study.flight_draw import CONFIGURED, PAPER_FILTER, TWICE, WITHOUT, draw_flight
from fwav_companion.tools.study.keys import parse_setting, parse_variation
from fwav_companion.tools.study.paper_preset import paper_plan
from fwav_companion.tools.study.study_plan import PATTERNS, radial_lens
from sitl_mock.arguments import with_settings
from sitl_mock.draws import draw
from sitl_mock.scenarios import scenario


def biases(drawn):
    """What the mock draws for a flight, degrees, metres, seconds."""
    return draw(with_settings(scenario("default"), drawn.request["set"]))


def test_the_same_index_is_the_same_flight_and_another_is_another():
    plan = make_plan()
    first, again, other = draw_flight(plan, 3), draw_flight(plan, 3), draw_flight(plan, 4)
    assert first.request == again.request
    assert first.flown != other.flown
    assert biases(first) != biases(other)
    assert draw_flight(make_plan(flights=1000), 3).request == first.request


def test_twice_the_sigmas_are_exactly_twice_the_errors_with_the_claim_unchanged():
    plan = make_plan()
    own, twice = draw_flight(plan, 0), draw_flight(plan, 0, TWICE)
    ours, theirs = biases(own), biases(twice)
    assert theirs.heading_deg == pytest.approx(2.0 * ours.heading_deg)
    assert theirs.mount_deg == pytest.approx([2.0 * angle for angle in ours.mount_deg])
    assert theirs.position_sigma_m == 2.0 * ours.position_sigma_m
    assert own.claim == twice.claim


def test_without_a_cause_all_other_errors_stay():
    plan = make_plan()
    ours, theirs = biases(draw_flight(plan, 0)), biases(draw_flight(plan, 0, "without_mount"))
    assert theirs.mount_deg == (0.0, 0.0, 0.0)
    assert (theirs.heading_deg, theirs.time_offset_s, theirs.readout_s) == (
        ours.heading_deg, ours.time_offset_s, ours.readout_s,
    )  # fmt: skip
    assert draw_flight(plan, 0, "without_mount").claim.uncertainty.mount_bias_deg == 0.0


def test_a_camera_at_a_fixed_height_flies_there_and_errs_by_its_bias():
    """The error of 300 drawn heights has the configured sigma; 99.9 % bounds of a sample's are 0.87 and 1.14."""
    config = make_plan().config.replace('model = "home"', 'model = "fixed"').replace("height_m = 1.2", "height_m = 8.0")
    plan = make_plan(config=config)
    draws = [draw_flight(plan, index) for index in range(300)]
    assert {(each.flown["height_m"], each.claim.ground.height_m) for each in draws} == {(8.0, 8.0)}
    ups = np.array([each.request["set"]["targets"][0]["up"] for each in draws])
    assert 0.87 < np.std(ups) / plan.truth().uncertainty.height_bias_m < 1.14
    twice = draw_flight(plan, 0, TWICE).request["set"]["targets"][0]["up"]
    assert twice == pytest.approx(2.0 * ups[0])
    assert draws[0].request["set"]["flight.wander_m"] == 0.0


def test_the_papers_filter_flies_the_same_flight():
    plan = paper_plan(2, 1, (), ())
    own, by_paper = draw_flight(plan, 1), draw_flight(plan, 1, PAPER_FILTER)
    assert own.request == by_paper.request
    assert (own.claim.tracking.filter, by_paper.claim.tracking.filter) == ("kalman", "lowpass")


@pytest.mark.parametrize("name", NOISES)
def test_without_one_of_the_papers_noises_the_others_stay(name):
    plan = paper_plan(2, 1, (), ())
    own, without = draw_flight(plan, 1), draw_flight(plan, 1, f"{WITHOUT}{name}")
    (key,) = NOISES[name].keys
    changed = {each for each, value in own.request["set"].items() if without.request["set"][each] != value}
    assert changed == {f"priors.{key}"}
    assert getattr(without.claim.uncertainty, key) == without.request["set"][f"priors.{key}"] <= 0.05


def test_without_the_noise_of_the_attitude_positions_and_heights_are_the_same():
    """Messages that the pipeline needs no attitude for are equal, byte for byte."""
    plan = msgspec.structs.replace(paper_plan(2, 1, (), ()), seconds=3.0)
    own, without = (
        read_telemetry(fly(draw_flight(plan, 1, arm).request).telemetry).messages
        for arm in (CONFIGURED, f"{WITHOUT}attitude_noise")
    )
    positions = [
        [(m.fields.lat, m.fields.lon, m.fields.relative_alt) for _, m in messages if m.name == "GLOBAL_POSITION_INT"]
        for messages in (own, without)
    ]
    assert len(positions[0]) > 20
    assert positions[0] == positions[1]


def test_without_the_doubt_of_the_readout_the_replay_knows_it():
    plan = make_plan()
    drawn = draw_flight(plan, 0, "without_readout")
    assert drawn.claim.camera.readout_s == drawn.request["set"]["biases.readout_s"]
    assert biases(drawn) == biases(draw_flight(plan, 0))


def test_truth_and_claim_are_set_apart():
    settings = (parse_setting("truth.uncertainty.heading_bias_deg=8.0"), parse_setting("claim.rates.position=5.0"))
    drawn = draw_flight(make_plan(settings=settings), 0)
    assert drawn.request["set"]["priors.heading_bias_deg"] == 8.0
    assert drawn.claim.uncertainty.heading_bias_deg == 2.0
    assert drawn.request["rates_hz"]["GLOBAL_POSITION_INT"] == 5.0


def test_self_calibration_is_on_unless_it_is_set():
    assert draw_flight(make_plan(), 0).claim.tracking.self_calibration
    off = make_plan(settings=(parse_setting("tracking.self_calibration=false"),))
    assert not draw_flight(off, 0).claim.tracking.self_calibration


def test_a_varied_key_has_every_value_of_its_range_and_its_choices():
    plan = make_plan(variations=(parse_variation("flight.height_m=5:40"), parse_variation("rates.attitude=50,100")))
    drawn = [draw_flight(plan, index) for index in range(200)]
    heights = [each.flown["height_m"] for each in drawn]
    assert min(heights) < 8.0
    assert max(heights) > 37.0
    assert abs(np.mean(heights) - 22.5) < 3.3 * 35.0 / np.sqrt(12.0 * 200.0)
    assert {each.claim.rates.attitude for each in drawn} == {50.0, 100.0}


@pytest.mark.parametrize("pattern", PATTERNS)
def test_the_target_is_in_view_in_every_pattern(pattern):
    """Straight passes are centred on the target, a survey crosses it."""
    views = [fly(draw_flight(make_plan(pattern=pattern, seconds=12.0), index).request).in_view for index in range(2)]
    assert max(views) >= 20


def test_a_pinhole_lens_counts_by_its_radially_symmetric_part():
    lens = BrownConrady((500.0, 505.0), (322.0, 241.0), (-0.05, 0.01, 0.0005, -0.0004, 0.0), (640, 480))
    ours = radial_lens(lens)
    assert not ours.exact
    for point in ((0.1, 0.05, 1.0), (-0.4, 0.3, 1.0), (0.5, -0.4, 1.0)):
        assert ours.lens.pixel_from_camera_point(point) == pytest.approx(lens.pixel_from_camera_point(point), abs=0.5)


def test_a_plan_survives_its_way_to_a_worker():
    plan = make_plan(variations=(parse_variation("tracking.filter=kalman,lowpass"),))
    assert msgspec.json.decode(msgspec.json.encode(plan), type=type(plan)) == plan
    assert plan.digest == msgspec.structs.replace(plan, flights=7).digest
    assert plan.digest != msgspec.structs.replace(plan, seed=2).digest
    assert draw_flight(plan, 0).arm == CONFIGURED
