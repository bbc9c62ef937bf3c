"""``libcamera:N``: a Raspberry Pi's camera through picamera2, a package of the operating system, not of PyPI.

SensorTimestamp is the end of the first row's readout, on CLOCK_MONOTONIC: that is ``stamp = "row0_end"``.
"""

from __future__ import annotations

import time
from importlib import import_module
from importlib.util import find_spec
from typing import Any

from fwav_companion.vision.images import Picture, SourceLostError
from fwav_companion.vision.task import VisionTask

SIZE = (640, 480)
"""Width and height if neither the configuration nor a calibration names a size, pixels."""
US_PER_S = 1e6
LIKELY_AGE_S = 1.0
"""Largest age of a stamp, seconds: an older one, or one in the future, is on another clock or jumped; the arrival
replaces it."""
MISSING = (
    "picamera2 is not installed for this interpreter: sudo apt install python3-picamera2, and "
    '[vision] python = "/usr/bin/python3"'
)


class LibcameraSource:
    """One camera of the board."""

    def __init__(self, task: VisionTask, *, color: bool) -> None:
        """``color``: whether the detector needs colour; grey levels take a third of the work."""
        if find_spec("picamera2") is None:
            raise SourceLostError(MISSING)
        width, height = task.size or SIZE
        self._size = (width, height)
        try:
            camera: Any = import_module("picamera2").Picamera2(int(task.source.partition(":")[2]))
            # RGB888 is blue, green, red in memory: picamera2's manual, appendix A.
            main = {"size": (width, height), "format": "RGB888" if color else "YUV420"}
            camera.configure(camera.create_video_configuration(main=main, controls=controls_of(task)))
            camera.start()
        except (ImportError, ValueError) as error:  # compiled for another numpy than this environment's
            raise SourceLostError(f'picamera2: {error}; set [vision] python = "/usr/bin/python3"') from None
        except (RuntimeError, IndexError, OSError) as error:
            raise SourceLostError(f"{task.source}: {error}") from None
        self._camera = camera
        self._number = -1

    def read(self, timeout_s: float) -> Picture:  # noqa: ARG002  # the daemon notices a camera that hangs
        """The next frame."""
        try:
            request = self._camera.capture_request()
        except (RuntimeError, OSError) as error:
            raise SourceLostError(f"the camera stopped: {error}") from None
        try:
            metadata = request.get_metadata()
            planes = request.make_array("main")
        finally:
            request.release()
        self._number += 1
        width, height = self._size
        pixels = planes[:height, :width].copy()  # the first plane of YUV420 has the grey levels
        exposure_s = metadata["ExposureTime"] / US_PER_S if "ExposureTime" in metadata else None
        now_s = time.monotonic()
        stamped_s = metadata.get("SensorTimestamp", 0) / 1e9
        likely = now_s - LIKELY_AGE_S < stamped_s <= now_s
        stamp = {"time_monotonic": stamped_s if likely else now_s}
        return Picture(pixels, stamp, self._number, exposure_s, clock="sensor" if likely else "arrival")

    def close(self) -> None:
        """Release the camera."""
        self._camera.close()


def controls_of(task: VisionTask) -> dict[str, Any]:
    """The controls of libcamera for the requested frame rate, exposure and gain."""
    controls: dict[str, Any] = {}
    if task.fps:
        interval_us = round(US_PER_S / task.fps)
        controls["FrameDurationLimits"] = (interval_us, interval_us)
    if task.exposure_s != "auto":
        controls["ExposureTime"] = round(US_PER_S * task.exposure_s)
    if task.gain != "auto":
        controls["AnalogueGain"] = float(task.gain)
    return controls
