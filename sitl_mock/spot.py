"""``python -m sitl_mock.spot``: the ground at a pixel of one frame, and where all frames show that place, as JSON."""

from __future__ import annotations

import argparse
import json
import sys
from math import hypot, isfinite
from typing import TYPE_CHECKING, Any

from sitl_mock.arguments import (
    LONGEST_S,
    MISTAKES,
    SCENARIO_LIST,
    OneLineParser,
    add_flight_arguments,
    message_for_user,
    options_from,
)
from sitl_mock.simulate import Simulation

if TYPE_CHECKING:
    from sitl_mock.camera import MockCamera

STEP_M = 1e-3
"""Step of the derivatives, metres."""
MOST_STEPS = 30


def ground_at(camera: MockCamera, at: tuple[float, float], row0_s: float) -> tuple[float, float] | None:
    """(north, east) of the flat ground that a frame shows at a pixel, by Newton's method; None where it is not seen."""
    north, east = camera.below(row0_s)
    for _ in range(MOST_STEPS):
        here = camera.pixel_of((north, east, 0.0), row0_s)
        du, dv = at[0] - here[0], at[1] - here[1]
        if hypot(du, dv) < 1e-6:
            return north, east
        (a, b), (c, d) = jacobian(camera, (north, east), row0_s)
        det = a * d - b * c
        if not abs(det) > 1e-9:
            return None
        north, east = north + (d * du - b * dv) / det, east + (a * dv - c * du) / det
    return None


def jacobian(camera: MockCamera, place: tuple[float, float], row0_s: float) -> tuple[tuple[float, float], ...]:
    """d(u, v) / d(north, east) of a place on the ground, row by row, pixels a metre."""
    north, east = place
    here = camera.pixel_of((north, east, 0.0), row0_s)
    steps = ((north + STEP_M, east), (north, east + STEP_M))
    (n, e) = (camera.pixel_of((*step, 0.0), row0_s) for step in steps)
    return (
        ((n[0] - here[0]) / STEP_M, (e[0] - here[0]) / STEP_M),
        ((n[1] - here[1]) / STEP_M, (e[1] - here[1]) / STEP_M),
    )


def sights(simulation: Simulation, place: tuple[float, float]) -> list[dict[str, Any]]:
    """For each frame that shows the place: its pixel, the motion during the exposure in pixels, and metres a pixel."""
    camera, half_s = simulation.camera, simulation.options.camera.exposure_s / 2.0
    found, frame = [], 0
    while camera.due_ns(frame) <= simulation.end_ns:
        row0_s = camera.row0_s(frame)
        u, v = camera.pixel_of((*place, 0.0), row0_s)
        if isfinite(u) and isfinite(v) and camera.lens.sees(u, v):
            ends = [camera.pixel_of((*place, 0.0), row0_s + dt) for dt in (-half_s, half_s)]
            (a, b), (c, d) = jacobian(camera, place, row0_s)
            found.append(
                {
                    "frame": frame,
                    "at_s": row0_s,
                    "pixel": [u, v],
                    "blur_px": hypot(ends[0][0] - ends[1][0], ends[0][1] - ends[1][1]),
                    "metres_per_px": abs(a * d - b * c) ** -0.5,
                }
            )
        frame += 1
    return found


def main(arguments: list[str] | None = None) -> int:
    """Exit status: 0; 1 where the pixel shows no ground; 2 for invalid arguments."""
    chosen = _parser().parse_args(arguments)
    try:
        simulation = Simulation(options_from(chosen, LONGEST_S))
    except MISTAKES as error:
        print(f"sitl_mock.spot: {message_for_user(error)}", file=sys.stderr)  # noqa: T201
        return 2
    place = ground_at(simulation.camera, tuple(chosen.pixel), simulation.camera.row0_s(chosen.frame))
    if place is None:
        return 1
    globe = simulation.world.place((*place, 0.0))
    print(json.dumps({"lat": globe.lat, "lon": globe.lon, "sights": sights(simulation, place)}))  # noqa: T201
    return 0


def _parser() -> argparse.ArgumentParser:
    parser = OneLineParser(
        prog="python -m sitl_mock.spot",
        description="The place on the ground at a pixel of one frame, and where all frames show it.",
        epilog=SCENARIO_LIST,
        formatter_class=argparse.RawDescriptionHelpFormatter,
    )
    parser.add_argument("--frame", type=int, required=True, help="number of the frame")
    parser.add_argument("--pixel", type=float, nargs=2, metavar=("U", "V"), required=True, help="its pixel")
    add_flight_arguments(parser)
    return parser


if __name__ == "__main__":
    sys.exit(main())
