"""``check --click-delay``: clicks with a known delay after blinks with a known rhythm."""

from __future__ import annotations

import json
import os
import threading
import time
from contextlib import suppress
from random import Random
from types import SimpleNamespace

import pytest
from processes import process
from sites import Site

from fwav_companion.cli.main import main
from fwav_companion.tools.doctor.click_delay import Blinking, ClickDelay, NoClickDelay, click_delay, distinct
from fwav_companion.tools.doctor.click_delay_session import ClickDelaySession
from fwav_companion.types import Detection, Frame, StampClock

TRACK_POINT, CAMERA = 2004, 100


def blinked(period_s=1.5, *, count=12, lit=0.5, fps=30.0, missed=0.0, start_s=100.0, seed=1):
    """Frames of a label that is there for the first part of each period, beside one that is always there."""
    rng, blinking = Random(seed), Blinking()
    for number in range(round(count * period_s * fps)):
        at_s = start_s + number / fps
        shows = ((at_s - start_s) % period_s) / period_s >= 1.0 - lit and rng.random() >= missed
        blinking.add(at_s, ["tag:1", "tag:2"] if shows else ["tag:2"])
    return blinking.onsets


def clicks_after(delay_s, *, period_s=1.5, lit=0.5, scatter_s=0.04, count=10, start_s=100.0, seed=2):
    rng = Random(seed)
    first_s = start_s + (1.0 - lit) * period_s
    return [first_s + number * period_s + delay_s + rng.gauss(0.0, scatter_s) for number in range(count)]


@pytest.mark.parametrize("delay_s", [0.02, 0.3, 0.8, 1.4])
def test_the_delay_is_the_phase_of_the_clicks_in_the_rhythm(delay_s):
    result = click_delay(blinked(), clicks_after(delay_s))
    assert isinstance(result, ClickDelay)
    assert abs(result.video_delay_s - delay_s) < 3.0 * result.sigma_s < 0.12
    assert result.period_s == pytest.approx(1.5, abs=0.02)


def test_sigma_is_true_over_many_operators():
    """Without the share of people's own tapping, which these do not have."""
    onsets, squares = blinked(), []
    for seed in range(200):
        result = click_delay(onsets, clicks_after(0.4, scatter_s=0.06, seed=seed))
        assert isinstance(result, ClickDelay)
        squares.append((result.video_delay_s - 0.4) ** 2 / (result.sigma_s**2 - 0.03**2))
    assert 0.7 < sum(squares) / len(squares) < 1.6


def test_frames_that_the_detector_misses_are_no_blinks():
    onsets = blinked(missed=0.1, fps=30.0)
    assert 10 <= len(onsets) <= 12


@pytest.mark.parametrize(
    ("onsets", "clicks", "words"),
    [
        ([], [], "let a target blink"),
        (blinked(), clicks_after(0.3, count=4), "4 clicks; needed: 6"),
        (blinked(), clicks_after(0.3, scatter_s=0.4), "scatter by"),
        (blinked(0.45, count=30), clicks_after(0.1, period_s=0.45), "every 0.4"),
        ([1.0, 2.0, 4.5, 5.0, 8.0, 8.6], [], "unevenly"),
    ],
)
def test_what_shows_no_delay_says_why(onsets, clicks, words):
    result = click_delay(onsets, clicks)
    assert isinstance(result, NoClickDelay)
    assert words in result.why


def test_a_command_that_is_repeated_is_one_click():
    assert distinct([1.0, 1.1, 3.0, 2.0, 3.2]) == [1.0, 2.0, 3.0]


def test_frames_on_the_autopilots_clock_count_by_their_arrival():
    now, shown = [0.0], []
    session = ClickDelaySession(0.0, wait_s=60.0, show=shown.append, now_s=lambda: now[0])
    seen = Detection(u=1.0, v=1.0, label="color")
    for number in range(600):
        at_s = number / 30.0
        lit = at_s % 1.5 > 0.75
        detections = (seen,) if lit else ()
        session.on_frame(
            Frame(
                number=number,
                stamp_ns=round((at_s + 5000.0) * 1e9),
                stamp_clock=StampClock.BOOT,
                arrival_ns=round(at_s * 1e9),
                detections=detections,
            )
        )
        now[0] = at_s
        if at_s % 1.5 >= 1.0 and (number - 1) / 30.0 % 1.5 < 1.0:
            session.on_message(SimpleNamespace(name="COMMAND_LONG", fields=SimpleNamespace(command=TRACK_POINT)))
            session.on_message(SimpleNamespace(name="COMMAND_LONG", fields=SimpleNamespace(command=512)))
    assert session.enough(None, None)
    result = session.result()
    assert isinstance(result, ClickDelay)
    assert result.video_delay_s == pytest.approx(0.25, abs=0.05)
    assert shown[-1].startswith("click on it each time")


def test_without_a_station_there_is_no_one_to_click(tmp_path, capsys):
    assert main(["init", str(tmp_path)]) == 0
    path = tmp_path / "fwav-companion.toml"
    path.write_text(path.read_text().replace('role = "gcs"', 'role = "payload"'))
    assert main(["check", "--config", str(path), "--click-delay"]) == 2
    assert 'no link has role = "gcs"' in capsys.readouterr().err
    assert main(["check", "--config", str(path), "--click-delay", "--shake", "--tag-size", "0.1"]) == 2


@pytest.mark.slow
@pytest.mark.timeout(180)
def test_a_tag_that_blinks_in_the_pictures_and_clicks_of_a_station(tmp_path):
    """The whole command: pictures by a pipe, the detector's process, clicks by MAVLink 0.4 s after each appearance."""
    import sys
    from pathlib import Path

    sys.path.insert(0, str(Path(__file__).parents[2] / "vision"))
    from vision_pictures import pipe_bytes, tag_picture

    site = Site(tmp_path)
    with (tmp_path / "fwav-companion.toml").open("a") as file:
        file.write('\n[vision]\nsource = "frames"\n')
    os.mkfifo(tmp_path / "frames")
    stop, onsets = threading.Event(), []
    pictures = {True: tag_picture(), False: tag_picture()[:, ::-1].copy()}  # a mirrored tag is none

    def blink():
        with suppress(BrokenPipeError), (tmp_path / "frames").open("wb") as pipe:
            was = False
            while not stop.is_set():
                now_s = time.monotonic()
                lit = now_s % 1.6 > 0.8
                if lit and not was:
                    onsets.append(now_s)
                was = lit
                pipe.write(pipe_bytes(pictures[lit], time_monotonic=now_s))
                pipe.flush()
                time.sleep(0.05)

    def click():
        clicked = len(onsets)
        while not stop.wait(0.005):
            if len(onsets) > clicked and time.monotonic() >= onsets[clicked] + 0.4:
                clicked += 1
                site.ground.command(CAMERA, TRACK_POINT, 0.5, 0.5, 0.02)

    threads = [threading.Thread(target=each, daemon=True) for each in (blink, click)]
    with (
        site.mock("--set", "camera.enabled=False", seconds=90.0),
        process(
            "fwav_companion", "check", "--config", "fwav-companion.toml", "--click-delay", "--json", folder=tmp_path
        ) as check,
    ):
        threads[0].start()
        check.wait_for("click on it each time", within_s=60.0)
        site.ground.listen(until="HEARTBEAT")
        threads[1].start()
        assert check.end(90.0) == 0
        stop.set()
    result = json.loads(check.said.splitlines()[-1])
    assert result["ok"] is True
    assert abs(result["video_delay_s"] - 0.4) < 0.12
    assert result["period_s"] == pytest.approx(1.6, abs=0.1)
    site.close()
