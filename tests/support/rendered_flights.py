# ruff: noqa: T201  # a program that prints figures, and a module of the tests
"""The demonstration's flight in invented time: the same pictures, detector and pipeline, as fast as it goes.

``python tests/support/rendered_flights.py --seeds 20`` prints the results of twenty demonstrations.
"""

from __future__ import annotations

import argparse
import sys
from collections import Counter
from collections.abc import Iterator, Mapping, Sequence
from math import hypot, sqrt
from typing import Any, NamedTuple

from flying import Companion

from fwav_companion.config import parse
from fwav_companion.geometry.ellipses import circle_radius
from fwav_companion.tools.demo.flight_setup import FlightSetup
from fwav_companion.vision.detectors.markers import apriltags
from sitl_mock.arguments import add_flight_arguments, options_from
from sitl_mock.render import Eye
from sitl_mock.simulate import Simulation

DUE_FRAMES = 10
"""Number of usable frames in view after which a tag has to be found."""


class TagResult(NamedTuple):
    """One tag of one flight."""

    seed: int
    label: str
    usable_frames: int
    found: bool
    error_m: float
    claimed95_m: float
    beyond999: bool


class RenderedCompanion(Companion):
    """A companion that detects tags in rendered pictures."""

    def __init__(self, simulation: Simulation, text: str, settings: Sequence[str] = ()) -> None:
        super().__init__(settings, unix_minus_host_s=simulation.unix_minus_host_s, text=text, sightings=True)
        self.eye, self._detector = Eye(simulation), apriltags()
        self.usable: Counter[str] = Counter()

    def on_frame(self, frame: Mapping[str, Any], now_ns: int) -> list[bytes]:
        self.usable.update(f"tag36h11:{view.tag_id}" for view in self.eye.views(frame["frame"]) if view.usable)
        detections = self._detector.detect(self.eye.picture(frame["frame"]))
        return super().on_frame({**frame, "detections": detections}, now_ns)


def fly_rendered(seed: int, seconds: float = 30.0, settings: Sequence[str] = (), **setting: Any):
    """(companion, mock) after a whole demonstration flight."""
    chosen = FlightSetup(seed, seconds, **setting)
    text = chosen.config_text(14540, 14550)
    parser = argparse.ArgumentParser()
    add_flight_arguments(parser)
    arguments = chosen.mock_arguments(parse(text, "demo.toml"))
    simulation = Simulation(options_from(parser.parse_args(arguments), seconds))
    companion = RenderedCompanion(simulation, text, settings)
    for _ in simulation.drive(companion):
        pass
    companion.finish()
    return companion, simulation


def results(companion: RenderedCompanion, simulation: Simulation) -> Iterator[TagResult]:
    """Every tag of the flight against the truth."""
    for target in simulation.scene:
        lines = [line for line in companion.targets(target.label) if line.is_confirmed]
        usable, seed = companion.usable[target.label], simulation.options.seed
        if not lines:
            yield TagResult(seed, target.label, usable, False, 0.0, 0.0, False)
            continue
        last, true = lines[-1], target.at(0.0)
        error_m = hypot(last.north - true[0], last.east - true[1])
        beyond = error_m > circle_radius(last.cov, 0.999)
        yield TagResult(seed, target.label, usable, True, error_m, circle_radius(last.cov, 0.95), beyond)


def main() -> None:
    parser = argparse.ArgumentParser()
    parser.add_argument("--seeds", type=int, default=20)
    parser.add_argument("--first", type=int, default=1)
    parser.add_argument("--seconds", type=float, default=30.0)
    parser.add_argument("--scenario", default="demo")
    parser.add_argument("--set", action="append", default=[])
    chosen = parser.parse_args()
    everything: list[TagResult] = []
    for seed in range(chosen.first, chosen.first + chosen.seeds):
        flown = list(results(*fly_rendered(seed, chosen.seconds, chosen.set, scenario=chosen.scenario)))
        everything += flown
        line = "  ".join(
            f"{each.label[9:]}:{each.usable_frames} {each.error_m:.2f}/{each.claimed95_m:.2f}" for each in flown
        )
        print(f"seed {seed:2}  {line}", flush=True)
    due = [each for each in everything if each.usable_frames >= DUE_FRAMES]
    found = [each for each in everything if each.found]
    rms_m = sqrt(sum(each.error_m**2 for each in found) / len(found))
    mean_m = sum(each.claimed95_m for each in found) / len(found)
    inside = sum(each.error_m <= each.claimed95_m for each in found)
    print(f"due {len(due)}, of these found {sum(each.found for each in due)}; found in all {len(found)}")
    print(f"inside the claimed 95 % radius: {inside}/{len(found)} = {inside / len(found):.1%}")
    print(f"rms error {rms_m:.3f} m, mean claimed radius {mean_m:.3f} m, ratio {mean_m / rms_m:.2f}")
    print(f"beyond the claimed 99.9 %: {sum(each.beyond999 for each in found)}")


if __name__ == "__main__":
    sys.exit(main())
