"""Fixes that may be displaced ones of a missed target."""

from types import SimpleNamespace

import numpy as np
import pytest
from handmade import a_fix

from fwav_companion.tracking.frame_update import Absent, absent

PLACE = (4.0, 3.0, 0.0)
SIGMA_M = np.sqrt(0.03 + 0.04)
"""Of a target and a fix together."""
STANDING = SimpleNamespace(apparent_ned=PLACE, relative_cov=((0.03, 0.0, 0.0), (0.0, 0.03, 0.0), (0.0, 0.0, 0.0)))


def a_track(number, *, confirmed=True, label=""):
    return SimpleNamespace(id=number, target=STANDING, confirmed=confirmed, label=label)


def fix_at(north, east=0.0, label=""):
    return a_fix(0.0, (PLACE[0] + north, PLACE[1] + east, 0.0), label=label)


@pytest.mark.parametrize(
    ("off", "may"), [((7.9, 0.0), True), ((8.1, 0.0), False), ((0.0, -7.9), True), ((0.0, 8.1), False)]
)
def test_a_fix_may_be_displaced_by_eight_sigma_of_both_along_each_axis(off, may):
    assert Absent([a_track(1)], None).may_explain(fix_at(off[0] * SIGMA_M, off[1] * SIGMA_M)) is may


@pytest.mark.parametrize(("seen_off_m", "may"), [(0.0, False), (0.49, False), (0.51, True), (9.0, True)])
def test_a_fix_is_displaced_by_at_most_twice_as_much_as_any_other_of_the_frame(seen_off_m, may):
    assert Absent([a_track(1)], seen_off_m).may_explain(fix_at(1.0)) is may


def test_another_label_explains_no_fix():
    assert not Absent([a_track(1, label="cow")], None).may_explain(fix_at(1.0, label="car"))


def test_the_least_distance_is_that_of_confirmed_tracks_from_their_own_fixes():
    tracks = [a_track(1), a_track(2), a_track(3, confirmed=False), a_track(4)]
    taken = {1: (fix_at(0.6, 0.8), 5.0), 2: (fix_at(-0.3), 5.0), 3: (fix_at(0.1), 5.0)}
    missed = absent(tracks, [tracks[3]], taken, photographs=True)
    assert (missed.tracks, missed.seen_off_m) == ([tracks[3]], pytest.approx(0.3))
    assert absent(tracks[:3], [tracks[2]], taken, photographs=True).tracks == [], "no confirmed track was missed"
    assert absent(tracks, [tracks[3]], {}, photographs=True).seen_off_m is None
    assert absent(tracks, [tracks[3]], taken, photographs=False) == Absent([tracks[3]], None)
