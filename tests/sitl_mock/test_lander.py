"""The mock's copter that lands by LANDING_TARGET: its estimate's time line, its descent, and where it comes down."""

from math import cos, hypot, sin, tan

import numpy as np
import pytest

from sitl_mock import scenario, simulate
from sitl_mock.lander import LAND_SPEED_M_S
from sitl_mock.precland_filter import FOUND, FOUND_S, GAP_S, LOST, LOST_S, RelativeTarget
from sitl_mock.rotation import minus

STEP_S, GRAVITY = 1.0 / 30.0, 9.80665
START = scenario("land").but({"lander.gust_m_s2": 0.0})


def flown(until_s=60.0, off_m=(0.0, 0.0), options=START, seen=lambda t: True):
    """The mock, whose lander hears the exact vector at each frame in which the pad is seen, off by a distance."""
    mock = simulate(options)
    pad = mock.scene[0]
    for frame in range(int(until_s / STEP_S)):
        t = frame * STEP_S
        north, east, down = minus(pad.at(t), mock.flight.at(t).position)
        if seen(t):
            mock.lander.hear((north + off_m[0], east + off_m[1], down), frame, t)
        if mock.lander.touchdown is not None:
            break
    return mock


def landed(**how):
    return flown(**how).lander


def test_copter_with_exact_vectors_comes_down_on_the_pad():
    lander = landed()
    assert lander.touchdown.miss_m < 0.01
    assert lander.texts == [FOUND]


def test_copter_comes_down_where_its_vectors_point():
    north, east = landed(off_m=(0.3, -0.2)).touchdown.off_m
    assert north == pytest.approx(0.3, abs=0.02)
    assert east == pytest.approx(-0.2, abs=0.02)


def test_copter_without_a_vector_lands_where_it_was_held():
    touchdown = landed(seen=lambda t: False).touchdown
    assert touchdown.off_m == pytest.approx(START.flight.offset_m, abs=0.01)
    fall_s = (START.flight.height_m - START.lander.gear_m) / LAND_SPEED_M_S
    assert touchdown.at_s - START.lander.at_s == pytest.approx(fall_s, abs=1.0)


def test_copter_that_loses_its_target_lands_where_it_is_then():
    mock = flown(seen=lambda t: t < 6.5)
    lander, lost_s = mock.lander, 6.5 + LOST_S
    assert lander.texts == [FOUND, LOST]
    off_m = minus(mock.flight.at(lost_s).position, mock.scene[0].at(lost_s))[:2]
    assert hypot(*off_m) < 0.9 * hypot(*START.flight.offset_m), "it was on its way to the pad"
    assert lander.touchdown.off_m == pytest.approx(off_m, abs=0.05)


def test_copter_stays_up_while_its_target_is_farther_than_it_may_be():
    mock = flown(options=START.but({"flight.offset_m": (3.2, 0.0)}))
    ways = [minus(mock.scene[0].at(t), mock.flight.at(t).position) for t in np.arange(6.0, 9.0, 0.01)]
    far_m = [down for north, east, down in ways if hypot(north, east) > 2.55]
    assert len(far_m) > 20
    assert min(far_m) > START.flight.height_m - 0.02
    assert mock.lander.touchdown.miss_m < 0.05


def test_copter_sinks_at_the_landing_speed_and_half_as_fast_near_the_ground():
    mock, speed_m_s = flown(), LAND_SPEED_M_S
    times = np.arange(6.0, mock.lander.touchdown.at_s, 0.01)
    heights_m = np.array([-mock.flight.at(t).position[2] for t in times])
    at_s = {height_m: times[np.argmax(heights_m < height_m)] for height_m in (4.5, 2.5, 1.7, 0.7)}
    assert at_s[2.5] - at_s[4.5] == pytest.approx(2.0 / speed_m_s, abs=0.1)
    assert at_s[0.7] - at_s[1.7] == pytest.approx(1.0 / (0.5 * speed_m_s), abs=0.3)


def test_copter_moves_along_with_a_moving_deck_comes_down_on_it_and_stays():
    options = scenario("land_boat").but({"lander.gust_m_s2": 0.0})
    mock = flown(options=options)
    touchdown = mock.lander.touchdown
    assert touchdown.miss_m < 0.05
    for later_s in (0.5, 1.7, 3.1):
        t = touchdown.at_s + later_s
        north, east, down = minus(mock.scene[0].at(t), mock.flight.at(t).position)
        assert (-north, -east) == pytest.approx(touchdown.off_m, abs=0.01)
        assert down == pytest.approx(options.lander.gear_m, abs=0.01)


@pytest.fixture(scope="module")
def level():
    """The motion of a landing on a pad, of a vehicle that tilts only to accelerate."""
    return flown(options=START.but({"flight.wander_deg": 0.0})).flight


