"""A server of `ground` over real HTTP, in a thread of its own, and its picture."""

from __future__ import annotations

import asyncio
import http.client
import threading
import time
from collections.abc import Sequence
from contextlib import closing, contextmanager

from processes import free_port

from fwav_companion.ground.ground_process import GroundOptions, GroundProcess, PictureInput
from fwav_companion.ground.picture import GroundPicture
from fwav_companion.ground.tiles import TileFile
from fwav_companion.ground.views import TargetView


@contextmanager
def served(picture: GroundPicture, token: str = "", tiles: TileFile | None = None, inputs: Sequence[PictureInput] = ()):
    """The port of a server of this picture, in a thread of its own."""
    port, ready = free_port(), threading.Event()
    loop = asyncio.new_event_loop()
    stop = asyncio.Event()
    options = GroundOptions(host="127.0.0.1", port=port, token=token, rate_hz=10.0)
    process = GroundProcess(picture, inputs, options, clock=time.time, tiles=tiles)
    thread = threading.Thread(target=lambda: loop.run_until_complete(process.run(stop, ready.set)))
    thread.start()
    try:
        assert ready.wait(20.0)
        yield port
    finally:
        loop.call_soon_threadsafe(stop.set)
        thread.join(20.0)
        loop.close()


def get(port: int, path: str, **headers: str) -> tuple[int, dict[str, str], bytes]:
    with closing(http.client.HTTPConnection("127.0.0.1", port, timeout=20.0)) as connection:
        connection.request("GET", path, headers=headers)
        response = connection.getresponse()
        return response.status, dict(response.getheaders()), response.read()


def picture_of_a_target() -> GroundPicture:
    """A picture of the target 1/4."""
    made = GroundPicture()
    made.on_target(
        TargetView(
            id="1/4", vehicle="1", state="confirmed", lat=48.1, lon=11.5, first_unix=time.time(),
            seen_unix=time.time(), source="status",
        ),
        time.time(),
    )  # fmt: skip
    return made
