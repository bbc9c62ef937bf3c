"""Sends what a model on a Hailo accelerator finds to the companion: ``python detections_of_hailo.py m.hef labels.txt``.

On a Raspberry Pi with the AI HAT. Needs picamera2 and hailo-all; [camera] stamp = "row0_end", and [detections] url as
below, and min_score. The model must end with Hailo's own suppression: per class, rows of top, left, bottom, right in
shares, and score.
"""

import json
import socket
import sys
from pathlib import Path

from picamera2 import Picamera2
from picamera2.devices import Hailo

COMPANION, SIZE = ("127.0.0.1", 14601), (640, 480)


def found(rows_by_class, labels):
    """Detections in pixels of the picture; (0, 0) is the centre of its first pixel."""
    rows = [(label, row) for label, of_class in zip(labels, rows_by_class, strict=False) for row in of_class]
    for label, (top, left, bottom, right, score) in rows:
        box = [float(share * side) - 0.5 for share, side in zip((left, top, right, bottom), SIZE * 2, strict=True)]
        place = {"u": (box[0] + box[2]) / 2, "v": (box[1] + box[3]) / 2, "box": box}
        yield {**place, "label": label, "score": float(score)}


def frames(model_file, labels_file):
    """Frames as the companion takes them, one a picture; the time is that of the exposure, not of now."""
    with Hailo(model_file) as hailo, Picamera2() as camera:
        height, width, _ = hailo.get_input_shape()
        small = {"size": (width, height), "format": "RGB888"}  # the whole field of view, stretched to the model's input
        camera.configure(camera.create_video_configuration(main={"size": SIZE}, lores=small))
        camera.start()
        while True:
            request = camera.capture_request()
            metadata, picture = request.get_metadata(), request.make_array("lores")
            request.release()
            seen = list(found(hailo.run(picture), Path(labels_file).read_text().split("\n")))
            time = {"time_monotonic": metadata["SensorTimestamp"] / 1e9, "exposure_s": metadata["ExposureTime"] / 1e6}
            yield {**time, "size": SIZE, "detections": seen}


if __name__ == "__main__":
    companion = socket.socket(socket.AF_INET, socket.SOCK_DGRAM)
    for frame in frames(*sys.argv[1:]):
        companion.sendto(json.dumps(frame).encode(), COMPANION)
