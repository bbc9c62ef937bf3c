"""The second flight of the report: self-calibration finds the planted errors, and two variants without it do not."""

import argparse
import re
from html import unescape

import pytest

from fwav_companion.config import parse
from fwav_companion.tools.demo import calibration_flight
from fwav_companion.tools.demo.flight_setup import PRIORS
from sitl_mock.arguments import add_flight_arguments, options_from
from sitl_mock.draws import draw

pytestmark = pytest.mark.slow


@pytest.fixture(scope="module")
def flown(tmp_path_factory):
    """(sections, names of the steps and the result, the folder)."""
    out, steps = tmp_path_factory.mktemp("out"), []
    chapter = calibration_flight.second_flight(out, 1, steps.append)
    return chapter.sections, [*steps, chapter.result.sentence], out / calibration_flight.FOLDER


def test_only_the_camera_is_wrong_and_the_service_does_not_know():
    config = parse(calibration_flight.CONFIG, "calibration_flight.toml")
    parser = argparse.ArgumentParser()
    add_flight_arguments(parser)
    mock = options_from(parser.parse_args(calibration_flight.mock_arguments(config, 7)), 1.0)
    assert (mock.seed, mock.seconds) == (7, calibration_flight.SECONDS)
    automatic = {"position_bias_m": 1.0, "position_bias_time_s": 60.0}  # a receiver without a word of its own
    for name in PRIORS:
        stated = getattr(config.uncertainty, name)
        assert getattr(mock.priors, name) == (automatic[name] if stated == "auto" else stated)
    drawn = draw(mock)
    assert (drawn.time_offset_s, drawn.mount_deg) == (0.035, (0.5, 1.0, 2.0))
    assert config.camera.time_offset_s == 0.0
    assert config.camera.mount.body_from_camera == parse("", "", ["camera.calibration=c"]).camera.mount.body_from_camera
    wrong = (drawn.heading_deg, drawn.attitude_roll_deg, drawn.attitude_pitch_deg, drawn.height_m)
    assert (*wrong, drawn.position_sigma_m, drawn.readout_s) == (0.0,) * 6


def test_the_three_variants_end_in_the_order_of_what_they_know(flown):
    (variants, _), _, _ = flown
    rows = re.findall(
        r"<tr><td>([^<]*)</td><td>([\d.]+) m</td><td class=\"\w+\">([\d.]+) m</td></tr>", unescape(variants)
    )
    claims = {name: float(claim) for name, claim, _ in rows}
    errors = {name: float(error) for name, _, error in rows}
    names = ["the paper's filter", "the tracker without self-calibration", "the tracker with self-calibration"]
    assert list(errors) == names
    assert errors[names[2]] < 0.06
    assert errors[names[2]] < 0.3 * errors[names[0]]
    assert claims[names[2]] < 0.2 * claims[names[1]] < claims[names[0]]


def test_calibration_finds_its_values(flown):
    (_, learned), _, _ = flown
    ends = re.findall(r"At the end (-?[\d.]+)(?: ms|°) ± [\d.]+(?: ms|°) \(95 %\)\. In truth (-?[\d.]+)", learned)
    assert [float(true) for _, true in ends] == [35.0, 0.5, 1.0, 2.0]
    for (found, true), within in zip(ends, (3.0, 0.3, 0.3, 0.3), strict=True):
        assert float(found) == pytest.approx(float(true), abs=within)
    assert learned.count('class="planted"') == 4


def test_the_steps_are_shown_and_the_recording_is_kept(flown):
    _, steps, folder = flown
    assert len(steps) == 5
    assert steps[-1].startswith(
        "A second flight has an exact position, but a camera 35 ms late on a crooked mount. Final errors: the paper's "
        "filter "
    )
    assert len(re.findall(r" [\d.]+ c?m[,.]", steps[-1])) == 3
    kept = {"telemetry.tlog", "detections.jsonl", "truth.csv", "fwav-companion.toml", "camera.yaml"}
    assert kept <= {path.name for path in folder.iterdir()}


def test_a_flight_that_cannot_be_flown_is_reported_in_its_place(tmp_path, monkeypatch):
    monkeypatch.setattr(calibration_flight, "MOCK_MODULE", "no_such_module")
    chapter = calibration_flight.second_flight(tmp_path, 1, lambda _: None)
    assert "could not be flown" in chapter.sections[0]
    assert "could not be flown" in chapter.result.sentence
    assert chapter.result.card is None
