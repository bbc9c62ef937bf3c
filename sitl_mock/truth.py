"""The truth file: a header with all drawn values, the motion of the vehicle and the walkers, and a summary."""

from __future__ import annotations

import csv
import dataclasses
import json
from io import StringIO
from typing import Any

from sitl_mock.camera import FrameTruth
from sitl_mock.earth import Place
from sitl_mock.simulate import Simulation, VehicleTruth

LONGEST_COURSE_S = 3600.0
"""Longest track of a walker in the CSV, seconds; it bounds the track of an endless flight."""

_encoded = json.JSONEncoder(separators=(",", ":")).encode
"""Made once: json.dumps makes an encoder for each line."""


def header(simulation: Simulation) -> dict[str, Any]:
    """First line: options, biases, home, origin, and the targets at the start."""
    belief = simulation.vehicle.belief
    return {
        "type": "header",
        "scenario": simulation.options.scenario,
        "seed": simulation.options.seed,
        "start_host_ns": simulation.start_host_ns,
        "unix_minus_host_s": simulation.unix_minus_host_s,
        "origin": _place(simulation.world.origin),
        "home": _place(belief.home(armed=True)),
        "home_before_arming": _place(belief.home(armed=False)),
        "ekf_origin": _place(belief.projection.origin),
        "biases": dataclasses.asdict(simulation.biases),
        "targets": target_lines(simulation, 0.0),
        "options": dataclasses.asdict(simulation.options),
    }


def target_lines(simulation: Simulation, flight_s: float) -> list[dict[str, Any]]:
    """label, lat, lon, alt_amsl, north, east, down of each target at an instant."""
    lines = []
    for index, target in enumerate(simulation.scene):
        north, east, down = target.at(flight_s)
        place = _place(simulation.world.place((north, east, down)))
        lines.append({"index": index, "label": target.label, **place, "north": north, "east": east, "down": down})
    return lines


def summary(simulation: Simulation) -> dict[str, Any]:
    """Last line: results of LANDING_TARGET, and counts of the messages that the autopilot received."""
    return {
        "type": "summary",
        "landing": simulation.vehicle.precland.summary(),
        "heard": simulation.vehicle.heard,
        "frames": simulation.frames,
        "rates_hz": simulation.vehicle.rates_hz,
    }


def line(what: VehicleTruth | FrameTruth) -> dict[str, Any]:
    """Line of one instant or one frame."""
    kind = "vehicle" if isinstance(what, VehicleTruth) else "frame"
    return {"type": kind, **dataclasses.asdict(what)}


def csv_text(simulation: Simulation, seconds: float) -> str:
    """CSV text for ``replay --truth``: label, lat, lon, alt_amsl, time_unix; walkers every 0.1 s, the other targets
    once.
    """
    out = StringIO()
    writer = csv.writer(out, lineterminator="\n")
    writer.writerow(["label", "lat", "lon", "alt_amsl", "time_unix"])
    start_unix_s = simulation.start_host_ns * 1e-9 + simulation.unix_minus_host_s
    for target in simulation.scene:
        steps = range(int(min(seconds, LONGEST_COURSE_S) * 10) + 1) if target.walks else (None,)
        for step in steps:
            place = simulation.world.place(target.at(0.0 if step is None else step * 0.1))
            stamp = "" if step is None else f"{start_unix_s + step * 0.1:.6f}"
            writer.writerow([target.label, f"{place.lat:.9f}", f"{place.lon:.9f}", f"{place.alt_amsl:.4f}", stamp])
    return out.getvalue()


def json_line(value: dict[str, Any]) -> str:
    """Line of the truth file."""
    return _encoded(value) + "\n"


def _place(place: Place) -> dict[str, float]:
    return {"lat": place.lat, "lon": place.lon, "alt_amsl": place.alt_amsl}
