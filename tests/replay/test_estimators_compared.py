"""One recording by the filter and by the smoother: every line and key keeps its meaning, unit and sign."""

from collections import Counter

import msgspec
import numpy as np
import pytest

from fwav_companion.config import parse
from fwav_companion.pipeline.pipeline_factory import own_components
from fwav_companion.recording.line_types import CalibrationLine, ClockEstimateLine, HeaderLine, SightingLine, TargetLine
from fwav_companion.recording.summary_types import SummaryLine
from fwav_companion.replay import read_recording, replay
from tests.accuracy.flights import plan_of, recording_of

PLANTED_S = 0.035
ADDED = {CalibrationLine: {"parameters"}, SummaryLine: {"final"}}
"""Keys that only the smoother writes, by type of line."""


@pytest.fixture(scope="module")
def lines(tmp_path_factory):
    """The lines of both, of a figure eight with a camera that is 35 ms late and crooked; by whether it smooths."""
    plan = plan_of("eight_late_and_crooked", 1)
    recorded = recording_of(plan, tmp_path_factory.mktemp("flights"))
    config = parse(plan.text, "flight.toml", (*plan.settings, "tracking.self_calibration=true"))
    read = read_recording(recorded.telemetry, recorded.detections, own_components(config), config.vehicle.system_id)
    return {
        smooths: list(replay(read, config, plan.calibration, sightings=True, smooths=smooths, limits=True))
        for smooths in (False, True)
    }


def of_type(lines, kind):
    return [line for line in lines if isinstance(line, kind)]


def test_both_write_the_same_types_with_the_same_keys(lines):
    for kind in {type(line) for line in lines[False]}:
        keys = [set().union(*map(msgspec.to_builtins, of_type(lines[smooths], kind))) for smooths in (False, True)]
        assert keys[1] - ADDED.get(kind, set()) == keys[0], kind
    counts = [Counter(type(line) for line in lines[smooths]) for smooths in (False, True)]
    for kind in (HeaderLine, ClockEstimateLine, CalibrationLine, SightingLine, SummaryLine):
        assert counts[0][kind] == counts[1][kind], kind


def test_sightings_with_their_budgets_do_not_depend_on_the_estimator(lines):
    assert of_type(lines[False], SightingLine) == of_type(lines[True], SightingLine)


def test_fixes_of_the_frames_are_the_same(lines):
    fixes = [
        {line.frame: line.fix for line in of_type(lines[smooths], TargetLine) if line.fix} for smooths in (False, True)
    ]
    both = fixes[0].keys() & fixes[1].keys()
    assert len(both) > 0.9 * len(fixes[0])
    assert all(fixes[0][frame] == fixes[1][frame] for frame in both)


def test_delay_and_mount_agree_in_sign_and_unit(lines):
    first, second = (of_type(lines[smooths], CalibrationLine)[-1] for smooths in (False, True))
    assert first.status == second.status == "calibrated"
    assert first.reason is second.reason is None
    for last in (first, second):
        assert last.time_offset_s == pytest.approx(PLANTED_S, abs=4.0 * last.time_offset_sigma_s)
    sigma = np.hypot(first.mount_sigma_deg, second.mount_sigma_deg)
    assert np.abs(np.subtract(first.mount_deg, second.mount_deg)).max() < 3.0 * sigma.max()
    turned = np.subtract(first.mount_deg, np.negative(second.mount_deg))
    assert np.abs(turned).max() > 5.0 * sigma.max()  # the other sign would not agree


def test_targets_agree_within_what_both_claim(lines):
    first, second = (of_type(lines[smooths], TargetLine)[-1] for smooths in (False, True))
    for of in (lambda line: line, lambda line: line.relative):
        off = np.array([of(first).north - of(second).north, of(first).east - of(second).east])
        claim = np.array(of(first).cov)[:2, :2] + np.array(of(second).cov)[:2, :2]
        assert off @ np.linalg.solve(claim, off) < 13.8
    assert first.down == pytest.approx(second.down, abs=1e-6)
    assert (first.vel, first.vel_cov) == (second.vel, second.vel_cov) == (None, None)


def test_limits_name_the_same_causes(lines):
    first, second = (lines[smooths][-1].limits for smooths in (False, True))
    assert first.keys() == second.keys()
    for track in first:
        assert first[track].keys() <= second[track].keys()
        assert all(0.0 <= share < 25.0 for share in second[track].values())
