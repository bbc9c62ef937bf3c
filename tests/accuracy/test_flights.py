"""Every kind can be flown and replayed; a flight is the same whenever it is flown, and one is right to a decimetre."""

import pytest

from fwav_companion.config import parse
from tests.accuracy.flights import ESTIMATORS, fly, plan_of, recording_of, scored, seeds_of
from tests.accuracy.kinds import KINDS, NAMES


@pytest.mark.parametrize("name", NAMES)
def test_kind_has_a_configuration_for_every_estimator(name):
    plan = plan_of(name, 3)
    for settings in ESTIMATORS.values():
        parse(plan.text, "flight.toml", (*plan.settings, *settings))


def test_stated_sigmas_are_those_that_the_mock_draws_from():
    plan = plan_of("eight_drawn", 1)
    config = parse(plan.text, "flight.toml", plan.settings)
    assert config.uncertainty.time_offset_sigma_s == plan.options.priors.time_offset_sigma_s == 0.05
    assert config.uncertainty.position_bias_m == 0.0
    for name in ("orbit_1", "descent_jump"):
        plan = plan_of(name, 1)
        assert parse(plan.text, "flight.toml", plan.settings).uncertainty.position_bias_m == "auto"


def test_recording_is_the_same_bytes_for_the_same_seed_and_is_read_back(tmp_path, monkeypatch):
    plan = plan_of("slow_telemetry", 2)
    flown = recording_of(plan, tmp_path)
    assert fly(plan) == flown
    assert fly(plan_of("slow_telemetry", 3)).telemetry != flown.telemetry
    monkeypatch.setattr("tests.accuracy.flights.fly", lambda _: pytest.fail("flown twice"))
    assert recording_of(plan, tmp_path) == flown
    assert len(list(tmp_path.iterdir())) == 1


def test_seeds_of_a_date_are_its_own():
    assert seeds_of(3) == [1, 2, 3]
    drawn = seeds_of(24, "2026-11-26")
    assert len(set(drawn)) == 24
    assert seeds_of(8, "2026-11-26") == drawn[:8]
    assert not set(drawn) & set(seeds_of(24, "2026-11-27"))


def test_wrong_landmark_is_off_by_forty_centimetres():
    right, wrong = plan_of("landmark_3", 5).text, plan_of("landmark_wrong", 5).text
    latitudes = [[float(x.split()[2]) for x in text.splitlines() if x.startswith("lat")] for text in (right, wrong)]
    off = [(b - a) * 111_200.0 for a, b in zip(*latitudes, strict=True)]
    assert off == pytest.approx([0.32, 0.0, 0.0], abs=0.002)
    assert set(KINDS["landmark_wrong"].marks) == {"mark", "second", "third"}


def test_exact_eight_is_right_to_a_decimetre_and_calibrated(tmp_path):
    score = scored("eight_exact", 1, "second", tmp_path)
    assert (score.targets, score.missed, score.ghosts) == (1, 0, 0)
    assert score.relative.rms_m < 0.1
    assert 5.0 < score.calibrated_s < 40.0
    assert scored("eight_exact", 1, "plain", tmp_path).calibrated_s is None
