"""The answer of records whose errors and claims are chosen: what is concluded is what they are."""

import re

import numpy as np
import pytest
from study_plans import CONFIG, InlineWorkers, make_plan

from fwav_companion.__main__ import main
from fwav_companion.tools.study.answer_text import lines, sentence
from fwav_companion.tools.study.conclusions import answer_of
from fwav_companion.tools.study.distributions import (
    RESAMPLES,
    binned,
    bootstrap,
    paired_median,
    quantile_interval,
    share_of,
)
from fwav_companion.tools.study.flight_ranking import confirming_tasks, ranked_causes
from fwav_companion.tools.study.flight_record import FLOWN, POINTS, FlightRecord
from fwav_companion.tools.study.keys import parse_variation
from fwav_companion.tools.study.study_page import study_page

FLIGHTS = 200


def synthetic(rng, index, *, arm="configured", sigma=1.0, claimed=1.0, height=15.0, **values) -> FlightRecord:
    """A flight whose error is normal with ``sigma`` an axis and whose claim is ``claimed``."""
    north, east = rng.normal(0.0, sigma, 2)
    error = float(np.hypot(north, east))
    square = (error / claimed) ** 2
    chosen = {
        "state": "found", "no_answer": "", "error_m": error, "north_error_m": float(north),
        "east_error_m": float(east), "claimed95_m": 2.4477 * claimed, "normalised2": square,
        "errors_m": [None, *[error] * (POINTS - 1)], "claims95_m": [None, *[2.4477 * claimed] * (POINTS - 1)],
        "squares": [None, *[square] * (POINTS - 1)], "calibration": "calibrated", "calibrated_s": 20.0 + index % 5,
        "limits_m": {"position": sigma, "mount": 0.3, "heading": 0.1},
    } | values  # fmt: skip
    flown = dict.fromkeys(FLOWN, 1.0) | {"height_m": height}
    return FlightRecord(index=index, arm=arm, varied={"flight.height_m": height}, flown=flown, drawn={}, **chosen)


def study(claimed=1.0, **values):
    rng = np.random.default_rng(5)
    return [synthetic(rng, index, claimed=claimed, **values) for index in range(FLIGHTS)]


def test_quantiles_are_those_of_the_errors():
    records = study()
    errors = [record.error_m for record in records]
    found = answer_of(make_plan(), records).configured.errors
    for interval, share in ((found.half, 0.5), (found.nine_tenths, 0.9), (found.most, 0.95)):
        assert interval.value == pytest.approx(np.quantile(errors, share))
        assert interval.low < interval.value < interval.high


@pytest.mark.parametrize(("claimed", "verdict"), [(1.0, "holds"), (0.5, "too narrow"), (2.0, "too wide")])
def test_claims_are_judged_from_both_sides(claimed, verdict):
    """200 flights tell half and twice the claim from the right one."""
    claims = answer_of(make_plan(), study(claimed)).configured.claims
    by_level = {claim.level: claim for claim in claims}
    assert by_level[0.5].verdict == by_level[0.9].verdict == verdict
    assert sum(claim.n for claim in claims) == 4 * FLIGHTS


def test_bootstrap_of_many_flights_holds_a_part_of_the_resamples_at_a_time():
    """All resamples of 10 000 flights at once take 80 MB, and as much again for their indices."""
    sample, sizes = np.random.default_rng(3).normal(0.0, 1.0, 10_001), []

    def median(drawn):
        sizes.append(drawn.size)
        return np.median(drawn, axis=-1)

    found = bootstrap(sample, median)
    assert max(sizes) <= 1_000_000
    every = sample[np.random.default_rng(0).integers(0, len(sample), (RESAMPLES, len(sample)))]
    low, high = np.quantile(np.median(every, axis=-1), (0.025, 0.975))
    assert (found.value, found.low, found.high) == (np.median(sample), low, high)


def test_a_bootstrap_interval_covers_the_median_as_often_as_it_says():
    """Of 300 samples of 40; 99.9 % bounds of a share of 0.95 are 0.90 and 0.985, the bootstrap's own error included."""
    rng = np.random.default_rng(1)
    true = np.sqrt(2.0 * np.log(2.0))
    inside = 0
    for _ in range(300):
        interval = quantile_interval(np.hypot(*rng.normal(size=(2, 40))).tolist(), 0.5)
        inside += interval.low <= true <= interval.high
    assert 0.90 <= inside / 300 <= 0.99


def test_flights_without_an_answer_are_counted_by_their_reasons():
    records = study()
    lost = {"state": "missed", "error_m": None, "normalised2": None, "claimed95_m": None, "errors_m": [],
            "claims95_m": [], "squares": [], "limits_m": {}}  # fmt: skip
    rng = np.random.default_rng(1)
    records[:3] = [synthetic(rng, i, no_answer="never_in_view", **lost) for i in range(3)]
    records[3] = synthetic(rng, 3, no_answer="no_clock", **lost)
    answer = answer_of(make_plan(), records)
    assert answer.configured.no_answer == (("never_in_view", 3), ("no_clock", 1))
    assert answer.configured.answered == FLIGHTS - 4
    assert answer.over_time[-1].answered == (FLIGHTS - 4) / FLIGHTS


