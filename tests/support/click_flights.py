# ruff: noqa: T201  # a program that prints figures, and a module of the tests
"""An operator clicks on the ground of a rendered flight: the pipeline and the spot tracker in invented time.

``python tests/support/click_flights.py --seeds 20`` prints a table.
"""

from __future__ import annotations

import argparse
import json
import time
from collections import Counter
from collections.abc import Iterable, Mapping, Sequence
from math import hypot
from random import Random
from typing import Any

import cv2
from flying import Companion

from fwav_companion.config import parse
from fwav_companion.tools.demo.flight_setup import FlightSetup
from fwav_companion.types import Command, Frame
from fwav_companion.types.spots import CLICK_LABEL, FollowSpot, ReleaseSpot
from fwav_companion.vision.patch import FollowedSpots, KeptPictures
from fwav_companion.vision.patch.appearance import HALF_PX
from fwav_companion.vision.wire import parse_frame
from sitl_mock.arguments import add_flight_arguments, options_from
from sitl_mock.render import Eye
from sitl_mock.simulate import Simulation
from sitl_mock.spot import ground_at

TRACK_POINT, STATION, CAMERA = 2004, (255, 190), 100
EDGE_PX = 40.0
"""Nearer to the edge a patch is not whole."""
SHARP_PX = 2.0
"""Motion during the exposure up to which a picture is sharp."""


class ClickCompanion(Companion):
    """A companion whose camera process follows spots; it clicks once on the place that it is given."""

    def __init__(self, simulation: Simulation, text: str, clicks_at_s: float, rng: Random) -> None:
        super().__init__(unix_minus_host_s=simulation.unix_minus_host_s, text=text, sightings=True)
        self._simulation, self._clicks_at_s, self._rng = simulation, clicks_at_s, rng
        self._eye = Eye(simulation)
        self._pictures = KeptPictures()
        self._spots = FollowedSpots(self._pictures)
        self.place: tuple[float, float] | None = None
        """True place of the spot, north and east: the ground at the pixel of the picture that the order names."""
        self.rival: MilTracker | None = None
        """What follows the same click without geometry, where it is wanted."""
        self.seen: Counter[str] = Counter()
        self.fix_errors_m: list[float] = []
        self.followed = 0
        """Pictures in which the spot was looked for."""
        self.cpu_s = self.rival_cpu_s = 0.0
        self.pixel_errors: list[float] = []

    def on_frame(self, frame: Mapping[str, Any], now_ns: int) -> list[bytes]:
        number = frame["frame"]
        picture = self._eye.picture(number)
        self._pictures.add(number, picture)
        asked = {**frame, "detections": [], "picture": number}
        found = []
        began_s = time.process_time()
        if self._spots:
            parsed = parse_frame(json.dumps(asked), self._instant(now_ns), self.wall_clock)
            assert isinstance(parsed, Frame)
            found = self._spots.detections(picture, self.pipeline.spot_views(parsed, self._now).views)
            self.followed += 1
        self.cpu_s += time.process_time() - began_s
        began_s = time.process_time()
        if self.rival is not None:
            self.rival.see(number, picture, self._pictures)
        self.rival_cpu_s += time.process_time() - began_s
        self._judge(number, found)
        sent = super().on_frame({**asked, "detections": found}, now_ns)
        if self.place is None and self._clicks_at_s <= self._simulation.camera.row0_s(number):
            self._click(now_ns)
        return sent

    def _flushed(self, now):
        spots = self.pipeline._components.spots
        for order in spots.take_orders():
            match order:
                case FollowSpot():
                    assert self._spots.follow(order) is None
                    camera = self._simulation.camera
                    self.place = ground_at(camera, order.view.at, camera.row0_s(order.picture))
                    if self.rival is not None:
                        self.rival.begin(order.picture, order.view.at)
                case ReleaseSpot(spot=spot):
                    self._spots.release(spot)
        return super()._flushed(now)

    def _click(self, now_ns: int) -> None:
        """Click on a random place; where no ground is in view there, the next picture is clicked on."""
        now = self._instant(now_ns)
        self.pipeline.advance(now)
        u, v = self._rng.uniform(150, 490), self._rng.uniform(120, 360)
        command = Command(
            number=TRACK_POINT,
            params=((u + 0.5) / 640, (v + 0.5) / 480, 0.0, 0.0, 0.0, 0.0, 0.0),
            system=STATION[0],
            component=STATION[1],
            link="ground",
            to_component=CAMERA,
        )
        components = self.pipeline._components
        components.publisher.on_command(command, components.situation(now))
        self._flushed(now)

    def _judge(self, number: int, found: list[dict[str, Any]]) -> None:
        if self.place is None:
            return
        camera, options = self._simulation.camera, self._simulation.options
        row0_s, half_s = camera.row0_s(number), options.camera.exposure_s / 2.0
        u, v = camera.pixel_of((*self.place, 0.0), row0_s)
        if not (EDGE_PX < u < 639.0 - EDGE_PX and EDGE_PX < v < 479.0 - EDGE_PX):
            self.seen["elsewhere"] += bool(found)
            return
        ends = [camera.pixel_of((*self.place, 0.0), row0_s + dt) for dt in (-half_s, half_s)]
        sharp = hypot(ends[0][0] - ends[1][0], ends[0][1] - ends[1][1]) < SHARP_PX
        self.seen["in view"] += 1
        self.seen["found"] += bool(found)
        self.seen["sharp"] += sharp
        self.seen["sharp found"] += sharp and bool(found)
        if found:
            self.pixel_errors.append(hypot(found[0]["u"] - u, found[0]["v"] - v))
        at = None if self.rival is None else self.rival.at
        if at is not None:
            on_it = hypot(at[0] - u, at[1] - v) < HALF_PX
            self.seen["rival on it"] += on_it
            self.seen["rival on it, sharp"] += on_it and sharp


