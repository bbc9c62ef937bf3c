"""``libcamera:N``: a Raspberry Pi's camera through picamera2, which the operating system brings, not PyPI.

SensorTimestamp is the end of the first row's readout, on CLOCK_MONOTONIC: that is ``stamp = "row0_end"``.
"""

from __future__ import annotations

from importlib import import_module
from importlib.util import find_spec
from typing import Any

from fwav_companion.vision.images import Picture, SourceLostError

SIZE = (640, 480)


class LibcameraSource:
    """One camera of the board."""

    def __init__(self, number: int) -> None:
        if find_spec("picamera2") is None:
            install = "sudo apt install python3-picamera2, in an environment made with --system-site-packages"
            raise SourceLostError(f"picamera2 is not installed: {install}")
        try:
            camera: Any = import_module("picamera2").Picamera2(number)
            camera.configure(camera.create_video_configuration(main={"size": SIZE, "format": "YUV420"}))
            camera.start()
        except (RuntimeError, IndexError, OSError) as error:
            raise SourceLostError(f"libcamera:{number}: {error}") from None
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
        pixels = planes[: SIZE[1], : SIZE[0]].copy()  # the first plane has the grey levels
        exposure_s = metadata["ExposureTime"] / 1e6 if "ExposureTime" in metadata else None
        return Picture(pixels, {"time_monotonic": metadata["SensorTimestamp"] / 1e9}, self._number, exposure_s)

    def close(self) -> None:
        """Release the camera."""
        self._camera.close()
