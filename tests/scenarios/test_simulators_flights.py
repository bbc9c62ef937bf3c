"""Flights of ArduCopter's and PX4's own simulators, replayed: nothing of our mock is in them. See tests/flights."""

import json
import lzma
from functools import partial
from io import BytesIO
from pathlib import Path
from tempfile import TemporaryDirectory

import numpy as np
import pytest
from commands import run_command
from flying import LINK
from kept import kept
from scipy.stats import chi2

pytestmark = pytest.mark.slow

FLIGHTS = Path(__file__).parents[1] / "flights"
CONFIG = LINK + '[camera]\ncalibration = "camera.yaml"\nreadout_s = 0.0\n'
KNOWN_DELAY = "camera.time_offset_s=0.04"
CALIBRATES, PLAIN = ("tracking.self_calibration=true",), ("tracking.self_calibration=false",)
LOWPASS = (*PLAIN, "tracking.filter=lowpass")
BOUND = chi2.ppf(0.999, 2)
"""Squared Mahalanobis distance that one honest answer in a thousand exceeds."""
HALTS = 0.01
"""Share of the frames beyond it where the simulator's clock halted (tests/flights/README.md)."""


def _replay(name, settings):
    with TemporaryDirectory() as made:
        folder = Path(made)
        for packed in (FLIGHTS / name).glob("*.xz"):
            (folder / packed.stem).write_bytes(lzma.decompress(packed.read_bytes()))
        (folder / "camera.yaml").write_bytes((FLIGHTS / "camera.yaml").read_bytes())
        (folder / "flight.toml").write_text(CONFIG)
        words = [word for setting in settings for word in ("--set", setting)]
        files = ("--telemetry", "telemetry.tlog", "--detections", "detections.jsonl", "--out", "targets.jsonl")
        done = run_command("replay", "--config", "flight.toml", *files, *words, folder=folder)
        assert done.returncode == 0, done.stderr
        return (folder / "targets.jsonl").read_text()


def replayed(name, *settings):
    """The lines of the flight's targets file."""
    text = kept(f"simulators/{name}/{settings}", partial(_replay, name, settings))
    return [json.loads(line) for line in text.splitlines()]


def relative_errors(name, lines):
    """(N, 4) of the confirmed pad: instant, s; height, m; error relative to the vehicle, m; its squared distance."""
    packed = (FLIGHTS / name / "truth.csv.xz").read_bytes()
    truth = np.loadtxt(BytesIO(lzma.decompress(packed)), delimiter=",", skiprows=1)
    rows = []
    for line in lines:
        if line["type"] != "target" or line["state"] != "confirmed" or line["fix"] is None:
            continue
        boot_s, relative = line["time_boot"], line["relative"]
        north, east, height = (np.interp(boot_s, truth[:, 0], truth[:, k]) for k in (1, 2, 3))
        off = np.array([relative["north"] - north, relative["east"] - east])
        cov = np.array(relative["cov"])[:2, :2]
        rows.append((boot_s, height, np.hypot(*off), off @ np.linalg.solve(cov, off)))
    return np.array(rows)


def median_until_end(errors, seconds):
    return np.median(errors[errors[:, 0] > errors[-1, 0] - seconds, 2])


@pytest.mark.parametrize("settings", [CALIBRATES, PLAIN, LOWPASS], ids=["self-calibrating", "plain", "low-pass"])
@pytest.mark.parametrize(
    ("name", "delay"), [("copter-landing", KNOWN_DELAY), ("px4-landing", KNOWN_DELAY), ("copter-circles", "")]
)
def test_the_relative_place_is_as_good_as_claimed_through_the_flight(name, delay, settings):
    errors = relative_errors(name, replayed(name, *filter(None, (delay, *settings))))
    assert len(errors) > 900
    assert np.mean(errors[:, 3] > BOUND) <= HALTS
    assert np.mean(errors[:, 3]) < 3.0


@pytest.mark.parametrize("settings", [CALIBRATES, PLAIN], ids=["self-calibrating", "plain"])
def test_a_copter_comes_down_on_its_pad(settings):
    """The mount is off by 1.5 degrees, and the receiver's prior is 1 m: only near fixes show where the pad is."""
    errors = relative_errors("copter-landing", replayed("copter-landing", KNOWN_DELAY, *settings))
    assert errors[-1, 1] < 0.8, "the pad was seen down to there"
    assert median_until_end(errors, 2.0) < 0.08


@pytest.mark.parametrize("settings", [CALIBRATES, PLAIN], ids=["self-calibrating", "plain"])
def test_a_position_that_moves_near_the_ground_is_followed(settings):
    """The altitude is off by half a metre at last, which no filter knows: the low-pass is the measure."""
    errors, paper = (
        relative_errors("px4-landing", replayed("px4-landing", KNOWN_DELAY, *each)) for each in (settings, LOWPASS)
    )
    assert median_until_end(errors, 2.0) < 1.5 * median_until_end(paper, 2.0)
    low = (errors[:, 1] < 8.0) & (errors[:, 1] > 3.0)
    assert np.median(errors[low, 2]) < 0.06


def test_circles_show_delay_and_mount_and_halve_the_error():
    lines = replayed("copter-circles", *CALIBRATES)
    *_, last = (line for line in lines if line["type"] == "calibration")
    assert last["status"] == "calibrated"
    assert abs(last["time_offset_s"] - 0.04) < 3.0 * last["time_offset_sigma_s"] < 0.006
    off = np.subtract(last["mount_deg"], (1.2, -0.8, 1.5))
    assert (np.abs(off) < 3.0 * np.array(last["mount_sigma_deg"])).all()
    assert (np.abs(off[:2]) < 0.2).all()
    calibrated, plain = (
        median_until_end(relative_errors("copter-circles", each), 60.0)
        for each in (lines, replayed("copter-circles", *PLAIN))
    )
    assert calibrated < 0.1
    assert calibrated < plain / 2.0


@pytest.mark.parametrize("name", ["copter-landing", "px4-landing", "copter-circles"])
def test_one_pad_is_one_confirmed_track_and_no_clock_loses_a_frame(name):
    lines = replayed(name, KNOWN_DELAY, *PLAIN)
    seen = [line for line in lines if line["type"] == "target" and line["state"] == "confirmed"]
    assert {line["track"] for line in seen} == {1}
    assert len(seen) > 900
    assert lines[-1]["dropped"].get("too_late", 0) <= 2, "frames of a halt"
    assert not [each for each in lines[-1].get("notices", ()) if each["code"] == "autopilot_rebooted"]