def test_causes_are_ranked_and_the_first_two_are_flown_again():
    records = study(sigma=0.2)
    assert [name for name, _ in ranked_causes(records)] == ["mount", "position", "heading"]
    tasks = confirming_tasks(make_plan(flights=FLIGHTS), records)
    assert {arm for _, arm in tasks} == {"without_mount", "without_position"}
    assert sorted({index for index, _ in tasks}) == list(range(40))


def test_paired_flights_show_what_a_cause_costs_where_its_median_alone_would_not():
    """Each flight is 0.1 m nearer without the mount; the errors themselves scatter by 1 m."""
    records = study()
    nearer = [
        synthetic(np.random.default_rng(2), r.index, arm="without_mount", error_m=max(0.0, r.error_m - 0.1))
        for r in records[:40]
    ]
    (cause,) = answer_of(make_plan(), [*records, *nearer]).confirmed
    assert (cause.name, cause.pairs) == ("mount", 40)
    assert cause.change_m.value == pytest.approx(-0.1, abs=0.02)
    assert cause.change_m.high < -0.05
    assert quantile_interval([r.error_m for r in records[:40]], 0.5).high - cause.with_m > 0.1


def test_a_curve_follows_the_varied_value():
    rng = np.random.default_rng(3)
    heights = rng.uniform(5.0, 40.0, FLIGHTS)
    records = [synthetic(rng, i, sigma=0.05 * height, height=float(height)) for i, height in enumerate(heights)]
    plan = make_plan(variations=(parse_variation("flight.height_m=5:40"),))
    (curve,) = answer_of(plan, records).curves
    values = [point.value for point in curve.points]
    assert values == sorted(values)
    assert sum(point.flights for point in curve.points) == FLIGHTS
    covered = [p.half.low <= 0.05 * p.value * np.sqrt(2.0 * np.log(2.0)) <= p.half.high for p in curve.points]
    assert sum(covered) >= len(covered) - 2


def test_bins_have_all_values_once_and_no_empty_one():
    rng = np.random.default_rng(1)
    for n in (1, 5, 17, 100):
        parts = binned(rng.normal(size=n).tolist())
        assert sorted(i for part in parts for i in part) == list(range(n))
        assert all(parts)


def test_a_share_of_none_is_unknown():
    assert (share_of(0, 0).low, share_of(0, 0).high) == (0.0, 1.0)
    assert paired_median([1.0, 2.0, 3.0], [0.5, 1.5, 2.5]).value == pytest.approx(-0.5)


def test_a_claim_beyond_99_9_percent_is_kept_with_its_flight():
    records = study()
    records[7] = synthetic(np.random.default_rng(1), 7, sigma=30.0)
    assert [record.index for record in answer_of(make_plan(), records).wrong] == [7]


def test_the_sentence_says_error_claims_and_what_limits():
    records = study()
    nearer = [synthetic(np.random.default_rng(9), i, arm="without_position", sigma=0.1) for i in range(40)]
    answer = answer_of(make_plan(), [*records, *nearer])
    said = sentence(make_plan(), answer)
    assert re.search(r"Half of the flights end within 1\.\d+ m .* 95 % within 2\.\d+ m \(200 of 200 orbits", said)
    assert "The claims hold" in said
    assert "What limits it is the vehicle's own position (GNSS)" in said
    text = "\n".join(lines(make_plan(), answer))
    assert "change first: RTK corrections" in text


def again(name, *, by_m, scatter_m=0.0):
    """The first 40 flights of :func:`study`, each nearer by ``by_m``, and scattered."""
    rng = np.random.default_rng(11)
    return [
        synthetic(rng, r.index, arm=f"without_{name}", error_m=max(0.0, r.error_m - by_m + rng.normal(0.0, scatter_m)))
        for r in study()[:40]
    ]


def advice(*flown):
    """What sentence, table and page advise to change, of causes by the filter's own terms."""
    records = [*study(), *(each for flights in flown for each in flights)]
    answer = answer_of(make_plan(), records)
    page = study_page(make_plan(), records, answer, InlineWorkers.environment)
    return (
        re.findall(r"What limits it is ([^:]*):", sentence(make_plan(), answer)),
        re.findall(r"change first: ([^,:]*)", "\n".join(lines(make_plan(), answer))),
        re.findall(r"To get there: ([^,:]*)", page),
    )


