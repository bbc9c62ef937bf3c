"""A source of pictures of one's own, without a change of the package: it writes into a named pipe.

``mkfifo camera.pipe && python pictures_into_a_pipe.py camera.pipe``, and in the configuration::

    [vision]
    source = "camera.pipe"
    detector = "color"

Any program in any language can do the same: for each picture a line of JSON, then its bytes, row by row.
"""

import json
import sys
import time
from collections.abc import Iterator
from itertools import count

import numpy as np

SIZE = (640, 480)
"""Width and height: those of the camera file."""
RATE_HZ = 30.0
EXPOSURE_S = 0.002
DISC = ((400.0, 200.0), 12.0)
"""Centre and radius of a red disc, pixels: what the camera sees in place of a world."""

GENERATOR = np.random.default_rng(1)


def captured() -> tuple[np.ndarray, float]:
    """A picture (blue, green, red), and the CLOCK_MONOTONIC second of its exposure: replace it by your camera's."""
    stamp = time.monotonic()
    columns, rows = np.meshgrid(np.arange(SIZE[0]), np.arange(SIZE[1]))
    (u, v), radius = DISC
    picture = np.full((SIZE[1], SIZE[0], 3), 90, np.uint8)
    picture[(columns - u) ** 2 + (rows - v) ** 2 <= radius**2] = (0, 0, 235)
    noise = GENERATOR.integers(0, 20, picture.shape, np.uint8)  # equal pictures are those of a frozen camera
    return picture + noise, stamp


def messages(pictures: int | None = None) -> Iterator[bytes]:
    """Bytes for the pipe, one message a picture; without end where no number is given."""
    for number in count() if pictures is None else range(pictures):
        picture, stamp = captured()
        line = {
            "size": [picture.shape[1], picture.shape[0]],
            "format": "bgr8",  # or gray8: one byte a pixel
            "time_monotonic": stamp,  # of the exposure, not of now; or time_unix, time_boot
            "exposure_s": EXPOSURE_S,
            "frame": number,
        }
        yield json.dumps(line).encode() + b"\n" + picture.tobytes()


def main(pipe: str) -> None:
    """Write until the reader goes, then wait for the next one: the service opens the pipe again by itself."""
    while True:
        with open(pipe, "wb", buffering=0) as file:  # noqa: PTH123  # waits until the service reads
            try:
                for message in messages():
                    file.write(message)
                    time.sleep(1.0 / RATE_HZ)
            except BrokenPipeError:
                continue


if __name__ == "__main__":
    main(sys.argv[1])
