"""Vertical velocities that heights contradict are those of a heaving body; all others stay as reported."""

from math import cos, pi, sin
from random import Random

import pytest
from telemetry_messages import Autopilot

from fwav_companion.geometry.stamps import BootNs
from fwav_companion.telemetry.climb import ClimbCheck

HEIGHT_NOISE_M, VELOCITY_NOISE_M_S = 0.3, 0.05


def reported(path, *, seconds=40.0, hz=10.0, heave_hz=0.0, heave_m=0.02, seed=1):
    """(true climb rate, reported one, the one of the path) at each position. ``path``: height and climb rate."""
    random, check, found = Random(seed), ClimbCheck(), []
    for k in range(round(seconds * hz)):
        t = k / hz
        height_m, true_m_s = path(t)
        angle = 2.0 * pi * heave_hz * t
        heave_m_s = 2.0 * pi * heave_hz * heave_m * cos(angle) if heave_hz else 0.0
        climb_m_s = true_m_s + heave_m_s + random.gauss(0.0, VELOCITY_NOISE_M_S)
        seen_m = height_m + heave_m * sin(angle) + random.gauss(0.0, HEIGHT_NOISE_M)
        found.append((true_m_s, climb_m_s, check.climb_at(BootNs(round(t * 1e9)), seen_m, climb_m_s)))
    return found


@pytest.mark.parametrize("heave_hz", [9.6, 9.8, 9.99, 10.3])
@pytest.mark.parametrize("climb_m_s", [0.0, 0.5])
@pytest.mark.parametrize("seed", range(3))
def test_a_heave_near_the_rate_of_positions_is_no_climb(heave_hz, climb_m_s, seed):
    """After ten seconds the velocities are within 0.3 m/s of the path's, where 1.3 m/s are reported."""
    late = reported(lambda t: (12.0 + climb_m_s * t, climb_m_s), heave_hz=heave_hz, seed=seed)[110:]
    assert max(abs(said - true) for true, said, _ in late) > 1.0
    assert max(abs(used - true) for true, _, used in late) < 0.3


@pytest.mark.parametrize("hz", [4.0, 10.0, 50.0])
@pytest.mark.parametrize("seed", range(3))
def test_climbs_and_descents_stay_as_reported(hz, seed):
    """Up and down by 2 m/s with accelerations of up to 2.5 m/s^2, heights noisy by 0.3 m."""
    found = reported(lambda t: (12.0 - 1.6 * cos(1.25 * t), 2.0 * sin(1.25 * t)), hz=hz, seed=seed)
    assert all(used == said for _, said, used in found)


@pytest.mark.parametrize("heave_hz", [5.0, 7.0, 13.0])
def test_a_heave_that_averages_out_stays_as_reported(heave_hz):
    assert all(used == said for _, said, used in reported(lambda t: (12.0, 0.0), heave_hz=heave_hz))


def test_heights_that_wander_slowly_do_not_contradict_velocities():
    """0.4 m within ten seconds, as an autopilot's altitude near the ground."""
    random, check = Random(3), ClimbCheck()
    for k in range(400):
        t = k / 10.0
        height_m = 10.0 + 0.4 * sin(2.0 * pi * t / 20.0) + random.gauss(0.0, 0.05)
        assert check.climb_at(BootNs(round(t * 1e9)), height_m, 0.0) == 0.0


@pytest.mark.parametrize("jump_m", [0.5, 1.0, 1.9, 3.0, 50.0])
@pytest.mark.parametrize("seed", range(3))
def test_a_home_that_moves_is_no_contradiction(jump_m, seed):
    """Heights above home jump; climb rates do not."""
    found = reported(lambda t: (12.0 + jump_m * (t > 20.0) + 0.3 * t, 0.3), seed=seed)
    assert all(used == said for _, said, used in found)


def test_velocities_count_again_after_the_heave():
    """A fixed wing that flapped to take off."""
    flapped = reported(lambda t: (12.0, 0.0), seconds=90.0, heave_hz=9.8)
    check, glided = ClimbCheck(), list[tuple[float, float]]()
    for k in range(1500):
        t, said = k / 10.0, flapped[k][1] if k < 300 else 0.1
        height_m = 12.0 if k < 300 else 12.0 + 0.1 * (t - 30.0)
        glided.append((said, check.climb_at(BootNs(k * 100_000_000), height_m, said)))
    assert max(abs(used) for _, used in glided[100:300]) < 0.2 < max(abs(said) for said, _ in glided[100:300])
    assert all(used == said for said, used in glided[900:])


def test_positions_after_a_gap_or_from_before_start_again():
    check = ClimbCheck()
    for k in range(100):
        check.climb_at(BootNs(k * 100_000_000), 12.0, 1.0)
    assert check.climb_at(BootNs(10_000_000_000), 12.0, 1.0) == pytest.approx(0.0)
    assert check.climb_at(BootNs(12_000_000_000), 12.0, 1.0) == 1.0
    assert check.climb_at(BootNs(11_000_000_000), 12.0, 1.0) == 1.0


def test_states_have_the_climb_of_the_path():
    """Velocity and height between positions of a level vehicle that reports a heave as a climb of 1.2 m/s."""
    autopilot = Autopilot()
    for boot_ms in range(0, 10_000, 100):
        autopilot.send("GLOBAL_POSITION_INT", boot_ms, vz=-120)
    autopilot.attitudes(9_000, 10_000)
    state = autopilot.telemetry.state_at(BootNs(9_850_000_000))
    assert state.velocity_ned[2] == pytest.approx(0.0, abs=0.01)
    assert state.height_above_home_m == pytest.approx(10.0, abs=0.002)
