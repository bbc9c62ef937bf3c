"""One recording in several variants: charts and tables have the numbers of the lines."""

from itertools import pairwise

import pytest
from report_lines import Markup, approach, header, points, summary

from fwav_companion.config import parse
from fwav_companion.recording.truth import TruthPoint
from fwav_companion.tools.report import (
    CALIBRATED,
    PAPER,
    PLAIN,
    ReplayedLines,
    flight_data,
    variant_of,
    variants_section,
)
from fwav_companion.tools.report.drawing import LogAxes, tick_length

TRUTH = [TruthPoint("mark", None, (100.0, -50.0, 0.0), None)]
ENDS_M = {"paper": 1.0, "plain": 0.1, "calibrated": 0.01}


def drawn(truth=TRUTH, paper=(1.0, 1.0, ENDS_M["paper"]), label="mark"):
    others = [
        ReplayedLines(CALIBRATED.name, "calibrated", approach([1.0, 0.01, ENDS_M["calibrated"]], 0.02, label=label)),
        ReplayedLines(PAPER.name, "paper", approach(paper, 0.9, label=label)),
    ]
    ours = approach([1.0, 0.1, ENDS_M["plain"]], 0.3, label=label)
    return variants_section(
        flight_data([header(), *ours, summary()], title="", truth=truth, others=others, variant=PLAIN)
    )


def test_each_variant_is_a_line_that_ends_at_its_error():
    page = Markup(drawn())
    ends = {}
    for kind in ENDS_M:
        (solid,), (dashed,) = page.of(f"variant variant-{kind}"), page.of(f"claimed variant-{kind}")
        assert len(points(solid)) == len(points(dashed)) == 3
        ends[kind] = points(solid)[-1][1]
    # A tenth of the error is one rung lower; all rungs have the same height.
    rung = ends["plain"] - ends["paper"]
    assert rung > 30.0
    assert ends["calibrated"] - ends["plain"] == pytest.approx(rung, abs=0.02)


def test_the_table_shows_claims_and_errors_the_simplest_first():
    text = Markup(drawn()).text
    row = [f"{variant.name}{sigma_m * 5.991464547**0.5:.{digits}f} m" for variant, sigma_m, digits in
           ((PAPER, 0.9, 2), (PLAIN, 0.3, 2), (CALIBRATED, 0.02, 3))]  # fmt: skip
    at = [text.index(f"{start}{error}") for start, error in zip(row, ("1.00 m", "0.10 m", "0.010 m"), strict=True)]
    assert at == sorted(at)
    assert f"{CALIBRATED.name} is 1.0 cm from the truth, {PAPER.name} 1.00 m" in text


def test_an_error_beyond_its_claim_is_marked():
    page = Markup(drawn(paper=(1.0, 1.0, 9.0)))
    assert len(page.of("off")) == 1
    assert len(page.of("good")) == 2


def test_without_a_truth_they_are_compared_with_one_another():
    page = Markup(drawn(truth=()))
    assert "distance to ours" in page.text
    assert "true error" not in page.text
    assert "0.90 m" in page.text  # from 0.1 to 1.0 m north
    assert "0.090 m" in page.text
    assert len(page.of("variant variant-paper")) == 1
    assert page.of("claimed variant-paper") == []


def test_a_variant_that_never_found_it_says_so():
    page = Markup(drawn(paper=()))
    assert f"{PAPER.name}not found" in page.text
    assert page.of("variant variant-paper") == []


def test_one_frame_is_a_dot():
    others = [ReplayedLines(PAPER.name, "paper", approach([0.5]))]
    page = Markup(
        variants_section(flight_data([header(), *approach([0.2]), summary()], title="", truth=TRUTH, others=others))
    )
    assert [tag for tag, each in page.elements if each.get("class") == "variant variant-paper"] == ["circle"]


def test_an_exact_answer_stays_on_the_paper():
    others = [ReplayedLines(PAPER.name, "paper", approach([0.0, 0.0]))]
    html = variants_section(
        flight_data([header(), *approach([0.0, 0.0], 0.0), summary()], title="", truth=TRUTH, others=others)
    )
    assert "nan" not in html
    assert "inf" not in html.replace("information", "")
    Markup(html)


def test_one_variant_alone_is_no_comparison():
    assert variants_section(flight_data([header(), *approach([1.0]), summary()], title="", truth=TRUTH)) == ""
    assert variants_section(flight_data([header(), summary()], title="")) == ""


def test_what_a_label_says_is_text():
    evil = "<b>&\"'</b>"
    html = drawn(truth=(), label=evil)
    assert "<b>" not in html
    assert evil in Markup(html).text


@pytest.mark.parametrize(
    ("settings", "kind"),
    [
        ([], "plain"),
        (["tracking.self_calibration=true"], "calibrated"),
        (["tracking.filter=lowpass", "tracking.alpha_rate_hz=0"], "paper"),
        (["tracking.filter=lowpass"], "own"),
        (["tracking.filter=mine:Filter"], "own"),
    ],
)
def test_a_configuration_is_one_of_the_variants(settings, kind):
    config = parse("", "flight.toml", ["camera.calibration=camera.yaml", *settings])
    variant = variant_of(config)
    assert variant.kind == kind
    for other in (PAPER, PLAIN, CALIBRATED):
        assert variant_of(other.applied_to(config)) == other
        assert other.applied_to(config).tracking.motion == config.tracking.motion


def test_decades_are_equally_high_and_nothing_leaves_them():
    frame = LogAxes((0.0, 1.0), (0.01, 10.0), (100.0, 100.0))
    ys = [frame.at(0.0, value)[1] for value in (0.01, 0.1, 1.0, 10.0)]
    steps = [before - after for before, after in pairwise(ys)]
    assert steps == pytest.approx([steps[0]] * 3)
    assert frame.at(0.0, 0.0)[1] == ys[0]
    assert frame.at(0.0, 1e9)[1] == ys[-1]


@pytest.mark.parametrize(
    ("metres", "expected"), [(0.001, "1 mm"), (0.01, "1 cm"), (0.1, "10 cm"), (1.0, "1 m"), (10.0, "10 m")]
)
def test_a_tick_has_the_unit_that_a_person_would_use(metres, expected):
    assert tick_length(metres) == expected


@pytest.mark.parametrize(("top_m", "expected"), [(9.0, ["1 m", "2 m", "5 m"]), (90.0, ["1 m", "10 m"])])
def test_a_short_axis_has_more_numbers_on_it(top_m, expected):
    axes = LogAxes((0.0, 1.0), (1.0, top_m), (100.0, 100.0)).elements("x", "y")
    assert [each for each in Markup("".join(axes)).texts if each.endswith(" m")] == expected
