"""What crosses the 180th meridian is cut there (RFC 7946, 3.1.9): nothing is lost, nothing added, nothing beyond."""

import math
from itertools import pairwise

import pytest
from hypothesis import example, given
from hypothesis import strategies as st

from fwav_companion.recording.exports.date_line import cut_line, cut_ring


def wrapped(lon):
    return (lon + 180.0) % 360.0 - 180.0


def area(ring):
    """Twice the shoelace's half, positive counter-clockwise; about its first point, for the digits' sake."""
    (x0, y0), *_ = ring
    moved = [(x - x0, y - y0) for x, y in ring]
    return 0.5 * sum(a * d - b * c for (a, b), (c, d) in pairwise(moved))


def circle(lon, lat, radius, corners=48):
    turns = [2.0 * math.pi * (corner % corners) / corners for corner in range(corners + 1)]
    return [(wrapped(lon + radius * math.cos(turn)), lat + radius * math.sin(turn)) for turn in turns]


@given(st.floats(179.0, 181.0), st.floats(-80.0, 80.0), st.floats(1e-5, 0.9))
def test_a_ring_keeps_its_inside(lon, lat, radius):
    parts = cut_ring(circle(wrapped(lon), lat, radius))
    assert len(parts) in (1, 2)
    assert sum(map(area, parts)) == pytest.approx(area(circle(0.0, lat, radius)), rel=1e-6, abs=1e-12)
    for part in parts:
        assert part[0] == part[-1]
        assert len(part) >= 4
        assert area(part) > 0.0, "counter-clockwise"
        lons = [lon for lon, _ in part]
        assert -180.0 <= min(lons) < max(lons) <= 180.0
        assert max(lons) - min(lons) <= 2.0 * radius + 1e-9


def test_a_ring_that_only_touches_the_meridian_is_one():
    square = [(-180.0, 0.0), (179.0, 0.5), (178.0, 0.0), (179.0, -0.5), (-180.0, 0.0)]
    assert [len(part) for part in cut_ring(square)] == [5]


@example([0.1, 0.1], 179.9)  # a place on the very meridian, where the line is cut as well
@given(st.lists(st.floats(-0.4, 0.4), min_size=2, max_size=30), st.sampled_from([179.9, -179.9, 12.0]))
def test_a_line_keeps_its_way(steps, start):
    lons = [start]
    for step in steps:
        lons.append(wrapped(lons[-1] + step))
    line = [(lon, 0.1 * index) for index, lon in enumerate(lons)]
    parts = cut_line(line)
    way = sum(abs(b[0] - a[0]) for part in parts for a, b in pairwise(part))
    assert way == pytest.approx(sum(map(abs, steps)), abs=1e-9)
    last = len(parts) - 1
    told = [part[0 if k == 0 else 1 : None if k == last else -1] for k, part in enumerate(parts)]  # without the cuts
    assert [place for part in told for place in part] == line
    for before, after in pairwise(parts):
        assert before[-1] == pytest.approx((-after[0][0], after[0][1]))
        assert abs(after[0][0]) == 180.0
