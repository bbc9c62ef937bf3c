"""The measured rate of messages: steady, after silences, and after a process was stopped."""

from __future__ import annotations

import pytest

from fwav_companion.geometry.stamps import NS_PER_S, HostNs
from fwav_companion.telemetry import RateMeter

START_NS = 5_000 * NS_PER_S


def at(seconds: float) -> HostNs:
    return HostNs(START_NS + round(seconds * NS_PER_S))


def steady(meter: RateMeter, hz: float, begin_s: float, end_s: float) -> None:
    for k in range(round((end_s - begin_s) * hz)):
        meter.count("ATTITUDE", at(begin_s + k / hz))


@pytest.mark.parametrize("asks_first", [False, True], ids=["a message first", "the status first"])
def test_rate_after_a_stop_of_ten_seconds_is_that_of_the_stream_not_of_its_backlog(asks_first: bool) -> None:
    meter = RateMeter()
    steady(meter, 100.0, 0.0, 10.0)
    if asks_first:
        meter.rates_hz(at(20.0))
    for k in range(800):  # what the socket's buffer kept, at once
        meter.count("ATTITUDE", at(20.0 + 0.0001 * k))
    for k in range(99):
        steady(meter, 100.0, 20.1 + 0.1 * k, 20.2 + 0.1 * k)
        assert all(rate < 110.0 for rate in meter.rates_hz(at(20.2 + 0.1 * k)).values())
    assert meter.rates_hz(at(30.0))["ATTITUDE"] == pytest.approx(100.0, rel=0.02)


def test_rate_of_a_stream_that_returns_after_silence_is_known_again_within_three_seconds() -> None:
    meter = RateMeter()
    steady(meter, 20.0, 0.0, 6.0)
    steady(meter, 20.0, 60.0, 63.0)
    assert meter.rates_hz(at(63.0))["ATTITUDE"] == pytest.approx(20.0, rel=0.05)


def test_rate_of_photographs_seconds_apart_is_counted() -> None:
    meter, seen = RateMeter(), []
    for k in range(30):
        meter.count("frames", at(4.0 * k))
        seen.append(meter.rates_hz(at(4.0 * k + 2.1)).get("frames", 0.0))
    assert max(seen) == pytest.approx(0.5)
