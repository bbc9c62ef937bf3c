"""Self-calibration through the whole pipeline: its estimate, its reports, and the start of the next flight."""

from math import radians

import pytest
from flying import CAMERA, LINK, Companion, fly

from fwav_companion.config import load, parse
from fwav_companion.geometry.mounts import corrected_mount
from fwav_companion.recording.line_types import CalibrationLine, TargetLine
from fwav_companion.self_calibration import KeptCalibration
from fwav_companion.service.calibration_store import CalibrationStore
from fwav_companion.types import NoticeCode
from sitl_mock import scenario

SETTINGS = (
    "tracking.self_calibration=true",
    "uncertainty.time_offset_sigma_s=0.05",
    "uncertainty.attitude_bias_deg=0.0",
    "uncertainty.position_bias_m=0.0",
    "uncertainty.height_bias_m=0.0",
    "camera.readout_s=0.0",
)
FAULTS = {
    "seconds": 45.0,
    "seed": 2,
    "draw_biases": False,
    "camera.readout_s": 0.0,
    "camera.clutter": 0.0,
    "autopilot.pitch_trim_deg": 0.0,
    "biases.time_offset_s": 0.035,
    "biases.mount_deg": (0.5, 1.0, 2.0),
}


@pytest.fixture(scope="module")
def calibrated():
    return fly(scenario("figure_eight").but(FAULTS), SETTINGS)


def test_a_late_camera_and_a_crooked_mount_are_found(calibrated):
    line = [line for line in calibrated.companion.lines if isinstance(line, CalibrationLine)][-1]
    assert line.status == "calibrated"
    assert line.time_offset_s == pytest.approx(0.035, abs=0.003)
    assert line.mount_deg == pytest.approx([0.5, 1.0, 2.0], abs=0.5)
    assert calibrated.error_m(calibrated.final()) < 0.25


def test_what_was_found_is_said_once_as_configuration_lines(calibrated):
    said = calibrated.companion.texts(NoticeCode.CALIBRATION_RESULT)
    assert 1 <= len(said) <= 2
    assert "[camera] time_offset_s = 0.03" in said[-1]
    assert "[camera.mount] roll_deg = " in said[-1]


def test_the_offered_lines_are_the_corrected_mount(calibrated):
    status = calibrated.companion.pipeline.status(calibrated.mock.end_ns).calibration
    offset, mount = status.configuration_lines
    settings = [f"camera.time_offset_s={offset.rpartition('= ')[2]}"]
    for pair in mount.removeprefix("[camera.mount] ").split(", "):
        name, value = pair.split(" = ")
        settings.append(f"camera.mount.{name}={value}")
    offered = Companion(settings).config.camera.mount.body_from_camera
    correction = tuple(radians(angle) for angle in status.mount_deg)
    expected = corrected_mount(calibrated.companion.config.camera.mount.body_from_camera, correction)
    for row, expected_row in zip(offered, expected, strict=True):
        assert row == pytest.approx(expected_row, abs=2e-5)


@pytest.mark.parametrize("setting", ["tracking.filter=lowpass", "tracking.motion=moving"])
def test_it_is_reported_with_what_it_does_not_correct(setting):
    status = Companion((*SETTINGS, setting)).pipeline.status(0).calibration
    assert (status.status, status.time_offset_sigma_s) == ("waiting", 0.05)


def test_an_upside_down_camera_is_named_and_nothing_is_estimated():
    flown = fly(scenario("upside_down").but({"seconds": 20.0, "seed": 1}), ("tracking.self_calibration=true",))
    assert flown.companion.codes.count(NoticeCode.MOUNT_MISTAKE) == 1
    lines = [line for line in flown.companion.lines if isinstance(line, CalibrationLine)]
    assert any("upside down" in line.mistake for line in lines)
    assert not lines[0].mistake


def test_errors_within_their_priors_are_no_mistake_of_the_mount():
    """The heading is off by 5.4 degrees for a sigma of 2, the mount by 1.9 for 1.1, the position wanders by 1 m."""
    flown = fly(scenario("figure_eight").but({"seconds": 40.0, "seed": 707}), ("tracking.self_calibration=true",))
    assert flown.mock.biases.heading_deg == pytest.approx(5.4, abs=0.1)
    seen = [line for line in flown.companion.lines if isinstance(line, TargetLine) and line.fix is not None]
    assert flown.mock.flight_s(round(seen[-1].time_unix * 1e9) - flown.companion.unix_offset_ns) > 39.5


KEPT = KeptCalibration(
    time_offset_s=0.035, time_offset_sigma_s=0.001, mount=(0.01, 0.02, 0.03), mount_sigma=(0.002, 0.002, 0.03)
)


@pytest.fixture
def board(tmp_path):
    (tmp_path / "camera.yaml").write_text(CAMERA)
    path = tmp_path / "flight.toml"
    path.write_text(
        LINK
        + '[camera]\ncalibration = "camera.yaml"\n[tracking]\nself_calibration = true\n[state]\ndirectory = "state"\n'
    )
    return path


def remember(path, kept=KEPT):
    memory = CalibrationStore(load(path), pytest.fail)
    memory.start()
    memory.tick(kept)
    memory.close(5.0)


def test_a_calibration_is_kept_for_the_next_flight_of_the_same_camera(board):
    assert CalibrationStore(load(board), pytest.fail).kept() is None
    remember(board)
    assert CalibrationStore(load(board), pytest.fail).kept() == KEPT


@pytest.mark.parametrize(
    ("file", "old", "new"),
    [
        ("camera.yaml", "3.55", "3.56"),
        ("flight.toml", "[camera]\n", "[camera]\ntime_offset_s = 0.01\n"),
        ("flight.toml", "[tracking]", "[camera.mount]\nroll_deg = 1.0\n[tracking]"),
    ],
    ids=["another lens", "another delay", "another mount"],
)
def test_it_expires_when_the_camera_changes(board, file, old, new):
    remember(board)
    changed = board.parent / file
    changed.write_text(changed.read_text().replace(old, new, 1))
    assert CalibrationStore(load(board), pytest.fail).kept() is None


def test_without_a_state_directory_or_self_calibration_nothing_is_kept(tmp_path, monkeypatch):
    monkeypatch.delenv("STATE_DIRECTORY", raising=False)
    config = parse(LINK + '[camera]\ncalibration = "absent.yaml"\n', str(tmp_path / "flight.toml"))
    memory = CalibrationStore(config, pytest.fail)
    memory.start()
    memory.tick(KEPT)
    memory.close(1.0)
    assert memory.kept() is None
    assert list(tmp_path.iterdir()) == []
