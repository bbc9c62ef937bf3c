"""The paper's experiment against the numbers that an independent recomputation gave, and against the localizer."""

import json
import sys

import numpy as np
import pytest
from frozen import hold, keys

from fwav_companion.cli.main import main
from fwav_companion.tools.paper.comparison import compare
from fwav_companion.tools.paper.experiment import BETA, HEIGHT_M, averaged, filtered, ground_points, target_pixel

# Medians of 2000 runs, variances with ddof = 0, recomputed elsewhere from the paper's equations:
# mean X, variance X, mean Y, variance Y.
RECOMPUTED = {
    "stated noise, unfiltered": (4.00, 0.045, 3.00, 0.027),
    "stated noise, filtered, start at 0 (the paper's)": (3.64, 0.634, 2.73, 0.357),
    "stated noise, filtered, start at the first sample": (4.00, 0.0034, 3.00, 0.0021),
    "detection noise 188 px (1 mm), unfiltered": (4.40, 16.3, 3.44, 14.9),
    "detection noise 200 px, unfiltered": (4.51, 20.1, 3.56, 18.6),
}
OUR_ROWS = ("mean_x", "var_x", "mean_y", "var_y")


@pytest.fixture(scope="module")
def comparison():
    return compare(seed=1)


@pytest.mark.parametrize(("name", "numbers"), RECOMPUTED.items())
def test_the_medians_are_those_of_another_computation(comparison, name, numbers):
    (row,) = [row for row in comparison.rows if row.name == name]
    for column, expected in zip(OUR_ROWS, numbers, strict=True):
        relative = 0.06 if column.startswith("var") else 0.02
        assert getattr(row, column).median == pytest.approx(expected, rel=relative), column


def test_each_number_shows_its_own_spread(comparison):
    for row in comparison.rows:
        for column in OUR_ROWS:
            quantity = getattr(row, column)
            assert quantity.low < quantity.median < quantity.high
            assert 0.0 < quantity.median_sigma < 0.05 * (quantity.high - quantity.low)


@pytest.mark.slow
@pytest.mark.parametrize(
    ("seeds", "low", "high"), [(8, 0.26, 1.93), pytest.param(30, 0.6, 1.4, marks=pytest.mark.slow)]
)
def test_a_median_scatters_from_seed_to_seed_as_it_says(seeds, low, high):
    """Of 8 seeds: the 99.9 % limits of a standard deviation."""
    rows = [compare(seed, runs=100).rows[5] for seed in range(20, 20 + seeds)]
    for column in OUR_ROWS:
        reported = np.mean([getattr(row, column).median_sigma for row in rows])
        assert low * reported < np.std([getattr(row, column).median for row in rows], ddof=1) < high * reported


def test_the_filters_theory(comparison):
    assert comparison.variance_ratio_theory == pytest.approx(1.0 / 15.0)
    assert comparison.variance_ratio == pytest.approx(1.0 / 15.0, rel=0.03)
    assert comparison.start_ratio == pytest.approx(0.911, abs=0.001)


def test_flapping_costs_what_the_table_of_ages_says(comparison):
    """Latest sample at 50 Hz 0.40 m and at 10 Hz 0.77 m RMS an axis along the flight are of this size."""
    assert 0.1 < comparison.rms_by_source_m["flapping, attitude up to 20 ms old"][0] < 0.5
    assert 0.5 < comparison.rms_by_source_m["flapping, attitude up to 100 ms old"][0] < 1.5


def test_without_noise_the_target_is_found_at_the_papers_own_pixel():
    assert target_pixel() == pytest.approx((147.17133518542525, 423.6253330173481), abs=1e-9)
    found = ground_points(np.array([target_pixel()]), np.array([BETA]), np.array([HEIGHT_M]))
    assert found[0] == pytest.approx((4.0, 3.0), abs=1e-9)


def test_above_the_horizon_there_is_no_point():
    found = ground_points(np.array([[320.0, 240.0]] * 2), np.radians([90.0, 120.0]), np.array([10.0, 10.0]))
    assert np.isnan(found[1]).all()
    assert not (np.abs(found[0]) < 1e6).all()


def test_the_filter_is_the_one_the_paper_writes():
    samples = np.array([[[8.0, 0.0], [0.0, 8.0], [np.nan, np.nan], [16.0, 16.0]]])
    u = filtered(samples, 0.0)[0]
    assert u.tolist() == [[0.0, 0.0], [1.0, 0.0], [0.875, 1.0], [0.875, 1.0]]
    assert averaged(samples)[0].tolist() == [[8.0, 0.0], [4.0, 4.0], [4.0, 4.0], [8.0, 8.0]]


def test_the_command_prints_the_table_draws_four_figures_and_ends_with_json(tmp_path, capsys):
    assert main(["paper", "--out", str(tmp_path / "figures"), "--seed", "3", "--json"]) == 0

    text = capsys.readouterr().out
    reported = json.loads(text.splitlines()[-1])
    assert reported["seed"] == 3
    assert len(reported["rows"]) == 9
    hold("paper", keys([reported], "paper", tables={"paper.table_i", "paper.rms_by_source_m"}))
    assert "Table I, unfiltered" in text
    assert sorted(p.name for p in (tmp_path / "figures").iterdir()) == [
        "error-sources.png",
        "pitch.png",
        "x.png",
        "y.png",
    ]


def test_without_matplotlib_the_numbers_come_and_one_line_names_what_the_figures_need(tmp_path, capsys, monkeypatch):
    monkeypatch.setitem(sys.modules, "matplotlib", None)
    assert main(["paper", "--out", str(tmp_path), "--json"]) == 2

    reported = capsys.readouterr()
    assert json.loads(reported.out.splitlines()[-1])["seed"] == 1
    (line,) = reported.err.splitlines()
    assert "pip install '.[demo]'" in line


@pytest.mark.parametrize("seed", ["-1", "x", "1.5"])
def test_a_wrong_seed_is_a_wrong_usage(seed, capsys):
    assert main(["paper", "--seed", seed]) == 2
    assert seed in capsys.readouterr().err


def test_a_folder_that_cannot_be_written_is_a_users_mistake(tmp_path, capsys):
    (tmp_path / "file").write_text("")
    assert main(["paper", "--out", str(tmp_path / "file" / "below")]) == 2
    assert "folder" in capsys.readouterr().err


def test_the_same_seed_gives_the_same_numbers():
    assert compare(5, runs=50) == compare(5, runs=50)
    assert compare(5, runs=50) != compare(6, runs=50)
