"""A page server with two vehicles in local worlds: ``python local_fleet.py PORT FILE``.

Once FILE exists, vehicle 1 has a global position, and its tracks have places on the earth.
"""

from __future__ import annotations

import asyncio
import os
import sys
import time
from pathlib import Path

import msgspec
from fleet_messages import local, shared, tracks_message

from fwav_companion.fleet.payloads import LocalPlace, StateMessage, encoded
from fwav_companion.ground.fleet_picture import FleetPicture
from fwav_companion.ground.ground_process import GroundOptions, GroundProcess
from fwav_companion.ground.picture import GroundPicture

STEP_S = 0.5
COV = (0.25, 0.0, 0.0, 0.04, 0.0, 0.01)
"""One sigma of 0.5 m north and of 0.2 m east."""
SEEN = local(4, north=-4.0, east=5.0, cov=COV)
LONG_LOST = local(8, label="bag", state="coasting", north=6.0, east=1.0, cov=COV, last_seen_s=60.0)
PLACES = {"1": LocalPlace(north=3.0, east=-2.0, down=-1.5), "2": LocalPlace(north=0.5, east=0.25, down=-1.0)}
"""Of the vehicles from the zeros of their worlds."""
HEADING_DEG = 120.0


class LocalFleet:
    """An input of the picture."""

    def __init__(self, picture: GroundPicture, found: Path) -> None:
        """``found``: the file that says that vehicle 1 has a global position."""
        self._fused, self._found = FleetPicture(picture), found
        self._due, self._seq = 0.0, 0

    def start(self) -> None:
        """Nothing to open."""

    def close(self) -> None:
        """Nothing to close."""

    def tick(self, now: float) -> None:
        """Take what both vehicles send, twice a second."""
        self._fused.step(now)
        if now < self._due:
            return
        self._due, self._seq = now + STEP_S, self._seq + 1
        for vehicle, place in PLACES.items():
            fields = {"vehicle": vehicle, "time_unix": now, "session": "a"}
            if vehicle == "1" and self._found.exists():
                state = StateMessage(**fields, ready=True, lat=48.0, lon=11.0, alt_amsl=520.0, heading_deg=HEADING_DEG)
                tracks = tracks_message(shared(4), seq=self._seq, **fields)
            else:
                state = StateMessage(**fields, ready=True, local=place, heading_deg=HEADING_DEG)
                seen = (SEEN, LONG_LOST) if vehicle == "1" else ()
                tracks = tracks_message(seq=self._seq, local_tracks=seen, **fields)
            self._fused.on_message(vehicle, "state", msgspec.json.encode(state), now)
            for part in encoded(tracks):
                self._fused.on_message(vehicle, "tracks", part, now)


async def serve(port: int, found: Path) -> None:
    """Serve until the process is ended."""
    picture = GroundPicture()
    options = GroundOptions(host="127.0.0.1", port=port, token="", rate_hz=5.0)
    process = GroundProcess(picture, [LocalFleet(picture, found)], options, clock=time.time)
    await process.run(asyncio.Event(), lambda: os.write(1, b"serving\n"))


if __name__ == "__main__":
    asyncio.run(serve(int(sys.argv[1]), Path(sys.argv[2])))
