"""KEY of --set and --vary: what is accepted, what it changes, and the one line for each mistake."""

import pytest

from fwav_companion.errors import UserError
from fwav_companion.tools.study.keys import (
    claim_settings,
    flight_settings,
    parse_setting,
    parse_variation,
    truth_settings,
)


def test_a_bare_key_is_both_truth_and_claim_and_a_prefix_makes_it_one():
    settings = [
        parse_setting(text)
        for text in (
            "uncertainty.mount_bias_deg=0.5",
            "truth.uncertainty.heading_bias_deg=4",
            "claim.rates.position=5",
            "flight.height_m=20",
        )
    ]
    assert truth_settings(settings) == ["uncertainty.mount_bias_deg=0.5", "uncertainty.heading_bias_deg=4"]
    assert claim_settings(settings) == ["uncertainty.mount_bias_deg=0.5", "rates.position=5"]
    assert flight_settings(settings) == {"height_m": 20.0}


def test_a_range_and_choices():
    ranged = parse_variation("flight.height_m=5:40")
    assert (ranged.is_range, ranged.examples) == (True, (5.0, 40.0))
    assert parse_variation("tracking.filter=kalman,lowpass").choices == ("kalman", "lowpass")
    assert parse_variation("uncertainty.position_bias_m=0.02,1").choices == (0.02, 1.0)


@pytest.mark.parametrize(
    ("text", "said"),
    [
        ("flight.heigth_m=5:40", 'did you mean "flight.height_m"?'),
        ("uncertainty.mount_bias=1:2", 'did you mean "uncertainty.mount_bias_deg"?'),
        ("mount_bias_deg=1:2", 'did you mean "uncertainty.mount_bias_deg"?'),
        ("publish.rate_hz=1:2", "[publish] does not change a flight"),
        ("camera.calibration=a,b", "a study cannot vary it"),
        ("truth.tracking.alpha=0.1:0.2", "there is no truth of it"),
        ("flight.height_m=40:5", "not below the high end"),
        ("flight.height_m=5", "one value is no variation"),
        ("flight.height_m=0:5", "a number from 0.5 to 1000"),
        ("flight.height_m=1:x", "is not a number"),
        ("flight.height_m=1:nan", "is not a number"),
        ("flight.height_m", "accepted: KEY=LOW:HIGH"),
    ],
)
def test_every_mistake_of_a_variation_is_one_line_that_says_what_is_accepted(text, said):
    with pytest.raises(UserError) as raised:
        parse_variation(text)
    line = str(raised.value)
    assert said in line
    assert "accepted" in line or "did you mean" in line
    assert "\n" not in line
