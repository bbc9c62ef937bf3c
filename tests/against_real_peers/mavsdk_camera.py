"""MAVSDK's camera plugin as a ground station: prints what it knows of the vehicle's camera, then stops its tracking.

A program of its own, as ``mavsdk_station.py``. ``python mavsdk_camera.py udpin://127.0.0.1:14550``
"""

import json
import sys
import time
from collections.abc import Callable

from mavsdk import ComponentType, Configuration, ConnectionResult, Mavsdk
from mavsdk.plugins.camera import Camera, CameraError

PATIENCE_S = 60.0
PAUSE_S = 0.2


def say(**what: object) -> None:
    sys.stdout.write(json.dumps(what) + "\n")
    sys.stdout.flush()


def main(url: str) -> int:
    station = Mavsdk(Configuration.create_with_component_type(ComponentType.GROUND_STATION))
    if station.add_any_connection(url) is not ConnectionResult.SUCCESS:
        return 1
    system = station.first_autopilot(PATIENCE_S)
    if system is None:
        return 2
    plugin = Camera(system)
    known = patiently(lambda: plugin.camera_list().cameras)[0]
    number = known.component_id
    say(
        camera=number,
        vendor=known.vendor_name,
        model=known.model_name,
        size=[known.horizontal_resolution_px, known.vertical_resolution_px],
    )
    say(mode=patiently(lambda: plugin.get_mode(number)).name)
    patiently(lambda: plugin.get_video_stream_info(number).settings.uri)  # the status may be there before it
    stream = plugin.get_video_stream_info(number)
    say(
        stream=stream.stream_id,
        uri=stream.settings.uri,
        status=stream.status.name,
        size=[stream.settings.horizontal_resolution_pix, stream.settings.vertical_resolution_pix],
        fov_deg=stream.settings.horizontal_fov_deg,
    )
    storage = patiently(lambda: plugin.get_storage(number))
    say(storage=storage.storage_status.name, video_on=storage.video_on)
    plugin.track_stop(number)
    say(stopped=True)
    sys.stdin.read()
    station.destroy()
    return 0


def patiently(ask: Callable[[], object]) -> object:
    """The first answer: the plugin requests what it does not know."""
    deadline = time.monotonic() + PATIENCE_S
    while True:
        try:
            answer = ask()
        except CameraError:
            answer = None
        if answer:
            return answer
        if time.monotonic() > deadline:
            say(gave_up=True)
            sys.exit(3)
        time.sleep(PAUSE_S)


if __name__ == "__main__":
    sys.exit(main(sys.argv[1]))
