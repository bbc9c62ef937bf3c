"""The rates of attitudes in flight: numbered troubles, each with what is reported and what then comes."""

from __future__ import annotations

import pytest
from timed_flights import held_back, seen

from fwav_companion.types import NoticeCode

# (number, trouble, scenario, difference, the message attitudes come from, its rate, what the log says)

RATES = [
    (
        401,
        "a ground station takes them every 10 s",
        "gcs_thief",
        {"seconds": 26.0},
        "ATTITUDE_QUATERNION",
        100,
        NoticeCode.RATE_FELL,
    ),
    (402, "at most 0.8 of a loop of 50 Hz", "slow_loop", {}, "ATTITUDE_QUATERNION", 40, NoticeCode.RATE_REFUSED),
    (403, "only REQUEST_DATA_STREAM", "old_rates", {}, "ATTITUDE", 100, NoticeCode.INTERVALS_UNKNOWN),
    (404, "no quaternion", "no_quaternion", {}, "ATTITUDE", 100, NoticeCode.PITCH_TRIM_RESTORED),
    (405, "a reboot forgets them", "rebooting", {}, "ATTITUDE_QUATERNION", 100, NoticeCode.AUTOPILOT_REBOOTED),
    (406, "acknowledged and not sent", "px4_slow", {}, "ATTITUDE_QUATERNION", 18.4, NoticeCode.NOT_READY_SLOW_ATTITUDE),
]


@pytest.mark.parametrize(
    ("name", "differences", "message", "hz", "said"),
    [row[2:] for row in RATES],
    ids=[f"{number} {trouble}" for number, trouble, *_ in RATES],
)
def test_rates(name, differences, message, hz, said):
    flown = seen(name, **differences)
    status = flown.companion.pipeline.status(flown.mock.end_ns)
    assert status.telemetry.attitude_source == message
    assert status.telemetry.rates_hz[message] == pytest.approx(hz, rel=0.05)
    assert said in flown.companion.codes


def test_407_the_thief_is_named_where_check_looks():
    flown = seen("gcs_thief", seconds=26.0)
    undone_by = flown.companion.pipeline.status(flown.mock.end_ns).rates["ATTITUDE_QUATERNION"].undone_by
    assert "255/190" in undone_by
    lost = held_back(flown)
    assert lost["stale_attitude"] + lost["attitude_gap"] < 2 * 10 * 3.0, "three seconds for each of two thefts"
