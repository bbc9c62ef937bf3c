"""Known errors in, known figures out: scores of made-up lines about a simulated flight, and flights paired."""

import msgspec
import numpy as np
import pytest
from scipy.stats import binom, chi2

from fwav_companion.recording.line_types import CalibrationLine, TargetLine
from sitl_mock import Options, Simulation, TargetOptions, scenario
from tests.accuracy.scores import CELLS, MOST_SQUARES, Errors, FlightScore, Tracks
from tests.accuracy.table import Run, comparison_table, interval_of_median, paired, run_table

SECONDS, FPS = 40.0, 10.0
SCENE = (
    TargetOptions(north=2.0, east=-1.0),
    TargetOptions(north=9.0, east=4.0),
    TargetOptions(label="mark", north=0.0, east=6.0),
    TargetOptions(label="person", north=-4.0, speed_m_s=1.5, leg_m=8.0),
)
SIGMA2 = [[0.25, 0.0, 0.0], [0.0, 0.25, 0.0], [0.0, 0.0, 0.1]]


@pytest.fixture
def mock():
    options = scenario("default", Options(seconds=SECONDS)).but({"targets": SCENE, "camera.fps": FPS})
    return Simulation(options)


def line(mock, at_s, index, relative=(0.0, 0.0), absolute=(0.0, 0.0), *, track=1, state="confirmed", cov=SIGMA2):
    """A target line with these errors."""
    at_s, relative, absolute = float(at_s), np.asarray(relative).tolist(), np.asarray(absolute).tolist()
    true, vehicle = mock.scene[index].at(at_s), mock.flight.at(at_s).position
    place = mock.world.place((true[0] + absolute[0], true[1] + absolute[1], true[2]))
    fields = {
        "type": "target", "time_unix": mock.options.start_unix_s + at_s, "frame": round(at_s * FPS), "track": track,
        "label": mock.scene[index].label, "state": state,
        "north": 0.0, "east": 0.0, "down": 0.0, "fix": None, "lat": place.lat, "lon": place.lon,
        "alt_amsl": place.alt_amsl, "cov": cov,
        "relative": {"north": true[0] - vehicle[0] + relative[0], "east": true[1] - vehicle[1] + relative[1],
                     "down": 0.0, "cov": cov},
    }  # fmt: skip
    return msgspec.convert(fields, TargetLine)


def score(mock, lines, in_view=(0,), first_seen_s=2.0, landmarks=("mark",)):
    tracks = Tracks(mock, landmarks)
    for each in lines:
        tracks.add(each)
    return tracks.score(in_view, first_seen_s, cpu_s=1.0, seed=1)


def test_errors_are_those_that_the_lines_were_given(mock):
    found = score(mock, [line(mock, t, 0, (0.3, -0.4), (1.2, 0.5)) for t in (20.0, 21.0, 30.0)])
    assert found.relative.rms_m == pytest.approx(0.5, abs=1e-6)
    assert found.relative.square == pytest.approx(1.0, abs=1e-5)
    assert found.absolute.rms_m == pytest.approx(1.3, abs=1e-6)
    assert found.absolute.square == pytest.approx(1.69 / 0.25, abs=1e-5)
    assert (found.relative.inside, found.absolute.inside) == (1.0, 0.0)
    assert (found.missed, found.ghosts, found.targets) == (0, 0, 1)


def test_errors_of_a_walker_are_measured_where_it_is_at_the_instant(mock):
    found = score(mock, [line(mock, t, 3, (0.0, 0.2)) for t in np.arange(15.0, 35.0)], in_view=(3,))
    assert found.relative.rms_m == pytest.approx(0.2, abs=1e-6)


def test_claims_are_as_good_as_drawn_errors(mock):
    rng = np.random.default_rng(3)
    cov = np.array([[0.09, 0.03], [0.03, 0.04]])
    claimed = [[0.09, 0.03, 0.0], [0.03, 0.04, 0.0], [0.0, 0.0, 1.0]]
    times = np.arange(12.0, 39.95, 0.1) + 0.03
    drawn = rng.multivariate_normal((0.0, 0.0), cov, len(times))
    found = score(mock, [line(mock, t, 0, e, 2.0 * e, cov=claimed) for t, e in zip(times, drawn, strict=True)])
    low, high = chi2.ppf([0.0005, 0.9995], 2 * len(times)) / len(times)
    assert low < found.relative.square < high
    assert 4.0 * low < found.absolute.square < 4.0 * high
    low, high = binom.ppf([0.0005, 0.9995], len(times), 0.95) / len(times)
    assert low < found.relative.inside < high
    assert found.absolute.inside < 0.6


def test_only_answers_after_thirty_percent_of_the_flight_count(mock):
    early = [line(mock, 10.4, 0, (5.0, 0.0)), line(mock, 20.0, 0, (9.0, 0.0), state="tentative")]
    assert score(mock, early).relative is None
    both = [*early, line(mock, 12.1, 0, (0.1, 0.0)), line(mock, 20.0, 0, (0.1, 0.0), state="coasting")]
    assert score(mock, both).relative.rms_m == pytest.approx(0.1, abs=1e-6)


def test_seconds_without_a_sight_count_as_much_as_others(mock):
    seen = [line(mock, t, 0, (0.1, 0.0)) for t in np.arange(12.0, 26.0, 0.1)]
    coasting = [line(mock, t, 0, (0.7, 0.0), state="coasting") for t in np.arange(26.0, 40.0)]
    found = score(mock, [*seen, *coasting])
    assert found.relative.rms_m == pytest.approx(0.5, rel=0.005)
    assert found.cells["0"] == pytest.approx([0.1] * 10 + [0.7] * 10, rel=1e-5)
    assert score(mock, coasting).cells["0"][:9] == [None] * 9


