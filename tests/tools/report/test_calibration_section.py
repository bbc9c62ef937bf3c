"""Calibration finding its values: the curve, its band, and the truth where it is known."""

import pytest
from report_lines import Markup, approach, calibration, header, points, summary

from fwav_companion.tools.report import (
    CALIBRATED,
    PLAIN,
    PlantedErrors,
    ReplayedLines,
    calibration_section,
    flight_data,
)

TRUE = PlantedErrors(0.035, (0.5, -1.0, 2.0))
LINES = [
    calibration(0.0, 0.0, 0.05, [0.0, 0.0, 0.0], 1.0),
    calibration(1.0, 0.030, 0.01, [0.3, -0.8, 1.1], 0.05),
    calibration(2.0, 0.035, 0.001, [0.5, -1.0, 2.0], 0.04),
]


def flight_with(lines, **other):
    return flight_data([header(), *approach([1.0, 1.0, 1.0]), *lines, summary()], title="", variant=CALIBRATED, **other)


def test_a_curve_that_ends_at_the_truth_meets_its_line():
    page = Markup(calibration_section(flight_with(LINES, planted=TRUE)))
    truths, curves = page.of("planted"), page.of("variant variant-calibrated")
    assert len(truths) == len(curves) == 4
    for truth, curve in zip(truths, curves, strict=True):
        assert truth["y1"] == truth["y2"]
        assert points(curve)[-1][1] == pytest.approx(float(truth["y1"]), abs=0.02)
        assert abs(points(curve)[0][1] - float(truth["y1"])) > 20.0


def test_the_final_numbers_have_their_truth():
    text = Markup(calibration_section(flight_with(LINES, planted=TRUE))).text
    assert "35.00 ms ± 1.96 ms (95 %). In truth 35.00 ms." in text
    assert "-1.00° ± 0.08° (95 %). In truth -1.00°." in text
    assert "sigma" not in text


def test_the_band_is_the_95_percent_interval():
    page = Markup(calibration_section(flight_with(LINES, planted=TRUE)))
    band, curve = points(page.of("claim")[1]), points(page.of("variant variant-calibrated")[1])
    upper, lower = band[1], band[-2]  # at the second of three times
    assert upper[0] == lower[0] == curve[1][0]
    assert (upper[1] + lower[1]) / 2 == pytest.approx(curve[1][1], abs=0.02)
    per_degree = (curve[1][1] - curve[2][1]) / 0.2
    assert lower[1] - upper[1] == pytest.approx(2 * 1.96 * 0.05 * per_degree, abs=0.05)


def test_without_a_truth_there_is_no_line_of_it():
    page = Markup(calibration_section(flight_with(LINES)))
    assert page.of("planted") == []
    assert "In truth" not in page.text
    assert "the truth" not in page.text


@pytest.mark.parametrize("lines", [[], LINES[:1]])
def test_what_did_not_calibrate_has_no_such_section(lines):
    assert calibration_section(flight_with(lines, planted=TRUE)) == ""


def test_calibration_of_another_variant_is_named_as_such():
    others = [ReplayedLines(CALIBRATED.name, "calibrated", [*approach([1.0]), *LINES])]
    flight = flight_data([header(), *approach([1.0]), summary()], title="", variant=PLAIN, others=others)
    text = Markup(calibration_section(flight)).text
    assert "The tracker with self-calibration found these values; the estimates above do not use them." in text
    assert "35.00 ms" in text


def test_a_calibration_that_never_moved_is_drawn_too():
    still = [calibration(at_s, 0.0, 0.0, [0.0, 0.0, 0.0], 0.0) for at_s in (0.0, 1.0)]
    html = calibration_section(flight_with(still))
    assert "nan" not in html
    assert len(Markup(html).of("variant variant-calibrated")) == 4
