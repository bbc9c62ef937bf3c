"""The patch tracker on rendered flights: the mock's own camera says where the spot is."""

from __future__ import annotations

from functools import cache
from math import hypot
from random import Random
from statistics import median

import cv2
import numpy as np
import pytest
from draws import slow_of
from scipy.ndimage import shift

from fwav_companion.types.spots import SpotView
from fwav_companion.vision.patch import KeptPictures, NoMatch, PatchMatch, PatchTracker
from sitl_mock.options import Options
from sitl_mock.render import Eye
from sitl_mock.scenarios import DEMO
from sitl_mock.simulate import Simulation

STEP_M = 0.05
"""Of the finite differences: 3 pixels from 12 m."""
EDGE_PX = 40.0


class Flight:
    """A rendered flight over textured ground, and where its pictures show places on the ground."""

    def __init__(self, seed: int, fps: float) -> None:
        options = Options().but({**DEMO, "camera.fps": fps, "seed": seed, "seconds": 60.0})
        simulation = Simulation(options)
        self.camera, self.centre = simulation.camera, options.flight.centre
        self.picture = cache(Eye(simulation).picture)
        self.half_exposure_s = options.camera.exposure_s / 2.0

    def view(self, place: tuple[float, float], frame: int, error: tuple[float, float] = (0.0, 0.0)) -> SpotView:
        """The truth about a place, moved by an error of the prediction."""
        here, north, east = (
            self.camera.pixel_of((place[0] + dn, place[1] + de, 0.0), self.camera.row0_s(frame))
            for dn, de in ((0.0, 0.0), (STEP_M, 0.0), (0.0, STEP_M))
        )
        jacobian = tuple((there[axis] - here[axis]) / STEP_M for axis in (0, 1) for there in (north, east))
        return SpotView((here[0] + error[0], here[1] + error[1]), jacobian, 40.0)

    def is_sharp(self, place: tuple[float, float], frame: int) -> bool:
        """Whether the spot moves by less than two pixels during the exposure."""
        row0_s = self.camera.row0_s(frame)
        ends = [
            self.camera.pixel_of((*place, 0.0), row0_s + dt) for dt in (-self.half_exposure_s, self.half_exposure_s)
        ]
        return hypot(ends[0][0] - ends[1][0], ends[0][1] - ends[1][1]) < 2.0

    def spot(self, rng: Random) -> tuple[tuple[float, float], int, PatchTracker]:
        """A place on the ground, the frame in which it is clicked, and its tracker."""
        while True:
            place = (self.centre[0] + rng.uniform(-16, 16), self.centre[1] + rng.uniform(-16, 16))
            frame = rng.randrange(20)
            view = self.view(place, frame)
            if inside(view.at, 80.0):
                tracker = PatchTracker.initiate(self.picture(frame), view)
                assert isinstance(tracker, PatchTracker)
                return place, frame, tracker


def inside(at: tuple[float, float], edge_px: float = EDGE_PX) -> bool:
    return edge_px < at[0] < 639.0 - edge_px and edge_px < at[1] < 479.0 - edge_px


def follow(seed: int, *, fps: float, frames: int) -> tuple[list[float], list[float], int, int]:
    """(errors in pixels, squares of the error over the claim, sharp frames with the spot, of these found)."""
    flight, rng = Flight(seed, fps), Random(seed)
    place, first, tracker = flight.spot(rng)
    errors, squares, sharp, found = [], [], 0, 0
    for frame in range(first + 1, first + frames):
        view = flight.view(place, frame)
        if not inside(view.at):
            continue
        match = tracker.update(flight.picture(frame), flight.view(place, frame, (rng.gauss(0, 8), rng.gauss(0, 8))))
        is_sharp = flight.is_sharp(place, frame)
        sharp += is_sharp
        if isinstance(match, PatchMatch):
            found += is_sharp
            errors.append(hypot(match.at[0] - view.at[0], match.at[1] - view.at[1]))
            squares.append(errors[-1] ** 2 / (2.0 * match.sigma_px**2))
    return errors, squares, sharp, found


