"""Sends what an Ultralytics model finds to the companion: ``python detections_of_ultralytics.py model.pt``.

On a Raspberry Pi. Needs ultralytics and picamera2; [camera] stamp = "row0_end", and [detections] url as below.
"""

import json
import socket
import sys
from itertools import count

from picamera2 import Picamera2
from ultralytics import YOLO

COMPANION = ("127.0.0.1", 14601)
SIZE = (640, 480)


def found(result, names):
    """Detections of one result. Ultralytics counts edges of pixels; the companion counts centres, half a pixel less."""
    boxes = result.boxes
    for (left, top, right, bottom), score, number in zip(
        boxes.xyxy.tolist(), boxes.conf.tolist(), boxes.cls.tolist(), strict=True
    ):
        box = [left - 0.5, top - 0.5, right - 0.5, bottom - 0.5]
        u, v = (box[0] + box[2]) / 2, (box[1] + box[3]) / 2
        yield {"u": u, "v": v, "label": names[int(number)], "score": score, "box": box}


def frames(model_file, pictures=None):
    """Frames as the companion takes them, one a picture."""
    model = YOLO(model_file)
    camera = Picamera2()
    camera.configure(camera.create_video_configuration(main={"size": SIZE, "format": "RGB888"}))
    camera.start()
    for number in count() if pictures is None else range(pictures):
        request = camera.capture_request()
        metadata, picture = request.get_metadata(), request.make_array("main")
        request.release()
        (result,) = model(picture, verbose=False)
        yield {
            "time_monotonic": metadata["SensorTimestamp"] / 1e9,  # of the exposure, not of now
            "exposure_s": metadata["ExposureTime"] / 1e6,
            "frame": number,
            "size": SIZE,
            "detections": list(found(result, model.names)),
        }


if __name__ == "__main__":
    with socket.socket(socket.AF_INET, socket.SOCK_DGRAM) as companion:
        for frame in frames(sys.argv[1]):
            companion.sendto(json.dumps(frame).encode(), COMPANION)