@pytest.mark.parametrize("by_m", [-0.05, 0.0, 0.05])
def test_advice_names_no_cause_without_which_the_same_flights_end_no_nearer(by_m):
    """The mount has the largest term of the filter; without it, half of the flights end within 4 % of the same."""
    assert advice(again("mount", by_m=by_m)) == ([], [], [])


def test_advice_names_the_cause_that_is_shown_though_another_seems_to_matter_more():
    """The mount's change is larger in the median, but lies within chance."""
    said = advice(again("mount", by_m=0.4, scatter_m=4.0), again("position", by_m=0.3))
    assert said == (["the vehicle's own position (GNSS)"], ["RTK corrections"], ["RTK corrections"])


def test_flights_that_flap_say_how_to_fly_a_copter_unless_the_flapping_is_chosen(capsys):
    hint = "--set flight.flap_deg=0 flight.pitch_deg=0"
    with pytest.raises(SystemExit):
        main(["study", "--help"])
    assert hint in capsys.readouterr().out.replace("\n", " ")
    records = study()
    for plan, flaps in (
        (make_plan(), True),
        (make_plan(settings=(("flight.flap_deg", "0"), ("flight.pitch_deg", "0"))), False),
    ):
        answer = answer_of(plan, records)
        assert (hint in "\n".join(lines(plan, answer))) is flaps
        assert (hint in study_page(plan, records, answer, InlineWorkers.environment)) is flaps


def test_self_calibration_that_the_study_switches_on_is_said_in_one_line():
    answer = answer_of(make_plan(), study())
    (on,) = [line for line in lines(make_plan(), answer) if "elf-calibration" in line]
    assert "fwav-companion.toml has it off" in on
    configured = make_plan(config=CONFIG.replace("self_calibration = false", "self_calibration = true"))
    assert "has it off" not in "".join(lines(configured, answer))
    off = make_plan(settings=(("tracking.self_calibration", "false"),))
    answer = answer_of(off, study(calibration="", calibrated_s=None))
    assert "Self-calibration is off." in list(lines(off, answer))


def test_flights_that_did_not_calibrate_say_what_they_lacked():
    hidden = "a position error of 1 m hides the mount: hover"
    records = study(calibration="time", calibrated_s=None, calibration_lacks=hidden)
    records[:20] = study()[:20]
    records[20] = synthetic(np.random.default_rng(1), 20, calibration="time", calibration_lacks="something rare")
    answer = answer_of(make_plan(), records)
    assert [(end.status, end.flights, end.lacks) for end in answer.calibration.ends] == [
        ("time", 180, hidden),
        ("calibrated", 20, ""),
    ]
    assert hidden in study_page(make_plan(), records, answer, InlineWorkers.environment)


def test_causes_that_are_zero_are_not_flown_again():
    records = study(limits_m={"position": 1e-7, "mount": 0.0})
    assert confirming_tasks(make_plan(flights=FLIGHTS), records) == []
    assert "No lasting error limits it" in sentence(make_plan(), answer_of(make_plan(), records))


def test_no_line_of_the_table_runs_into_the_next_column():
    records = [*study(sigma=12.0), *study(sigma=24.0, arm="twice")]
    table = list(lines(make_plan(), answer_of(make_plan(), records)))[:6]
    assert all("  " in line[40:] and len(line) <= 96 for line in table)
    assert not any(re.search(r"\)\d", line) for line in table)


def test_the_page_is_complete_in_itself():
    rng = np.random.default_rng(4)
    records = [synthetic(rng, i, height=5.0 + i / 10.0) for i in range(FLIGHTS)]
    records[3] = synthetic(rng, 3, sigma=30.0)
    records += [synthetic(rng, i, arm="twice", sigma=2.0) for i in range(40)]
    plan = make_plan(variations=(parse_variation("flight.height_m=5:40"),))
    answer = answer_of(plan, records)
    page = study_page(plan, records, answer, InlineWorkers.environment, commands=["study --only 3 <b>"])
    assert not re.search(r'(?:src|href)="', page)
    assert "study --only 3 &lt;b&gt;" in page
    for heading in ("What to change first", "Error of the target", "With other values of flight.height_m",
                    "Can the claims be trusted", "Claims that are wrong", "How this was computed"):  # fmt: skip
        assert f"<h2>{heading}</h2>" in page
    assert "nan" not in page.lower().replace("finance", "")


def test_a_study_without_any_answer_has_a_page_and_a_sentence():
    lost = {"state": "missed", "no_answer": "never_in_view", "error_m": None, "normalised2": None,
            "claimed95_m": None, "errors_m": [], "claims95_m": [], "squares": [], "limits_m": {}}  # fmt: skip
    records = [synthetic(np.random.default_rng(1), i, **lost) for i in range(4)]
    answer = answer_of(make_plan(), records)
    assert "None of the 4 flights found the target" in sentence(make_plan(), answer)
    assert "Flights without an answer" in study_page(make_plan(), records, answer, InlineWorkers.environment)
