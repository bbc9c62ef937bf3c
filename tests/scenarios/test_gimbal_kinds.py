"""Kinds of gimbals and of mistakes in what they report: targets on both sides, located within their claims.

Biases are drawn from the priors of the configuration, so that errors are compared with claims, not with zero. A flight
is one draw of its biases: each kind is flown with a few seeds, and the bounds are the 99.9 % limits of so many draws.
"""

import msgspec
import numpy as np
import pytest
from flying import fly
from scipy.stats import chi2

from fwav_companion.tracking.smoothed.solve_jobs import SmootherOptions
from fwav_companion.types import NoticeCode
from sitl_mock import Options, TargetOptions, scenario

BEHIND_AUTOPILOT, OWN_COMPONENT = 1, 154
BOTH_SIDES = (
    TargetOptions(label="left", north=1.5, east=-3.0),
    TargetOptions(label="right", north=1.5, east=3.0),
)
COPTER = {
    "flight.pattern": "hover",
    "flight.pitch_deg": 4.0,
    "flight.flapping_pitch_deg": 5.0,
    "flight.flapping_roll_deg": 4.0,
    "flight.flapping_hz": 0.6,
    "flight.offset_m": (-5.0, 0.0),
}
KINDS = {
    "stabilised": {},
    "servo": {"gimbal.kind": "servo", "gimbal.yaw": "vehicle", "gimbal.device_id": BEHIND_AUTOPILOT, **COPTER},
    "yaw_follow": {"gimbal.yaw": "vehicle"},
    "own_zero": {"gimbal.yaw": "vehicle_and_delta", "gimbal.yaw_zero_deg": 70.0},
    "own_zero_earth": {"gimbal.yaw": "north_and_delta", "gimbal.yaw_zero_deg": 70.0},
    "slow": {"gimbal.rate_hz": 2.5, "gimbal.yaw": "vehicle"},
    "late": {"gimbal.late_s": 0.08},
    "reset": {"gimbal.resets_at_s": 6.0},
    "straight_down": {"gimbal.pitch_deg": -90.0, "gimbal.swing_deg": 3.0, **COPTER, "flight.offset_m": (1.5, 0.0)},
    "orientation_only": {
        "gimbal.message": "MOUNT_ORIENTATION",
        "gimbal.yaw": "vehicle",
        "gimbal.device_id": BEHIND_AUTOPILOT,
        "autopilot.rates_hz": {"MOUNT_ORIENTATION": 10.0},
    },
    "two_gimbals": {"gimbal.second_id": 155},
}


def flown(kind, seed=1, *, smoother=None, **differences):
    options = scenario("gimbal", Options(seed=seed)).but(
        {
            "seconds": 10.0,
            "targets": BOTH_SIDES,
            "gimbal.yaw_deg": 0.0,
            "camera.clutter": 0.0,
            **KINDS[kind],
            **differences,
        }
    )
    settings = [f"camera.mount.gimbal_device_id={options.gimbal.device_id}", "camera.mount.pitch_deg=0.0"]
    if options.gimbal.late_s:
        settings.append(f"camera.mount.gimbal_delay_s={options.gimbal.late_s}")
    return fly(options, settings, smoother=smoother)


def squares(flight, lines):
    """Normalised squares of the horizontal errors of these lines of targets."""
    found = []
    for line in lines:
        index = [target.label for target in flight.options.targets].index(line.label)
        true = flight.mock.scene[index].at(flight.seen_at_s(line))
        error = np.array((line.north - true[0], line.east - true[1]))
        found.append(float(error @ np.linalg.solve(np.array(line.cov)[:2, :2], error)))
    return found


def fixes_of(flight, label):
    """Lines of the targets of this label in which a fix is, with the fix as their place."""
    return [
        msgspec.structs.replace(line, **msgspec.structs.asdict(line.fix))
        for line in flight.companion.targets(label)
        if line.fix
    ]


def first_and_last(kind, seed):
    """Squares of the first and of the last fix of each target, of one side first."""
    number = 100 * list(KINDS).index(kind) + seed
    flight = flown(kind, number)
    return within(flight, BOTH_SIDES[number % 2].label, BOTH_SIDES[1 - number % 2].label)