def test_a_spot_is_followed_while_the_body_flaps():
    errors, _, sharp, found = follow(1, fps=30.0, frames=60)
    assert found >= 0.95 * sharp > 5
    assert max(errors) < 3.0


@pytest.mark.parametrize("flights", slow_of(10, 20, few=1))
def test_spots_of_many_flights_are_found_again_and_never_another_thing(flights):
    """Two figures of eight a flight: the spot leaves the picture and comes back from another side."""
    results = [follow(seed, fps=10.0, frames=200) for seed in range(1, flights + 1)]
    sharp, found = (sum(each[column] for each in results) for column in (2, 3))
    assert found >= 0.95 * sharp > 3 * flights
    assert max(max(each[0]) for each in results) < 6.0, "another thing is at least a patch's half away"
    assert 0.4 < median(sum(each[1]) / len(each[1]) for each in results) < 1.6


def test_other_ground_is_not_the_spot():
    flight = Flight(2, 30.0)
    place, _, tracker = flight.spot(Random(2))
    other = Flight(3, 30.0)
    answers = [tracker.update(other.picture(frame), flight.view(place, frame)) for frame in range(0, 30, 5)]
    assert not [answer for answer in answers if isinstance(answer, PatchMatch)]


def still(at: tuple[float, float], reach_px: float = 30.0) -> SpotView:
    return SpotView(at, (60.0, 0.0, 0.0, 60.0), reach_px)


def texture(seed: int) -> np.ndarray:
    noise = np.random.default_rng(seed).standard_normal((240, 320)).astype(np.float32)
    return np.clip(118.0 + 90.0 * cv2.GaussianBlur(noise, (0, 0), 2.0) / 0.28 * 0.3, 0, 255).astype(np.uint8)


def test_a_picture_that_moved_by_a_known_fraction_of_a_pixel_is_measured():
    """scipy's spline moves the picture: an interpolation that the tracker does not use."""
    picture = texture(1)
    tracker = PatchTracker.initiate(picture, still((160.0, 120.0)))
    assert isinstance(tracker, PatchTracker)
    for du, dv in ((3.3, -7.8), (0.0, 0.5), (-11.25, 4.75)):
        moved = np.clip(shift(picture.astype(float), (dv, du), mode="reflect"), 0, 255).astype(np.uint8)
        match = tracker.update(moved, still((160.0, 120.0)))
        assert isinstance(match, PatchMatch)
        assert match.at == pytest.approx((160.0 + du, 120.0 + dv), abs=0.1)


def test_a_repeated_pattern_is_refused_as_ambiguous():
    tile = texture(2)[:40, :40]
    picture = np.tile(tile, (6, 8))
    tracker = PatchTracker.initiate(picture, still((160.0, 120.0)))
    assert isinstance(tracker, PatchTracker)
    assert tracker.update(picture, still((160.0, 120.0), reach_px=60.0)) is NoMatch.AMBIGUOUS
    assert isinstance(tracker.update(picture, still((160.0, 120.0), reach_px=15.0)), PatchMatch)


def test_what_cannot_be_followed_is_refused_with_its_reason():
    flat = np.full((240, 320), 90, np.uint8)
    assert PatchTracker.initiate(flat, still((160.0, 120.0))) is NoMatch.NO_TEXTURE
    assert PatchTracker.initiate(texture(3), still((5.0, 120.0))) is NoMatch.OUTSIDE
    tracker = PatchTracker.initiate(texture(3), still((160.0, 120.0)))
    assert isinstance(tracker, PatchTracker)
    assert tracker.update(texture(3), still((-50.0, 120.0))) is NoMatch.OUTSIDE
    assert tracker.update(flat, still((160.0, 120.0))) is NoMatch.UNLIKE
    assert tracker.update(texture(4), still((160.0, 120.0))) is NoMatch.UNLIKE


def test_kept_pictures_stay_within_their_bytes():
    kept = KeptPictures(most_bytes=3 * 240 * 320)
    for number in range(10):
        kept.add(number, texture(number))
    assert [number for number in range(10) if kept.find(number) is not None] == [7, 8, 9]
    assert np.array_equal(kept.find(9), texture(9))
