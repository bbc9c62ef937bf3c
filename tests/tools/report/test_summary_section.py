"""The first screen: places, accuracy, its main limit, ghosts apart; and the text where nothing was found."""

import pytest
from report_lines import Markup, approach, calibration, header, sighting, summary, target

from fwav_companion.recording.truth import TruthPoint
from fwav_companion.tools.report import CALIBRATED, PLAIN, ReplayedLines, TrueVehiclePath, flight_data, page
from fwav_companion.tools.report.summary_section import summary_section

TRUTH = [TruthPoint("mark", None, (100.0, -50.0, 0.0), None)]
ORIGIN = {"lat": 48.0, "lon": 11.0, "alt_amsl": 500.0}


def flight_of(*lines, truth=(), **other):
    return flight_data([*lines], title="A title", truth=truth, **other)


def text_of(flight):
    return Markup(summary_section(flight)).text


def test_one_target_is_placed_in_words():
    line = target(1.0, 12.344, -3.0, 0.5, lat=48.1234567, lon=11.7654321)
    text = text_of(flight_of(header(origin=ORIGIN), line, sighting(1.0, {"height": 0.7, "time": 0.2}), summary()))
    assert "Mark is at 48.1234567, 11.7654321, 12.34 m north and 3.00 m west of the origin." in text
    assert "It is within 1.22 m of that place (95 %)." in text


def test_without_a_world_it_is_relative_to_the_vehicle():
    flight = flight_of(header(), *approach([0.0]), summary())
    assert "Mark is 100.00 m north and 50.00 m west of the point below the camera" in text_of(flight)
    assert "metres from the point below the camera" in Markup(page(flight)).text
    assert "metres from the origin" in Markup(page(flight_of(header(origin=ORIGIN), *approach([0.0]), summary()))).text


def test_a_moving_target_has_a_last_place():
    moving = header(config={"tracking": {"motion": "moving"}})
    assert "Mark was last 100.00 m north" in text_of(flight_of(moving, *approach([0.0]), summary()))
    lines = [target(0.0, 0.0, 0.0, label=label) for label in "ab"]
    assert "was at the end within" in text_of(flight_of(moving, *lines, summary()))


def test_several_are_counted_and_judged():
    lines = [target(0.0, north, 0.0, 1.0, label=label) for label, north in (("a", 0.0), ("b", 5.0))]
    truth = [TruthPoint(label, None, (0.0, 0.0, 0.0), None) for label in "abc"]
    text = text_of(flight_of(header(), *lines, summary(frames=77), truth=truth))
    assert "2 of 3 targets found in 77 pictures" in text
    assert "1 / 2errors within their claim" in text
    assert "2.50 mtrue error, median" in text
    assert "2.45 mclaimed radius (95 %), median" in text


def test_a_ghost_never_counts_as_found():
    """Two tracks at one truth: one of them is a ghost."""
    lines = [target(0.0, north, 0.0, track=track) for track, north in ((1, 0.3), (2, 1.0))]
    text = text_of(flight_of(header(), *lines, summary(), truth=[TruthPoint("mark", None, (0.0, 0.0, 0.0), None)]))
    assert "1 / 1targets found; 1 ghost" in text
    assert "2 / 2" not in text
    assert "1 of 1 targets found in 10 pictures. 1 confirmed track is a ghost: no true target belongs to it." in text
    assert "30 cmtrue error" in text  # of the target alone
    two = text_of(flight_of(header(), *lines, summary()))
    assert "2targets found" in two  # without a truth there is no ghost
    assert "ghost" not in two


def test_the_height_and_the_common_error_are_named_and_taken_off():
    """Both targets have the vehicle's error of (3, 4) m, and 1 m or 2 m of their own."""
    truth = [TruthPoint(label, None, (north, 0.0, 0.0), None) for label, north in (("a", 0.0), ("b", 20.0))]
    place = {"camera_ned": [3.0, 4.0, -11.2], "ground_ned": [3.0, 4.0, 0.0]}
    sightings = [sighting(at_s, {"position": 2.0}, **place) for at_s in (1.0, 2.0)]
    lines = [
        target(1.0, 4.0, 4.0, label="a", fix={"north": 0.0, "east": 0.0}),
        target(2.0, 25.0, 4.0, label="b", fix={"north": 0.0, "east": 0.0}),
    ]
    path = TrueVehiclePath([0.0, 9.0], [(0.0, 0.0, -11.0), (0.0, 0.0, -11.0)])
    flight = flight_of(header(origin=ORIGIN), *sightings, *lines, summary(), truth=truth, true_path=path)
    text = text_of(flight)
    assert "2 of 2 targets found from 11 m above the ground" in text
    assert "Relative to the vehicle the error is 1.50 m (median of 2)." in text
    assert "own GNSS position is added, here 5.00 m: it is one error, common to all targets" in text
    assert "11 mheight above the ground" in text
    assert "1.50 merror relative to the vehicle, median" in text
    assert "6.03 merror on the map, with GNSS, median" in text  # between 5.66 and 6.40
    assert "error relative to the vehicle" in page(flight)
    assert len(Markup(page(flight)).of("relative")) == 2  # on the map
    alone = text_of(flight_of(header(origin=ORIGIN), *sightings, *lines, summary(), truth=truth))
    assert "relative to the vehicle" not in alone
    assert "own position (GNSS), 3.46 m (95 %). It is one error, common to all targets" in alone


