"""A stream server's clock by the least delay: offset and rate are chosen, arrivals are drawn, the estimate is asked."""

import numpy as np
import pytest
from scipy.spatial import ConvexHull

from fwav_companion.geometry.hull import lower_hull
from fwav_companion.vision.server_clock import ServerClock

LATENCY_S = 0.12


def fed(clock, rng, *, offset_s, ppm=0.0, seconds=90.0, fps=30.0, jitter_s=0.02, begins_s=0.0):
    """Errors of the mapped captures, latency not counted. Host instants are true; the server's are off."""
    errors = []
    for capture_s in begins_s + np.arange(round(seconds * fps)) / fps:
        server_s = capture_s * (1.0 + 1e-6 * ppm) + offset_s
        clock.observe(server_s, capture_s + LATENCY_S + rng.exponential(jitter_s))
        errors.append(clock.host_from_server(server_s) - capture_s - LATENCY_S)
    return np.array(errors)


@pytest.mark.parametrize("ppm", [0.0, 50.0, -80.0])
@pytest.mark.parametrize("offset_s", [0.0, 1.7e9, 10800.0, -3.0])
def test_offset_and_drift_go_and_a_constant_latency_stays(offset_s, ppm):
    errors = fed(ServerClock(), np.random.default_rng(7), offset_s=offset_s, ppm=ppm)
    assert np.abs(errors[60:]).max() < 0.012, "after two seconds"
    assert np.abs(errors[900:]).max() < 0.004, "after half a minute"


def test_the_rate_is_that_of_the_clocks():
    clock = ServerClock()
    fed(clock, np.random.default_rng(3), offset_s=1.7e9, ppm=50.0, seconds=120.0)
    assert clock.rate == pytest.approx(-50e-6, abs=10e-6)


def test_a_stall_of_the_network_is_no_step():
    clock, rng = ServerClock(), np.random.default_rng(1)
    fed(clock, rng, offset_s=100.0, seconds=30.0)
    for capture_s in 30.0 + np.arange(20) / 30.0:
        assert not clock.observe(capture_s + 100.0, 32.0 + 0.001 * capture_s)
        assert clock.host_from_server(capture_s + 100.0) - capture_s == pytest.approx(LATENCY_S, abs=0.01)
    assert clock.steps == 0


@pytest.mark.parametrize("step_s", [-3600.0, -2.0, 0.5, 7200.0])
def test_a_step_of_the_servers_clock_begins_again(step_s):
    clock, rng = ServerClock(), np.random.default_rng(2)
    fed(clock, rng, offset_s=100.0, seconds=30.0)
    errors = fed(clock, rng, offset_s=100.0 + step_s, seconds=10.0, begins_s=30.0)
    assert clock.steps == 1
    assert np.abs(errors[60:]).max() < 0.015


def test_its_memory_is_bounded():
    clock = ServerClock()
    fed(clock, np.random.default_rng(4), offset_s=0.0, seconds=400.0, fps=5.0)
    assert len(clock._least) <= 120


def test_the_hull_is_that_of_qhull():
    rng = np.random.default_rng(5)
    points = np.sort(rng.normal(size=(50, 2)).view("f8,f8"), order="f0", axis=0).view(float)
    hull = lower_hull([tuple(point) for point in points])
    edges = ConvexHull(points)
    lower = {
        tuple(points[i])
        for simplex, n in zip(edges.simplices, edges.equations, strict=True)
        if n[1] < 0
        for i in simplex
    }
    assert set(hull) == lower
