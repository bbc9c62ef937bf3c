"""Sends what a model on a Hailo accelerator finds to the companion: ``python detections_of_hailo.py m.hef labels.txt``.

On a Raspberry Pi with the AI HAT. Needs picamera2 and hailo-all; [camera] stamp = "row0_end", and [detections] url as
below. The model must end with Hailo's own suppression: per class, rows of top, left, bottom, right, score in shares.
"""

import json
import socket
import sys
from itertools import count
from pathlib import Path

from picamera2 import Picamera2
from picamera2.devices import Hailo

COMPANION = ("127.0.0.1", 14601)
WIDTH, HEIGHT = 640, 480
LEAST_SCORE = 0.4


def found(rows_by_class, labels):
    """Detections in pixels of the picture; (0, 0) is the centre of its first pixel."""
    for label, rows in zip(labels, rows_by_class, strict=False):
        for top, left, bottom, right, score in rows:
            if score >= LEAST_SCORE:
                box = [left * WIDTH - 0.5, top * HEIGHT - 0.5, right * WIDTH - 0.5, bottom * HEIGHT - 0.5]
                u, v = (box[0] + box[2]) / 2, (box[1] + box[3]) / 2
                yield {
                    "u": float(u),
                    "v": float(v),
                    "label": label,
                    "score": float(score),
                    "box": list(map(float, box)),
                }


def frames(model_file, labels_file, pictures=None):
    """Frames as the companion takes them, one a picture."""
    labels = Path(labels_file).read_text().split("\n")
    with Hailo(model_file) as hailo, Picamera2() as camera:
        height, width, _ = hailo.get_input_shape()
        small = {"size": (width, height), "format": "RGB888"}  # the whole field of view, stretched to the model's input
        camera.configure(camera.create_video_configuration(main={"size": (WIDTH, HEIGHT)}, lores=small))
        camera.start()
        for number in count() if pictures is None else range(pictures):
            request = camera.capture_request()
            metadata, picture = request.get_metadata(), request.make_array("lores")
            request.release()
            yield {
                "time_monotonic": metadata["SensorTimestamp"] / 1e9,  # of the exposure, not of now
                "exposure_s": metadata["ExposureTime"] / 1e6,
                "frame": number,
                "size": [WIDTH, HEIGHT],
                "detections": list(found(hailo.run(picture), labels)),
            }


if __name__ == "__main__":
    with socket.socket(socket.AF_INET, socket.SOCK_DGRAM) as companion:
        for frame in frames(*sys.argv[1:]):
            companion.sendto(json.dumps(frame).encode(), COMPANION)