@pytest.mark.parametrize("t", [6.503, 7.0061, 8.253])
def test_velocity_and_rates_are_the_derivatives_of_the_motion(level, t):
    h = 1e-4
    before, now, after = (level.at(t + d) for d in (-h, 0.0, h))
    slope = [(b - a) / (2.0 * h) for a, b in zip(before.position, after.position, strict=True)]
    assert now.velocity == pytest.approx(slope, abs=1e-3)
    roll_rate, pitch_rate, _ = ((b - a) / (2.0 * h) for a, b in zip(before.euler, after.euler, strict=True))
    roll = now.euler[0]
    assert min(abs(roll_rate), abs(pitch_rate)) > 0.01
    assert now.rates == pytest.approx((roll_rate, pitch_rate * cos(roll), -pitch_rate * sin(roll)), abs=1e-4)


@pytest.mark.parametrize("t", [6.503, 7.0061, 8.253])
def test_copter_tilts_toward_its_acceleration(level, t):
    """A level thrust of one g accelerates it forward where its nose is down, and right where it rolls right."""
    h = 1e-4
    before, now, after = (level.at(t + d) for d in (-h, 0.0, h))
    north, east = ((after.velocity[k] - before.velocity[k]) / (2.0 * h) for k in (0, 1))
    roll, pitch, yaw = now.euler
    assert hypot(north, east) > 0.02
    assert north * cos(yaw) + east * sin(yaw) == pytest.approx(-GRAVITY * tan(pitch), abs=1e-3)
    assert east * cos(yaw) - north * sin(yaw) == pytest.approx(GRAVITY * tan(roll), abs=1e-3)


def heard(target, from_s, to_s, place=(1.0, 2.0)):
    """The texts while a target is heard at each frame from one time to another."""
    texts = []
    for frame in range(round(from_s / STEP_S), round(to_s / STEP_S)):
        texts += target.advance(frame * STEP_S)
        target.hear(place, 3.0, frame, frame * STEP_S)
    return texts


def test_target_is_found_after_two_seconds_of_vectors():
    target = RelativeTarget()
    assert heard(target, 0.0, FOUND_S - 0.1) == []
    assert target.followed is None
    assert heard(target, FOUND_S - 0.1, FOUND_S + 0.1) == [FOUND]
    assert target.followed[0] == pytest.approx((1.0, 2.0))


def test_gap_before_it_is_found_begins_the_two_seconds_again():
    target = RelativeTarget()
    heard(target, 0.0, FOUND_S - 0.1)
    target.advance(FOUND_S + GAP_S)
    assert heard(target, FOUND_S + GAP_S, FOUND_S + GAP_S + 1.5) == []


def test_target_is_lost_two_seconds_after_its_last_vector():
    target = RelativeTarget()
    heard(target, 0.0, 3.0)
    assert target.advance(3.0 + LOST_S - 0.1) == []
    assert target.advance(3.0 + LOST_S + 0.1) == [LOST]
    assert target.followed is None


def test_stamp_that_stands_still_is_one_vector():
    target = RelativeTarget()
    assert target.hear((0.0, 0.0), 3.0, 7, 0.0)
    assert not target.hear((0.0, 0.0), 3.0, 7, 0.0)


def test_three_outliers_in_a_row_are_rejected_and_the_fourth_is_taken():
    target = RelativeTarget()
    heard(target, 0.0, 3.0)
    assert [target.hear((2.0, 2.0), 3.0, stamp, 3.0) for stamp in range(1000, 1004)] == [False, False, False, True]


def test_outlier_is_rejected_from_a_normalised_square_of_three_on():
    """The gate's width by the same filter in matrices: 2.5 m/s^2 of noise in each of 400 loops a second."""
    down_m, target = 3.0, RelativeTarget()
    heard(target, 0.0, 3.0)
    step, position = np.array([[1.0, STEP_S], [0.0, 1.0]]), np.array([[1.0, 0.0]])
    noise = np.diag([0.0, STEP_S * 400.0 * (2.5 / 400.0) ** 2])
    variance = (0.01 * down_m + 0.02) ** 2
    cov = np.diag([variance, 2.0**2])
    for _ in range(1, 90):
        cov = step @ cov @ step.T + noise
        gain = cov @ position.T / (cov[0, 0] + variance)
        cov = cov - gain @ position @ cov
    width_m = np.sqrt(3.0 * (cov[0, 0] + variance))
    assert not target.hear((1.0 + 1.02 * width_m, 2.0), down_m, 1000, 3.0)
    assert target.hear((1.0 + 0.98 * width_m, 2.0), down_m, 1001, 3.0)


def test_late_vector_of_a_moving_target_counts_up_to_now():
    target, speed_m_s, late_s = RelativeTarget(), 1.0, 0.2
    for frame in range(180):
        now_s = frame * STEP_S
        target.advance(now_s)
        target.hear((speed_m_s * (now_s - late_s), 0.0), 3.0, frame, now_s - late_s)
    (north, _), (velocity, _) = target.followed
    assert velocity == pytest.approx(speed_m_s, abs=0.02)
    assert north == pytest.approx(speed_m_s * now_s, abs=0.03)
