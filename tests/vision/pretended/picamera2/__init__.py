"""A pretended picamera2, by its public manual: what LibcameraSource uses of it, and nothing else.

``Picamera2.made`` has the cameras that were opened. Each picture shows its number in its grey levels.
"""

import time

import numpy as np

NUMPY = np.__version__


class Request:
    def __init__(self, camera, number):
        self.camera, self.number, self.released = camera, number, False

    def get_metadata(self):
        controls = self.camera.config["controls"]
        return {
            "SensorTimestamp": time.monotonic_ns() - 20_000_000,
            "ExposureTime": controls.get("ExposureTime", 9000),
            "AnalogueGain": controls.get("AnalogueGain", 1.0),
        }

    def make_array(self, name):
        assert name == "main"
        width, height = self.camera.config["main"]["size"]
        if self.camera.config["main"]["format"] == "YUV420":
            padded = -(-width // 64) * 64  # rows are padded to whole 64 bytes on a Raspberry Pi
            planes = np.full((height * 3 // 2, padded), 128, np.uint8)
            planes[:height, :width] = self.number % 256
            return planes
        assert self.camera.config["main"]["format"] == "RGB888"
        return np.tile(np.array([10, 20, self.number % 256], np.uint8), (height, width, 1))

    def release(self):
        assert not self.released
        self.released = True


class Picamera2:
    made = []  # noqa: RUF012

    def __init__(self, number=0):
        if number > 1:
            raise IndexError("list index out of range")
        self.requests, self.state = [], "made"
        self.made.append(self)

    def create_video_configuration(self, main=None, controls=None):
        return {"main": main, "controls": dict(controls or {})}

    def configure(self, config):
        self.config, self.state = config, "configured"

    def start(self):
        assert self.state == "configured"
        self.state = "started"

    def capture_request(self):
        assert self.state == "started"
        assert all(request.released for request in self.requests), "a request is held: the camera would stop"
        if len(self.requests) >= 500:
            raise RuntimeError("Camera frontend has timed out!")
        time.sleep(0.01)
        self.requests.append(Request(self, len(self.requests)))
        return self.requests[-1]

    def close(self):
        self.state = "closed"