@pytest.mark.parametrize(
    ("counted", "expected"),
    [
        ({"detections": 0, "fixes": 0}, "nothing was detected in 10 pictures"),
        ({"detections": 40, "dropped": {"no_clock": 9, "above_horizon": 31}}, "31 detections: The line of sight does"),
        ({"detections": 40, "dropped": {"no_clock": 40, "above_horizon": 31}}, "40 frames: The offset between"),
        ({"detections": 5}, "5 detections were too few"),
        ({"detections": 8, "dropped": {"a_new_reason": 3}}, "3 detections: a new reason."),
    ],
)
def test_where_nothing_was_found_it_says_why(counted, expected):
    html = page(flight_of(header(), summary(**counted)))
    assert expected in Markup(html).text
    assert "0</b><span>targets found" in html


def test_what_calibration_takes_away_is_not_said_to_limit_the_answer():
    lines = [header(), *approach([0.0]), sighting(1.0, {"time": 2.0})]
    lines.append(calibration(1.0, 0.03, 0.001, [0.0, 0.0, 0.0], 0.1))
    plain = ReplayedLines(PLAIN.name, PLAIN.kind, approach([0.0], sigma_m=2.0))
    text = text_of(flight_of(*lines, summary(), variant=CALIBRATED, others=[plain]))
    assert "before the camera was calibrated in flight: when the picture was taken, 3.92 m (95 %)." in text
    assert "Without that calibration the claimed radius would be 4.90 m (95 %)." in text


def test_an_empty_recording_is_a_page_without_charts():
    html = page(flight_of(header()))
    assert "<svg" not in html
    Markup(html)


def test_the_budget_charges_each_metre_to_its_cause():
    """95 %: 1.96 of the budget along a line, 1.7308 of it where the error is equal in all directions."""
    budget = {"height": 0.3, "position": 0.4}
    page_of = Markup(page(flight_of(header(), *approach([0.0]), *[sighting(1.0, budget)] * 2, summary())))
    assert "all causes together: 91 cm (95 %)" in page_of.text
    widths = [each["style"] for tag, each in page_of.elements if tag == "i" and "style" in each]
    assert widths == ["width:100.0%", "width:84.9%"]
    assert page_of.text.index("GNSS)69 cm") < page_of.text.index("ground59 cm")


def test_a_page_of_a_hundred_targets_draws_those_that_were_seen_most():
    seen = {"north": 100.5, "east": -50.0}
    lines = [target(0.0, 100.5, -50.0, label=f"m{index}", fix=seen if index > 90 else None) for index in range(100)]
    truth = [TruthPoint(f"m{index}", None, (100.0, -50.0, 0.0), None) for index in range(100)]
    html = page(flight_of(header(), *lines, summary(), truth=truth))
    assert html.count("over time</title>") == 0
    assert html.count('aria-label="Error of') == 12
    assert "88 more targets" in html
    assert 'aria-label="Error of m95 over time"' in html


def test_a_gross_mistake_of_the_mount_is_said_first_also_where_only_another_variant_found_it():
    wrong = calibration(1.0, 0.0, 0.01, [0.0] * 3, 1.0, mistake="the image is upside down")
    lines = [header(), *approach([0.0])]
    for flight in (
        flight_of(*lines, wrong, wrong, summary(), variant=CALIBRATED),
        flight_of(*lines, summary(), others=[ReplayedLines(CALIBRATED.name, CALIBRATED.kind, [wrong, wrong])]),
    ):
        text = Markup(page(flight)).text
        assert text.index("Do not trust these results: the image is upside down.") < text.index("View from above")
        assert "No value was estimated: the image is upside down." in text
    assert "Do not trust" not in page(flight_of(*lines, summary()))
