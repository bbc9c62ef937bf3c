"""Settings over recorded flights: paired differences, their intervals, and tests that are corrected."""

import numpy as np
import pytest

from fwav_companion.tools.study.paired_settings import compared, holm, median_interval
from fwav_companion.tools.study.setting_record import SettingRecord
from fwav_companion.tools.study.settings_answer import lines, sentence, setting_names, settings_page


def season(changes, flights=20, seed=1):
    """Flights whose error changes by a chosen amount under each setting; they differ by metres among themselves."""
    rng = np.random.default_rng(seed)
    base = rng.uniform(0.5, 5.0, flights)
    records = [SettingRecord(flight=f"f{i:02}", setting=0, error_m=float(base[i]), nis=2.0) for i in range(flights)]
    for number, change in enumerate(changes, 1):
        moved = base + change + rng.normal(0.0, 0.05, flights)
        records += [
            SettingRecord(flight=f"f{i:02}", setting=number, error_m=float(moved[i]), nis=2.0) for i in range(flights)
        ]
    return records


def test_a_change_far_below_the_scatter_of_flights_is_seen_in_pairs():
    better, worse, same = compared(season([-0.2, 0.2, 0.0]), 3)[:3]
    assert (better.verdict, worse.verdict, same.verdict) == ("better", "worse", "no difference shown")
    assert better.change == pytest.approx(-0.2, abs=0.04)
    assert better.interval[0] < -0.2 < better.interval[1]
    assert (worse.worse, len(worse.got_worse)) == (20, 20)
    first = worse.got_worse[0]
    assert first.after - first.before == max(each.after - each.before for each in worse.got_worse)


def test_holms_correction():
    """0.01, 0.04, 0.03: 3 * 0.01; then 2 * 0.03; then at least that."""
    assert holm([0.01, 0.04, 0.03]) == pytest.approx([0.03, 0.06, 0.06])
    assert holm([0.9, 0.8]) == [1.0, 1.0]
    assert holm([]) == []


def test_the_sign_test_is_exact_and_leaves_ties_out():
    """6 of 6 worse: 2 / 64; with ties only, nothing is shown."""
    records = season([0.5], flights=6)
    (row, nis) = compared(records, 1)
    assert row.p == pytest.approx(2.0 / 64.0)
    assert (nis.better, nis.worse, nis.p, nis.verdict) == (0, 0, 1.0, "no difference shown")


def test_the_interval_covers_the_median_at_least_as_often_as_it_says():
    rng = np.random.default_rng(2)
    inside = sum(low <= 0.0 <= high for low, high in (median_interval(rng.normal(size=15).tolist())
                                                      for _ in range(1000)))  # fmt: skip
    assert inside >= 930
    assert median_interval([1.0] * 5) is None


def test_normalised_squares_are_better_nearer_to_two():
    records = [
        SettingRecord(flight=f"f{i}", setting=s, nis=n) for i in range(8) for s, n in ((0, 1.0), (1, 2.2), (2, 3.5))
    ]
    nearer, farther = compared(records, 2)
    assert (nearer.verdict, farther.verdict) == ("better", "worse")


def test_damaged_flights_are_left_out_and_named():
    records = [*season([-0.3]), SettingRecord(flight="bad", setting=0, damage="no telemetry <in> it")]
    names = setting_names([("tracking.alpha=0.2",)])
    comparisons = compared(records, 1)
    assert comparisons[0].pairs == 20
    page = settings_page(comparisons, names, records, "flights", version="1")
    assert "no telemetry &lt;in&gt; it" in page
    assert "tracking.alpha=0.2: better" in sentence(comparisons, names, 21)
    assert any("change -0.3" in line for line in lines(comparisons, names))
