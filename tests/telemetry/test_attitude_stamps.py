"""Attitude stamps: how late they are, by the autopilot, by the configuration, and by how they scatter."""

import random
from math import cos, pi, radians, sin

import pytest
from telemetry_messages import MS, WHOLE_MS, Autopilot, climbing, pitch_deg

from fwav_companion.geometry.stamps import BootNs
from fwav_companion.telemetry import StampDelay


@pytest.mark.parametrize(
    ("delay", "late_ms"),
    [(WHOLE_MS, 0.0), (0.0, 0.5), (0.0025, -0.75), (0.02, -9.5), ("auto", -0.75)],
)
def test_stamps_are_corrected_by_their_means(delay, late_ms):
    """Cut stamps are 0.5 ms early; an attitude is older than its stamp by half the most, on average."""
    autopilot = Autopilot(attitude_stamp_delay_s=delay)
    climbing(autopilot, 500)
    assert pitch_deg(autopilot, 303.0) == pytest.approx((303.0 - late_ms) / 1000.0, abs=1e-7)


def swinging(autopilot: Autopilot, scatter_ms: float, *, seed: int = 4) -> None:
    """5 degrees at 5 Hz for 2 s, 100 a second; attitudes are older than their stamps by uniform [0, scatter_ms]."""
    rng = random.Random(seed)
    for boot_ms in range(0, 2000, 10):
        t, w = (boot_ms - rng.uniform(0.0, scatter_ms)) * 1e-3, 10.0 * pi
        autopilot.send("ATTITUDE", boot_ms, pitch=radians(5.0) * sin(w * t), pitchspeed=radians(5.0) * w * cos(w * t))


@pytest.mark.parametrize(
    ("delay", "scatter_ms", "late_ms"),
    [
        (0.0, 0.0, 0.0),  # not 0.5 ms early: nothing scatters
        ("auto", 0.0, 0.0),
        (0.0025, 0.0, -0.75),  # configured is configured
        (0.0, 1.0, 0.5),
        ("auto", 2.5, -0.75),
    ],
)
def test_stamps_that_do_not_scatter_are_taken_at_their_word(delay, scatter_ms, late_ms):
    autopilot = Autopilot(attitude_stamp_delay_s=delay)
    swinging(autopilot, scatter_ms)
    asked_ms = 1500.0 + late_ms + 3.3
    if scatter_ms == 0.0:
        true_deg = 5.0 * sin(10.0 * pi * (asked_ms - late_ms) * 1e-3)
        assert pitch_deg(autopilot, asked_ms) == pytest.approx(true_deg, abs=2e-3)
    in_step = scatter_ms == 0.0
    assert autopilot.telemetry.status(autopilot.host(2000.0)).attitude_stamps_in_step is in_step
    reported = [event for event in autopilot.events if isinstance(event, StampDelay)]
    assert [event.in_step for event in reported] == ([True] if in_step and delay != 0.0025 else [])


def test_the_uncertainty_of_stamps_is_reported():
    left_open = {}
    for delay in (0.0, 0.0025, 0.02):
        autopilot = Autopilot(attitude_stamp_delay_s=delay)
        climbing(autopilot, 100)
        left_open[delay] = autopilot.telemetry.state_at(BootNs(50 * MS)).stamp_sigma_s
    assert left_open[0.0] == pytest.approx(0.8e-3 / 12**0.5)
    assert left_open[0.0025] < left_open[0.02] == pytest.approx(0.8 * 0.02 / 12**0.5, rel=0.01)


@pytest.mark.parametrize(
    ("name", "fields", "delay_s"),
    [
        ("PARAM_VALUE", {"param_id": "SCHED_LOOP_RATE", "param_value": 50.0}, 0.02),
        ("PARAM_VALUE", {"param_id": "SCHED_LOOP_RATE", "param_value": 1000.0}, 0.001),
        *(
            ("PARAM_VALUE", {"param_id": "SCHED_LOOP_RATE", "param_value": beyond}, 0.0025)
            for beyond in (float("nan"), -50.0, 0.0, 1e-30, 49.0, 2001.0, 1e10, float("inf"))
        ),
        ("PARAM_VALUE", {"param_id": "SYSID_THISMAV", "param_value": 50.0}, 0.0025),
        ("HEARTBEAT", {"type": 1}, 0.02),
        ("HEARTBEAT", {"type": 21}, 0.02),
        ("HEARTBEAT", {"type": 16}, 0.0025),
        ("HEARTBEAT", {"type": 1, "autopilot": 12}, 0.0025),
        ("STATUSTEXT", {"text": "ArduPlane V4.6.0 (abcdef)"}, 0.02),
        ("STATUSTEXT", {"text": "ArduCopter V4.6.0 (abcdef)"}, 0.0025),
    ],
)
def test_the_delay_of_stamps_follows_the_autopilot(name, fields, delay_s):
    autopilot = Autopilot(attitude_stamp_delay_s="auto")
    climbing(autopilot, 500)
    autopilot.send(name, 500, **fields)
    assert autopilot.telemetry.stamp_delay_s == pytest.approx(delay_s)
    assert [e.delay_s for e in autopilot.events if isinstance(e, StampDelay)] == (
        [delay_s] if delay_s != 0.0025 else []
    )
    # the kept samples moved with it: no step in the history
    assert pitch_deg(autopilot, 303.0) == pytest.approx((303.0 - 0.5 + delay_s * 500.0) / 1000.0, abs=1e-7)


def test_a_configured_delay_is_not_overruled():
    autopilot = Autopilot(attitude_stamp_delay_s=0.004)
    autopilot.send("PARAM_VALUE", 0, param_id="SCHED_LOOP_RATE", param_value=50.0)
    assert autopilot.telemetry.stamp_delay_s == 0.004
    assert autopilot.events == []
