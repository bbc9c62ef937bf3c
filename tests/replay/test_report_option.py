"""report.html and compare.html of replays: whole, self-contained, and with the right numbers in them."""

import contextlib
import os
import pty
import re
import subprocess
import sys

import msgspec
import numpy as np
import pytest
from commands import run_command
from flying import CAMERA, LINK, fly
from lxml import html
from report_lines import BEGUN, target

from fwav_companion.recording.line_decoder import read_lines
from fwav_companion.tools.report.diagnostics import EXPECTED_NIS, NIS_95, innovations
from sitl_mock import scenario

CONFIG = LINK + '[camera]\ncalibration = "camera.yaml"\n'


@pytest.fixture(scope="module")
def site(tmp_path_factory):
    folder = tmp_path_factory.mktemp("flight")
    flown = fly(scenario("unbiased").but({"seconds": 11.0, "seed": 8}), ["tracking.self_calibration=true"])
    for name, content in (("flight.toml", CONFIG), ("camera.yaml", CAMERA)):
        (folder / name).write_text(content)
    (folder / "telemetry.tlog").write_bytes(flown.companion.tlog)
    (folder / "detections.jsonl").write_bytes(flown.companion.detections)
    place = flown.mock.world.place(flown.mock.scene[0].at(0.0))
    (folder / "truth.csv").write_text(
        f"label,lat,lon,alt_amsl\ntarget,{place.lat!r},{place.lon!r},{place.alt_amsl!r}\n"
    )
    return folder


def replay(folder, *words):
    files = ["--telemetry", "telemetry.tlog", "--detections", "detections.jsonl", "--config", "flight.toml"]
    return run_command("replay", *files, *words, folder=folder)


def read(path):
    """The page as a browser parses it; nothing in it may refer to another file."""
    text = path.read_text(encoding="utf-8")
    assert not re.search(r"""(src|href)=["'](?!data:|#)|url\((?!data:)|@import""", text)
    return html.fromstring(text)


def test_a_report_says_where_how_surely_and_why(site):
    assert replay(site, "--out", "plain.jsonl", "--truth", "truth.csv").returncode == 0
    settings = ("--set", "tracking.self_calibration=true")
    done = replay(site, "--out", "t.jsonl", "--truth", "truth.csv", "--report", "out/here", *settings)
    assert done.returncode == 0, done.stderr
    assert "out/here/report.html" in done.stdout
    page = read(site / "out/here/report.html")
    text = page.text_content()
    for words in ("What limits the accuracy", "Do the sightings agree", "The shortest round trip", "error on the map"):
        assert words in text
    assert len(page.findall(".//svg")) >= 6
    assert b'"type":"sighting"' not in (site / "t.jsonl").read_bytes()


@pytest.mark.slow
def test_a_report_draws_the_other_variants_unless_it_is_to_be_alone(site):
    settings = ("--set", "tracking.self_calibration=true", "--truth", "truth.csv")
    assert replay(site, "--out", "t.jsonl", "--report", "three", *settings).returncode == 0
    page = read(site / "three/report.html")
    for kind, name in (("paper", "the paper's filter"), ("plain", "without self-calibration"), ("calibrated", "with")):
        assert page.find_class(f"variant-{kind}")
        assert name in page.text_content()
    assert replay(site, "--out", "u.jsonl", "--report", "one", "--alone", *settings).returncode == 0
    alone = read(site / "one/report.html")
    assert not alone.find_class("variant-paper")
    assert "the paper's filter" not in alone.text_content()
    assert (site / "t.jsonl").read_bytes() == (site / "u.jsonl").read_bytes()


@pytest.mark.slow
def test_on_a_terminal_a_bar_follows_every_replay(site):
    shown, end = pty.openpty()
    files = ["--telemetry", "telemetry.tlog", "--detections", "detections.jsonl", "--config", "flight.toml"]
    command = [sys.executable, "-m", "fwav_companion", "replay", *files, "--out", "t.jsonl", "--report", "out"]
    process = subprocess.Popen(
        command, cwd=site, stdout=subprocess.PIPE, stderr=end, env={**os.environ, "TERM": "xterm"}
    )
    os.close(end)
    seen = b""
    with contextlib.suppress(OSError):  # EIO: the other end is closed
        while data := os.read(shown, 65536):
            seen += data
    os.close(shown)
    assert process.wait(60) == 0
    process.stdout.close()
    for name in ("replay", "the paper's filter", "the tracker with self-calibration"):
        assert name.encode() in seen
    assert b"100%" in seen


def test_a_report_changes_nothing_in_what_is_said(site):
    assert replay(site, "--out", "a.jsonl").returncode == 0
    assert replay(site, "--out", "b.jsonl", "--report", "out").returncode == 0
    assert (site / "a.jsonl").read_bytes() == (site / "b.jsonl").read_bytes()


def test_a_report_holds_the_innovations_of_the_targets_file():
    innovation = {"north": 0.25, "east": -0.5, "distance2": 3.5}
    lines = [
        target(2.0, 0.0, 0.0),
        target(2.0, 0.0, 0.0, innovation=innovation),
        target(2.0, 0.0, 0.0, innovation=innovation, state="tentative"),
    ]
    assert [msgspec.structs.astuple(each) for each in innovations(lines, BEGUN)] == [(2.0, 0.25, -0.5, 3.5)]


def test_normalised_squares_are_about_two_where_nothing_is_worse_than_configured(site):
    """Normalised squares of one flight whose errors were drawn from its configuration."""
    assert replay(site, "--out", "s.jsonl", "--sightings").returncode == 0
    lines = read_lines((site / "s.jsonl").read_bytes().splitlines()).lines
    squares = [each.nis for each in innovations(lines, 0.0)]
    assert len(squares) > 100
    assert EXPECTED_NIS / 4.0 < np.mean(squares) < EXPECTED_NIS * 1.5
    assert np.mean(np.array(squares) > NIS_95) < 0.15


def test_innovations_are_written_where_sightings_are_and_nowhere_else(site):
    assert replay(site, "--out", "a.jsonl").returncode == 0
    assert b"innovation" not in (site / "a.jsonl").read_bytes()


def test_two_filters_side_by_side(site):
    assert replay(site, "--out", "kalman.jsonl").returncode == 0
    assert replay(site, "--out", "lowpass.jsonl", "--set", "tracking.filter=lowpass").returncode == 0
    files = ["--compare", "kalman.jsonl", "lowpass.jsonl", "--report", "out", "--truth", "truth.csv"]
    done = run_command("replay", *files, folder=site)
    assert done.returncode == 0, done.stderr
    text = read(site / "out/compare.html").text_content().replace("\u00a0", " ")
    assert 'tracking.filter: "kalman" | "lowpass"' in text
    assert "A (kalman) claimed 95 %" in text
    assert "B (lowpass) true error" in text
    assert text.strip().startswith("tracking.filter: kalman compared with lowpass")


@pytest.mark.parametrize(
    ("words", "expected"),
    [
        (["--compare", "absent.jsonl", "flight.toml", "--report", "out"], "absent.jsonl: No such file"),
        (["--compare", "flight.toml", "flight.toml", "--report", "out"], "flight.toml: "),
        (["--compare", "a", "b"], "--report"),
        (["--out", "x.jsonl"], "--telemetry, --detections, --config"),
    ],
)
def test_what_is_missing_is_one_line_and_exit_2(site, words, expected):
    done = run_command("replay", *words, folder=site)
    assert done.returncode == 2
    assert expected in done.stderr
    assert done.stderr.count("\n") == 1
