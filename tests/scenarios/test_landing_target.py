"""LANDING_TARGET in whole flights: what an autopilot makes of it while clocks jump and cameras are late or gone.

The mock's own receiver places each message by the rules of its autopilot and compares it with the true pad.
"""

from itertools import pairwise
from math import hypot

import numpy as np
import pytest
from flying import Flight, fly

from fwav_companion.types import NoticeCode
from sitl_mock import scenario

DESCENT = scenario("descent").but(
    {
        "seed": 4,
        "seconds": 24.0,
        "flight.waypoints": ((0.0, -2.0, 1.0, 8.0, 30.0), (6.0, -2.0, 1.0, 8.0, 30.0), (22.0, 0.0, 0.0, 2.0, 30.0)),
    }
)
"""8 m to 2 m in 16 s, sideways by 2.2 m: 0.4 m/s on average."""
STEERED = (
    "publish.landing_target=true",
    'publish.landing_label="pad"',
    "camera.time_offset_s=0.04",
    "camera.readout_s=0.0",
    "tracking.self_calibration=false",
)
LIMIT_M = 0.5
"""landing_max_sigma_m, by default."""
STEADY_S = 9.0
"""Flight time from which the pad is known in every one of these flights: 3 s of frames that are 1 s late."""
SLIPS = {"autopilot.clock_slips": ((10.0, 0.17), (12.5, 0.1), (15.0, 0.15), (18.0, 0.12))}

TROUBLES = {
    "none": {},
    "slipping clock": SLIPS,
    "slow clock": {"autopilot.clock_rate": 0.985},
    "camera 1 s late": {"camera.latency_s": 1.0},
    "frames 0.9 s late": {"camera.late_every": 3, "camera.late_by_s": 0.9},
    "slipping clock, camera 1 s late": {**SLIPS, "camera.latency_s": 1.0},
    "silent clock": {"autopilot.answers_timesync": False},
}
QUICK = (("slipping clock", "ardupilot"), ("camera 1 s late", "ardupilot"), ("camera 1 s late", "px4"))
"""Flights of the default run."""
CASES = [
    pytest.param(trouble, firmware, marks=() if (trouble, firmware) in QUICK else pytest.mark.slow)
    for trouble in TROUBLES
    for firmware in ("ardupilot", "px4")
]


def flown(changes: dict[str, object], *settings: str) -> Flight:
    return fly(DESCENT.but(changes), (*STEERED, *settings))


def messages(flight: Flight) -> list[tuple[float, float]]:
    """(flight time of the sending, that of ``time_usec``) of every message, seconds."""
    mock = flight.mock
    return [
        (mock.flight_s(now), mock.flight_s(each.fields["time_usec"] * 1000))
        for now, each in flight.companion.sent
        if each.name == "LANDING_TARGET"
    ]


def horizontal_errors_m(flight: Flight, from_s: float = STEADY_S) -> np.ndarray:
    """Distances of the places accepted from this flight time on from the true pad, in the horizontal, metres."""
    true = flight.mock.scene[0].at(0.0)
    return np.array(
        [
            hypot(each["north"] - true[0], each["east"] - true[1])
            for each in flight.accepted_landings
            if each["flight_s"] >= from_s
        ]
    )


@pytest.mark.parametrize(("trouble", "firmware"), CASES)
def test_landing_target_with_a_bad_clock_or_a_late_camera_flows_and_is_right(trouble: str, firmware: str):
    """By the limit, one sigma, 0.5 m is allowed: it holds for 95 % of what flows, and three sigma for all of it."""
    flight = flown({**TROUBLES[trouble], "autopilot.firmware": firmware})
    sent = messages(flight)
    assert not flight.refused_landings
    assert all(stamp <= now + 1e-6 for now, stamp in sent), "never in the future"
    assert all(before < after for (_, before), (_, after) in pairwise(sent)), "always rising"
    steady = [now for now, _ in sent if now >= STEADY_S]
    assert steady[0] < STEADY_S + 0.5
    assert max(np.diff(steady)) < 0.5, "ArduPilot starts its filter again after such a gap"
    errors = horizontal_errors_m(flight)
    assert np.median(errors) < 0.2
    assert np.percentile(errors, 95) < LIMIT_M
    assert errors.max() < 3.0 * LIMIT_M, "while the clock pauses, before an exchange shows it"
    assert not flight.companion.texts(NoticeCode.LANDING_WITHHELD)


def test_landing_target_of_a_camera_that_stops_flows_for_a_second_and_a_half_and_is_reported():
    stop_s = 15.0
    flight = flown({"camera.stops_at_s": stop_s})
    last_s = messages(flight)[-1][0]
    assert stop_s + 1.2 < last_s < stop_s + 1.6
    errors = horizontal_errors_m(flight, from_s=stop_s)
    assert len(errors) >= 5
    assert max(errors) < LIMIT_M
    (text,) = flight.companion.texts_to_ground(NoticeCode.LANDING_WITHHELD)
    assert text.startswith("LANDING_TARGET withheld: no picture for ")
    assert not flight.companion.texts(NoticeCode.LANDING_SENT)


def test_landing_target_of_a_camera_1_7_s_late_is_withheld_and_the_pilot_reads_the_delay():
    flight = flown({"camera.latency_s": 1.7})
    assert not messages(flight)
    (text,) = flight.companion.texts_to_ground(NoticeCode.LANDING_WITHHELD)
    assert text == "LANDING_TARGET withheld: camera 1.7 s late"


def test_landing_target_beyond_its_limit_is_reported_once_and_again_when_it_flows():
    """From 8 m the mount's prior alone is 0.2 m; from 2 m it is 0.05 m."""
    flight = flown({}, "publish.landing_max_sigma_m=0.15")
    (withheld,) = flight.companion.texts_to_ground(NoticeCode.LANDING_WITHHELD)
    (flows,) = flight.companion.texts_to_ground(NoticeCode.LANDING_SENT)
    assert withheld.startswith("LANDING_TARGET withheld: target 0.")
    assert withheld.endswith(" m, limit 0.15")
    assert flows.startswith("LANDING_TARGET is sent: target 0.")
    assert max(map(len, (withheld, flows))) <= 50


def test_pilot_reads_the_landing_from_the_first_sight_to_the_disarming():
    flight = flown({"autopilot.disarms_at_s": 23.0})
    (seen,) = flight.companion.texts_to_ground(NoticeCode.LANDING_IN_SIGHT)
    (landed,) = flight.companion.texts_to_ground(NoticeCode.LANDED)
    assert seen.startswith("pad seen: ")
    assert landed.startswith("landed: pad 0.")
    assert landed.endswith(" 0 s ago")
    assert max(map(len, (seen, landed))) <= 50