class MilTracker:
    """OpenCV's tracker by multiple-instance learning (Babenko, Yang & Belongie 2009): a box in the first picture, then
    an update with each one."""

    def __init__(self) -> None:
        self._tracker = cv2.TrackerMIL.create()
        self._first: tuple[int, tuple[float, float]] | None = None
        self._begun = False
        self.at: tuple[float, float] | None = None
        """Middle of its box in the newest picture."""

    def begin(self, picture: int, at: tuple[float, float]) -> None:
        self._first = picture, at

    def see(self, number: int, picture: Any, kept: KeptPictures) -> None:
        """The pictures between the clicked one and the first after the click are caught up with."""
        if self._first is None:
            return
        if not self._begun:
            first, (u, v) = self._first
            box = (round(u) - HALF_PX, round(v) - HALF_PX, 2 * HALF_PX + 1, 2 * HALF_PX + 1)
            self._tracker.init(cv2.cvtColor(kept.find(first), cv2.COLOR_GRAY2BGR), box)
            self._begun = True
            for between in range(first + 1, number):
                self._tracker.update(cv2.cvtColor(kept.find(between), cv2.COLOR_GRAY2BGR))
        found, (left, top, width, height) = self._tracker.update(cv2.cvtColor(picture, cv2.COLOR_GRAY2BGR))
        self.at = (left + (width - 1) / 2.0, top + (height - 1) / 2.0) if found else None


def fly_with_a_click(
    seed: int, seconds: float = 30.0, fps: float = 30.0, sets: Sequence[str] = (), *, rival: bool = False
) -> tuple[ClickCompanion, Simulation]:
    """(companion, mock) after the flight. ``sets``: options of the mock, as flight.speed_m_s=1.0."""
    chosen = FlightSetup(seed, seconds)
    text = chosen.config_text(14540, 14550)
    parser = argparse.ArgumentParser()
    add_flight_arguments(parser)
    arguments = [
        *chosen.mock_arguments(parse(text, "demo.toml")),
        f"--set=camera.fps={fps}",
        *(f"--set={each}" for each in sets),
    ]
    simulation = Simulation(options_from(parser.parse_args(arguments), seconds))
    rng = Random(seed)
    companion = ClickCompanion(simulation, text, 8.0 + rng.uniform(0.0, 4.0), rng)
    companion.rival = MilTracker() if rival else None
    for _ in simulation.drive(companion):
        pass
    companion.finish()
    return companion, simulation


def final_error_m(companion: ClickCompanion) -> float | None:
    """Distance of the click's track from the true place at the end; None where it was never confirmed."""
    lines = [line for line in companion.targets(CLICK_LABEL) if line.is_confirmed]
    if not lines or companion.place is None:
        return None
    return hypot(lines[-1].north - companion.place[0], lines[-1].east - companion.place[1])


def compare_with_mil(seeds: Iterable[int], seconds: float, fps: float, sets: Sequence[str]) -> None:
    """Print one row a flight: how many of the frames in view each tracker has the spot in, and its CPU time a frame."""
    cv2.setNumThreads(1)
    print("| flight | frames in view | sharp | ours | ours, sharp | MIL | MIL, sharp | ours, ms | MIL, ms |")
    print("|---|---|---|---|---|---|---|---|---|")
    for seed in seeds:
        companion, _ = fly_with_a_click(seed, seconds, fps, sets, rival=True)
        seen, frames = companion.seen, max(1, companion.followed)
        ours, rival = 1e3 * companion.cpu_s / frames, 1e3 * companion.rival_cpu_s / frames
        print(
            f"| {seed} | {seen['in view']} | {seen['sharp']} | {seen['found']} | {seen['sharp found']} | "
            f"{seen['rival on it']} | {seen['rival on it, sharp']} | {ours:.1f} | {rival:.1f} |",
            flush=True,
        )


def main() -> None:
    parser = argparse.ArgumentParser()
    parser.add_argument("--seeds", type=int, default=20)
    parser.add_argument("--first", type=int, default=1)
    parser.add_argument("--seconds", type=float, default=30.0)
    parser.add_argument("--fps", type=float, default=30.0)
    parser.add_argument("--set", action="append", default=[], metavar="KEY=VALUE", help="an option of the mock")
    parser.add_argument("--mil", action="store_true", help="a table of both trackers, OpenCV's MIL and ours")
    chosen = parser.parse_args()
    if chosen.mil:
        compare_with_mil(range(chosen.first, chosen.first + chosen.seeds), chosen.seconds, chosen.fps, chosen.set)
        return
    for seed in range(chosen.first, chosen.first + chosen.seeds):
        companion, _ = fly_with_a_click(seed, chosen.seconds)
        errors = sorted(companion.pixel_errors) or [float("nan")]
        print(
            f"seed {seed:2}  {dict(companion.seen)}  median {errors[len(errors) // 2]:.2f} px, "
            f"largest {errors[-1]:.2f} px, final {final_error_m(companion)} m",
            flush=True,
        )


if __name__ == "__main__":
    main()