def test_a_claim_of_no_error_is_the_largest_square(mock):
    assert score(mock, [line(mock, 20.0, 0, (0.1, 0.0), cov=[[0.0] * 3] * 3)]).relative.square == MOST_SQUARES


def test_tracks_belong_to_the_target_nearest_at_their_end(mock):
    begin = [line(mock, 15.0, 0, track=1), line(mock, 15.0, 1, track=2)]
    end = [line(mock, 30.0, 1, (0.2, 0.0), track=1), line(mock, 30.0, 0, (0.0, 0.1), track=2)]
    found = score(mock, [*begin, *end], in_view=(0, 1))
    assert (found.missed, found.ghosts) == (0, 0)
    apart_m = np.hypot(7.0, 5.0)
    assert found.relative.rms_m == pytest.approx(np.sqrt((2 * apart_m**2 + 0.05) / 4), rel=1e-6)


def test_a_second_track_of_a_target_is_a_ghost_and_a_later_one_is_not(mock):
    first = [line(mock, t, 0, (0.1, 0.0), track=1) for t in (15.0, 20.0)]
    twin = [line(mock, t, 0, (2.0, 0.0), track=2) for t in (16.0, 21.0)]
    later = [line(mock, t, 0, (0.1, 0.0), track=3) for t in (25.0, 30.0)]
    found = score(mock, [*first, *twin, *later], in_view=(0, 1))
    assert (found.ghosts, found.missed, found.targets) == (1, 1, 2)
    assert found.relative.rms_m == pytest.approx(0.1, abs=1e-6)


def test_a_target_that_was_never_in_view_is_not_missed(mock):
    found = score(mock, [], in_view=(1,))
    assert (found.targets, found.missed, found.relative) == (1, 1, None)
    assert score(mock, [], in_view=()).missed == 0


def test_landmarks_are_not_scored(mock):
    found = score(mock, [line(mock, 20.0, 2, (3.0, 0.0))], in_view=(2,))
    assert (found.relative, found.ghosts, found.targets) == (None, 0, 0)


def test_time_to_calibrated_counts_from_first_sight(mock):
    reports = [(5.0, "time"), (14.5, "calibrated"), (20.0, "calibrated")]
    known = {"time_offset_s": 0.0, "time_offset_sigma_s": 0.01, "mount_deg": [0.0] * 3, "mount_sigma_deg": [1.0] * 3}
    lines = [
        msgspec.convert(
            {"type": "calibration", "time_unix": mock.options.start_unix_s + t, "status": s} | known, CalibrationLine
        )
        for t, s in reports
    ]
    assert score(mock, lines).calibrated_s == pytest.approx(12.5, abs=1e-5)
    assert score(mock, lines[:1]).calibrated_s is None


@pytest.mark.parametrize(("count", "ranks"), [(8, (1, 6)), (24, (8, 15)), (2, (0, 1)), (1, (0, 0))])
def test_interval_of_the_median_is_the_narrowest_that_is_sure_enough(count, ranks):
    values = [float(k) for k in reversed(range(count))]
    assert interval_of_median(values) == ranks
    if count > 2:
        assert 1.0 - 2.0 * binom.cdf(ranks[0], count, 0.5) >= 0.8
        assert 1.0 - 2.0 * binom.cdf(ranks[0] + 1, count, 0.5) < 0.8


def flight(seed, *errors):
    cells = {"0": [*errors, *[None] * (CELLS - len(errors))]}
    made = Errors(errors[0], 2.0, 1.0)
    return FlightScore(
        seed=seed, targets=1, missed=0, ghosts=0, relative=made, absolute=made, calibrated_s=None, cpu_s=1.0,
        cells=cells,
    )  # fmt: skip


def test_flights_are_paired_by_seed_at_the_instants_that_both_have():
    before = [flight(seed, 0.1 * seed, 5.0) for seed in (1, 2, 3)]
    after = [flight(seed, 0.1 * seed * ratio, None, 0.001) for seed, ratio in ((3, 0.5), (2, 1.2), (1, 2.0))]
    pair = paired(before, after)
    assert pair.flights == 3
    assert (pair.before_m, pair.after_m) == pytest.approx((0.2, 0.2))
    assert (pair.ratio, pair.low, pair.high) == pytest.approx((1.2, 0.5, 2.0))
    assert not pair.is_kept
    assert paired(before, [flight(9, 0.1)]) is None


def test_three_millimetres_more_are_kept_whatever_the_ratio():
    assert paired([flight(1, 0.004)], [flight(1, 0.0068)]).is_kept
    assert not paired([flight(1, 0.004)], [flight(1, 0.0072)]).is_kept


def test_tables_have_a_row_for_each_kind():
    runs = [
        Run(estimator=name, date="", commit="c", kinds={"hover_1": [flight(1, error), flight(2, 0.3)]})
        for name, error in (("one", 0.1), ("two", 0.05))
    ]
    assert "| hover 1 | 2 | 0.200 / 0.300 | 0.200 / 0.300 | 2 / 2 | 2 / 2 | 100 / 100 | 0 |" in run_table(runs[0])
    assert "| hover 1 | 2 | 0.200 | 0.175 | 0.75 | 0.50 to 1.00 | yes | 2, 2 |" in comparison_table(*runs)
