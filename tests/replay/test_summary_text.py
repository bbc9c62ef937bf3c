"""The text that `replay` ends with: what was used, what happened, and errors with the confidence that they have."""

from io import StringIO

import msgspec
import pytest
from report_lines import Markup, header, summary, target

from fwav_companion.cli.replay import _print_summary
from fwav_companion.pipeline.target_log import TargetLog
from fwav_companion.tools.report import flight_data, page
from fwav_companion.types import Notice, NoticeCode, Severity


def shown(**more):
    out = StringIO()
    _print_summary(summary(dropped_frames={}, dropped_detections={}, **more), out)
    return out.getvalue()


@pytest.mark.parametrize("fixes", [0, 1])
def test_a_replay_without_a_fix_says_what_its_reasons_mean(fixes):
    out = StringIO()
    lines = summary(dropped_frames={"wrong_units": 9}, dropped_detections={"odd": 1}, fixes=fixes)
    _print_summary(lines, out)
    means = "" if fixes else ": The time stamp is not in seconds."
    assert f"not used: 9 frames wrong_units{means}\n  not used: 1 detections odd\n" in out.getvalue()


def test_errors_have_their_confidence():
    numbers = {
        "samples": 40, "ce50_m": 0.5, "ce90_m": 1.25, "rms_m": 0.75, "nees": 2.5,
        "coverage95": {"n": 20, "inside": 18, "low": 0.69, "high": 0.97},
    }  # fmt: skip
    targets = [
        {"label": "pad", "state": "found", "final_m": 1.5, "claimed95_m": 1.0, "outside95": True},
        {"label": "cow", "state": "fixed", "final_m": None},
        {"label": "car", "state": "missed", "final_m": None},
    ]
    fixes, tracks = ({"all": every, "labels": {}} for every in (numbers, {"samples": 0}))
    errors = {"targets": targets, "ghosts": 1, "labels": {}, "fixes": fixes, "tracks": tracks}
    text = shown(errors=errors)
    for words in (
        "pad: final 1.500 m, claimed 1.000 m (95 %): OUTSIDE ITS CLAIM", "cow: fixed, never confirmed",
        "car: not found", "1 ghosts", "CE50 0.500 m, CE90 1.250 m, rms 0.750 m",
        "90 % inside their claimed 95 % ellipses (true share 69 to 97 %)", "mean normalised square 2.5",
    ):  # fmt: skip
        assert words in text
    assert "tracks:" not in text


@pytest.mark.parametrize(
    ("code", "kept"),
    [(NoticeCode.CLOCK_SLIPPED, True), (NoticeCode.GIMBAL_UNUSED, True), (NoticeCode.LANDMARK_USED, False)],
)
def test_what_happened_to_clock_and_camera_is_in_summary_report_and_text(code, kept):
    log = TargetLog("0", {}, 0)
    for text in ("the clock slipped by 77 ms", "the clock slipped by 15 ms"):
        log.note(Notice(code, Severity.NOTICE, text))
    notices = msgspec.to_builtins(list(log.summary().notices))
    assert notices == ([{"code": code.value, "text": "the clock slipped by 77 ms", "times": 2}] if kept else [])
    said = "clock slipped by 77 ms (2 times in all)"
    assert (said in shown(notices=notices)) is kept
    report = page(flight_data([header(), target(0.0, 1.0, 1.0), summary(notices=notices)], title=""))
    assert (f"The {said}." in Markup(report).text) is kept
