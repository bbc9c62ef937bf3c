"""The first screen: where, how sure, what limited it; and the words for when there is no answer."""

import pytest
from report_lines import Markup, approach, calibration, header, summary, target

from fwav_companion.recording.truth import TruthPoint
from fwav_companion.tools.report import CALIBRATED, PLAIN, Replayed, page, tell
from fwav_companion.tools.report.answer import answer
from fwav_companion.tools.report.story import CAUSES

TRUTH = [TruthPoint("mark", None, (100.0, -50.0, 0.0), None)]
ORIGIN = {"lat": 48.0, "lon": 11.0, "alt_amsl": 500.0}


def sighting(**metres):
    budget = {cause: metres.get(cause, 0.0) for cause in CAUSES}
    return {"type": "sighting", "reason": None, "budget": budget, "gap_s": 0.001, "camera_ned": None, "time_boot": 1.0}


def told(*lines, truth=(), **other):
    return tell([*lines], title="A title", truth=truth, **other)


def test_one_target_is_placed_in_words():
    line = target(1.0, 12.344, -3.0, 0.5, lat=48.1234567, lon=11.7654321)
    said = Markup(answer(told(header(origin=ORIGIN), line, sighting(height=0.7, time=0.2), summary()))).text
    assert "Mark stands at 48.1234567, 11.7654321, 12.34 m north and 3.00 m west of the origin" in said
    assert "with 95 % within 1.22 m" in said
    assert "its height above the ground, 70 cm (one sigma)" in said


def test_without_a_world_it_is_relative_to_the_vehicle():
    story = told(header(), *approach([0.0]), summary())
    assert "of the point below the camera" in Markup(answer(story)).text
    assert "metres from the point below the camera" in Markup(page(story)).text
    assert "metres from the origin" in Markup(page(told(header(origin=ORIGIN), *approach([0.0]), summary()))).text


def test_what_moves_does_not_stand():
    walking = header(config={"tracking": {"motion": "moving"}})
    assert "Mark was last, 100.00 m north" in Markup(answer(told(walking, *approach([0.0]), summary()))).text
    lines = [target(0.0, 0.0, 0.0, label=label) for label in "ab"]
    assert "was at the end within" in Markup(answer(told(walking, *lines, summary()))).text


def test_several_are_counted_and_judged():
    lines = [target(0.0, north, 0.0, 1.0, label=label) for label, north in (("a", 0.0), ("b", 5.0))]
    truth = [TruthPoint(label, None, (0.0, 0.0, 0.0), None) for label in "abc"]
    page_of = Markup(answer(told(header(), *lines, summary(frames=77), truth=truth)))
    assert "2 of 3 targets were placed on the ground from 77 pictures" in page_of.text
    assert "1 / 2inside their claim" in page_of.text
    assert "2.50 mtrue error, median" in page_of.text


@pytest.mark.parametrize(
    ("counted", "said"),
    [
        ({"detections": 0}, "nothing was detected in 10 pictures"),
        ({"detections": 40, "dropped": {"no_clock": 9, "above_horizon": 31}}, "does not meet the ground"),
        ({"detections": 3}, "3 detections were too few"),
        ({"detections": 3, "dropped": {"a_new_reason": 3}}, "a new reason"),
    ],
)
def test_where_nothing_was_found_it_says_why(counted, said):
    html = page(told(header(), summary(**counted)))
    assert said in Markup(html).text
    assert "0 / 0" in html


def test_what_calibration_takes_away_is_not_said_to_limit_the_answer():
    lines = [header(), *approach([0.0]), sighting(time=2.0), calibration(1.0, 0.03, 0.001, [0.0, 0.0, 0.0], 0.1)]
    plain = Replayed(PLAIN.name, PLAIN.kind, approach([0.0], sigma_m=2.0))
    said = Markup(answer(told(*lines, summary(), way=CALIBRATED, others=[plain]))).text
    assert "before the camera was calibrated in flight: when the picture was taken, 2.00 m" in said
    assert "Without that calibration the answer would claim 4.90 m." in said


def test_an_empty_recording_is_a_page_without_charts():
    html = page(told(header()))
    assert "<svg" not in html
    Markup(html)


def test_the_budget_charges_each_metre_to_its_cause():
    lines = [header(), *approach([0.0]), sighting(height=0.3, position=0.4), sighting(height=0.3, position=0.4)]
    page_of = Markup(page(told(*lines, summary())))
    assert "together 50 cm" in page_of.text
    widths = [each["style"] for tag, each in page_of.elements if tag == "i" and "style" in each]
    assert widths == ["width:100.0%", "width:75.0%"]
    assert page_of.text.index("GNSS)40 cm") < page_of.text.index("ground30 cm")


def test_a_page_of_a_hundred_targets_draws_those_that_were_seen_most():
    seen = {"north": 100.5, "east": -50.0}
    lines = [target(0.0, 100.5, -50.0, label=f"m{index}", fix=seen if index > 90 else None) for index in range(100)]
    truth = [TruthPoint(f"m{index}", None, (100.0, -50.0, 0.0), None) for index in range(100)]
    html = page(told(header(), *lines, summary(), truth=truth))
    assert html.count("over time</title>") == 0
    assert html.count('aria-label="Error of') == 12
    assert "88 more targets" in html
    assert 'aria-label="Error of m95 over time"' in html


def test_a_gross_mistake_of_the_mount_is_said_first_and_to_whom_did_not_ask():
    wrong = calibration(1.0, 0.0, 0.01, [0.0] * 3, 1.0) | {"mistake": "the image is upside down"}
    lines = [header(), *approach([0.0])]
    for story in (
        told(*lines, wrong, wrong, summary(), way=CALIBRATED),
        told(*lines, summary(), others=[Replayed(CALIBRATED.name, CALIBRATED.kind, [wrong, wrong])]),
    ):
        said = Markup(page(story)).text
        assert said.index("Believe none of it: the image is upside down.") < said.index("Where everything is")
        assert "Nothing was estimated: the image is upside down." in said
    assert "Believe none" not in page(told(*lines, summary()))
