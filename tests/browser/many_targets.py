"""A page server with 50 vehicles and 500 targets, all of which change: ``python many_targets.py PORT``."""

from __future__ import annotations

import asyncio
import sys
import time
from math import cos, pi, radians, sin

from fwav_companion.ground.ground_process import GroundOptions, GroundProcess
from fwav_companion.ground.picture import GroundPicture
from fwav_companion.ground.views import EllipseView, TargetView

VEHICLES, TARGETS = 50, 500
UPDATE_S = 0.2
"""Every vehicle moves five times a second; every target is reported twice a second."""
LAT, LON, M_A_DEGREE = 48.1372, 11.5756, 111_320.0
EXTENT_M = 800.0


class Crowd:
    """An input of the picture."""

    def __init__(self, picture: GroundPicture) -> None:
        self._picture, self._due, self._step = picture, 0.0, 0

    def start(self) -> None:
        """Nothing to open."""

    def close(self) -> None:
        """Nothing to close."""

    def tick(self, now: float) -> None:
        """Move what is due."""
        if now < self._due:
            return
        self._due, self._step = now + UPDATE_S, self._step + 1
        for number in range(VEHICLES):
            angle = 0.03 * self._step + number
            lat, lon = place(number, 40.0 * cos(angle), 40.0 * sin(angle))
            corners = tuple(
                place(number, 60.0 * cos(angle + k * pi / 4), 60.0 * sin(angle + k * pi / 4)) for k in range(8)
            )
            self._picture.on_vehicle(
                str(number + 1), now, heard={"autopilot": now, "companion": now, "position": now, "attitude": now},
                kind="copter", lat=lat, lon=lon, footprint=corners, heading_deg=(angle * 180.0 / pi + 90.0) % 360.0,
                height_m=20.0, ready=True, readiness="ready",
            )  # fmt: skip
        for number in range(self._step % 3, TARGETS, 3):
            lat, lon = place(number, 0.3 * sin(self._step + number), 15.0 * cos(number))
            self._picture.on_target(
                TargetView(
                    id=f"{number % VEHICLES + 1}/{number}", vehicle=str(number % VEHICLES + 1), track=str(number),
                    label="person", state="confirmed", lat=lat, lon=lon, alt_amsl=519.0, source="status",
                    ellipse=EllipseView(major_m=3.0, minor_m=2.0, bearing_deg=number % 180),
                    radius95_m=2.6, first_unix=now, seen_unix=now,
                ), now,
            )  # fmt: skip


def place(number: int, north: float, east: float) -> tuple[float, float]:
    """A place about the middle of a vehicle or target, spread evenly."""
    north += EXTENT_M * (number * 0.618 % 1.0 - 0.5)
    east += EXTENT_M * (number * 0.414 % 1.0 - 0.5)
    return LAT + north / M_A_DEGREE, LON + east / (M_A_DEGREE * cos(radians(LAT)))


async def serve(port: int) -> None:
    """Serve until the process is ended."""
    picture = GroundPicture()
    options = GroundOptions(host="127.0.0.1", port=port, token="", rate_hz=5.0)
    process = GroundProcess(picture, [Crowd(picture)], options, clock=time.time)
    await process.run(asyncio.Event(), lambda: print("serving", flush=True))


if __name__ == "__main__":
    asyncio.run(serve(int(sys.argv[1])))
