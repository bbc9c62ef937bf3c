"""Takes pictures for ``calibrate`` with a Raspberry Pi's camera, in the mode in which the service flies it.

``/usr/bin/python3 pictures_of_a_board.py 640x480 pictures 30`` takes thirty, one each two seconds. The size is that of
[vision] size: another one may be another part of the sensor, and so another lens. Needs python3-picamera2.
"""

import sys
import time
from pathlib import Path

from picamera2 import Picamera2

STEP_S = 2.0
"""Time to hold the board another way, and still."""


def take(size: tuple[int, int], folder: Path, pictures: int) -> None:
    """Write 000.png, 001.png, ... into the folder."""
    folder.mkdir(parents=True, exist_ok=True)
    camera = Picamera2()
    camera.configure(camera.create_video_configuration(main={"size": size, "format": "RGB888"}))
    camera.start()
    for number in range(pictures):
        time.sleep(STEP_S)
        request = camera.capture_request()
        request.save("main", str(folder / f"{number:03d}.png"))
        request.release()
        print(f"picture {number + 1} of {pictures}", flush=True)  # noqa: T201
    camera.close()


if __name__ == "__main__":
    width, height = map(int, sys.argv[1].split("x"))
    take((width, height), Path(sys.argv[2]), int(sys.argv[3]))
