"""Errors against the truth: drawn from what is claimed, their statistics must say so."""

import numpy as np
import pytest

from fwav_companion.recording.error_statistics import ErrorSample, error_statistics, wilson
from fwav_companion.recording.line_types import PlaceObject, TargetLine
from fwav_companion.recording.summary_types import LabelErrorObject
from fwav_companion.recording.truth import TruthPoint
from fwav_companion.recording.truth_errors import ErrorTally
from fwav_companion.types import TrackState

COV = ((4.0, 1.0, 0.0), (1.0, 2.0, 0.0), (0.0, 0.0, 1.0))


def point(label, north, east):
    return TruthPoint(label=label, place=None, ned=(north, east, 0.0), time_unix=None)


def line(time, track, north, east, *, state="confirmed", fix=None, label="pad", cov=COV):
    fixed = None if fix is None else PlaceObject(north=fix[0], east=fix[1], down=0.0, cov=cov)
    return TargetLine(
        time_unix=time, frame=None, track=track, label=label, state=TrackState(state), north=north, east=east, down=0.0,
        cov=cov, fix=fixed,
    )  # fmt: skip


def tally(points, lines):
    errors = ErrorTally(points)
    for each in lines:
        errors.add(each)
    return errors.summary()


def test_errors_drawn_from_the_claim_have_its_statistics():
    rng = np.random.default_rng(5)
    drawn = rng.multivariate_normal((0.0, 0.0), np.array(COV)[:2, :2], 4000)
    lines = [line(k, k, 0, 0, state="tentative", fix=(10 + n, -3 + e)) for k, (n, e) in enumerate(drawn)]
    summary = tally([point("pad", 10.0, -3.0)], lines)
    fixes = summary.fixes.overall
    distances = np.hypot(*drawn.T)
    assert fixes.samples == 4000
    assert fixes.ce50_m == pytest.approx(np.quantile(distances, 0.5), rel=0.01)
    assert fixes.ce90_m == pytest.approx(np.quantile(distances, 0.9), rel=0.01)
    assert fixes.rms_m == pytest.approx(np.sqrt(np.mean(distances**2)), rel=1e-9)
    assert fixes.nees == pytest.approx(2.0, abs=0.15)
    coverage = fixes.coverage95
    assert coverage.low < 0.95 < coverage.high
    assert coverage.high - coverage.low < 0.03
    assert summary.labels["pad"] == LabelErrorObject(state="fixed", final_m=None)


def test_a_claim_half_as_large_is_seen():
    rng = np.random.default_rng(6)
    drawn = rng.multivariate_normal((0.0, 0.0), np.array(COV)[:2, :2], 1000)
    half = tuple(tuple(c / 4.0 for c in row) for row in COV)
    lines = [line(k, k, 0, 0, state="tentative", fix=tuple(d), cov=half) for k, d in enumerate(drawn)]
    fixes = tally([point("pad", 0, 0)], lines).fixes
    assert fixes.overall.nees == pytest.approx(8.0, abs=1.0)
    assert fixes.overall.coverage95.high < 0.7


def test_one_constant_error_is_one_sample():
    """A bias through a flight: hundreds of samples show no more than a few."""
    rng = np.random.default_rng(7)
    steady = [ErrorSample(1.0, 1.0 + 0.3 * slow) for slow in np.cumsum(rng.normal(size=600)) / 25.0]
    fresh = [ErrorSample(1.0, value) for value in rng.chisquare(2, 600)]
    width = [(coverage := error_statistics([samples]).coverage95).high - coverage.low for samples in (steady, fresh)]
    assert width[0] > 0.2
    assert width[1] < 0.06


def test_wilson_interval_against_its_textbook_form():
    assert wilson(0.9, 10) == pytest.approx((0.5958, 0.9821), abs=1e-3)


def test_two_tracks_at_one_truth_are_one_and_a_ghost():
    lines = [each for t in range(10) for each in (line(t, 1, 0.1, 0.0), line(t, 2, 0.9, 0.0))]
    summary = tally([point("pad", 0.0, 0.0)], lines)
    assert summary.ghosts == 1
    assert (summary.targets[0].state, summary.targets[0].track) == ("found", 1)


def test_a_track_that_follows_another_is_no_ghost():
    lines = [*(line(t, 1, 0.1, 0) for t in range(5)), *(line(t, 2, 0.2, 0) for t in range(9, 12))]
    summary = tally([point("pad", 0, 0)], lines)
    assert summary.ghosts == 0
    assert summary.targets[0].final_m == pytest.approx(0.2)


def test_a_ghost_does_not_make_another_target_found():
    """Both tracks are at the first of two targets of one label; the second was never seen."""
    lines = [each for t in range(5) for each in (line(t, 1, 0.1, 0), line(t, 2, 0.4, 0))]
    summary = tally([point("pad", 0, 0), point("pad", 500, 0)], lines)
    assert [target.state for target in summary.targets] == ["found", "missed"]
    assert summary.ghosts == 1


def test_fixed_missed_and_outside_the_claim():
    lines = [
        *(line(t, 1, 0.0, 0.0, state="tentative", fix=(0.5, 0.0), label="fixed") for t in range(4)),
        *(line(t, 2, 9.0, 0.0, label="far") for t in range(4)),
        *(line(t, 3, 1.0, 0.0, label="near") for t in range(4)),
    ]
    summary = tally([point(label, 0, 0) for label in ("fixed", "far", "near", "missed")], lines)
    states = {target.label: target.state for target in summary.targets}
    assert states == {"fixed": "fixed", "far": "found", "near": "found", "missed": "missed"}
    assert {target.label: target.outside95 for target in summary.targets} == {
        "fixed": None, "far": True, "near": False, "missed": None,
    }  # fmt: skip
    assert summary.labels["missed"] == LabelErrorObject(state="missed", final_m=None)