def within(flight, *labels):
    """Squares of the first and of the last fix of each of these targets."""
    found = [fixes_of(flight, label) for label in labels]
    assert all(found), f"no fix of a target: {flight.companion.lines[-1]['dropped']}"
    return [squares(flight, [fixes[0], fixes[-1]]) for fixes in found]


FLIGHTS = [pytest.param(1), pytest.param(3, marks=pytest.mark.slow)]
MOST = chi2.ppf(1.0 - 1e-3 / (3 * len(KINDS)), 2)
"""Largest square that one of all draws of the slow run has in one run of a thousand."""


@pytest.mark.parametrize("flights", FLIGHTS)
def test_first_and_last_answers_of_every_kind_are_as_good_as_they_claim(flights):
    """The sum is of one side alone: both sides of a flight share its biases."""
    drawn = {(kind, seed): first_and_last(kind, seed) for kind in KINDS for seed in range(1, flights + 1)}
    low, high = chi2.ppf([0.0005, 0.9995], 2 * len(drawn))
    for which in (0, 1):
        one, other = ({key: sides[side][which] for key, sides in drawn.items()} for side in (0, 1))
        assert max(*one.values(), *other.values()) < MOST, (one, other)
        assert low < sum(one.values()) < high, one


def test_gimbal_that_is_80_ms_late_without_a_word_in_the_configuration_is_within_the_claim():
    """1.6 sigma of the prior of gimbal_delay_s."""
    options = flown("late", 501, **{"biases.gimbal_delay_s": 0.0}).options
    flight = fly(options, ["camera.mount.gimbal_device_id=154", "camera.mount.pitch_deg=0.0"])
    assert max(each for side in within(flight, "left", "right") for each in side) < MOST


@pytest.mark.parametrize("kind", KINDS)
def test_two_targets_are_two_tracks(kind):
    flight = flown(kind, 100 * list(KINDS).index(kind) + 1)
    assert len({line.track for line in flight.companion.targets()}) == len(BOTH_SIDES)


def test_two_targets_below_a_servo_mount_are_two_tracks_of_the_smoother():
    """Its angles count from the body, which its motion shows after some seconds: taken as levelled they made 12 tracks,
    and without the noise of the other reading before that four.
    """
    flight = flown("servo", 101, smoother=SmootherOptions())
    assert {line.label for line in flight.companion.targets()} == {"left", "right"}
    assert len({line.track for line in flight.companion.targets()}) == len(BOTH_SIDES)


def test_yaw_zero_of_a_gimbal_is_reported_with_its_number_and_moves_no_target():
    right, wrong = (flown("own_zero", 301, **{"gimbal.yaw_zero_deg": deg}) for deg in (0.0, 70.0))
    (text,) = wrong.companion.texts(NoticeCode.GIMBAL_HEADING)
    off_deg = 70.0
    assert abs(float(text.split(" deg off")[0].split()[-1]) - off_deg) <= 2.0
    assert not right.companion.texts(NoticeCode.GIMBAL_HEADING)
    for one, other in zip(fixes_of(right, "left"), fixes_of(wrong, "left"), strict=True):
        assert (one.north, one.east) == pytest.approx((other.north, other.east), abs=0.02)


@pytest.mark.parametrize(
    ("differences", "reason"),
    [
        ({"gimbal.yaw": "both_frames"}, "gimbal_flags"),
        (
            {**KINDS["orientation_only"], "autopilot.firmware": "px4", "autopilot.pitch_trim_deg": 0.0},
            "gimbal_setpoint",
        ),
        ({"gimbal.rate_hz": 1.0, "seconds": 10.0}, "gimbal_gap"),
    ],
)
def test_attitudes_that_cannot_be_used_are_refused_by_name(differences, reason):
    flight = flown("stabilised", **{"seconds": 6.0, **differences})
    assert flight.companion.lines[-1].dropped[reason] > 10


def test_levelled_by_configuration_gives_a_servo_mount_its_claim_from_the_first_fix():
    auto = flown("servo", 101)
    stated = fly(
        auto.options,
        ["camera.mount.gimbal_device_id=1", "camera.mount.pitch_deg=0.0", "camera.mount.levelled=false"],
    )
    assert "gimbal_horizon" not in stated.companion.lines[-1].dropped
    first = fixes_of(stated, "left")[0]
    assert first.time_unix <= fixes_of(auto, "left")[0].time_unix
    assert squares(stated, [first])[0] < MOST
