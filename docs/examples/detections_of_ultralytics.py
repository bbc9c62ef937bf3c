"""Sends what an Ultralytics model finds and tracks to the companion: ``python detections_of_ultralytics.py model.pt``.

On a Raspberry Pi. Needs ultralytics and picamera2; [camera] stamp = "row0_end", and [detections] url as below.
"""

import json
import socket
import sys

from picamera2 import Picamera2
from ultralytics import YOLO

COMPANION, SIZE = ("127.0.0.1", 14601), (640, 480)


def found(boxes, names):
    """Detections of one result. Ultralytics counts edges of pixels; the companion counts centres, half a pixel less."""
    ids = [{}] * len(boxes.conf) if boxes.id is None else [{"id": int(number)} for number in boxes.id.tolist()]
    for edges, score, kind, tracked in zip(
        boxes.xyxy.tolist(), boxes.conf.tolist(), boxes.cls.tolist(), ids, strict=True
    ):
        left, top, right, bottom = (edge - 0.5 for edge in edges)
        place = {"u": (left + right) / 2, "v": (top + bottom) / 2, "box": [left, top, right, bottom]}
        yield {**place, "label": names[int(kind)], "score": score, **tracked}


def frames(model_file):
    """Frames as the companion takes them, one a picture; the time is that of the exposure, not of now."""
    model, camera = YOLO(model_file), Picamera2()
    camera.configure(camera.create_video_configuration(main={"size": SIZE, "format": "RGB888"}))
    camera.start()
    while True:
        request = camera.capture_request()
        metadata, picture = request.get_metadata(), request.make_array("main")
        request.release()
        (result,) = model.track(picture, persist=True, verbose=False)
        time = {"time_monotonic": metadata["SensorTimestamp"] / 1e9, "exposure_s": metadata["ExposureTime"] / 1e6}
        yield {**time, "size": SIZE, "detections": list(found(result.boxes, model.names))}


if __name__ == "__main__":
    companion = socket.socket(socket.AF_INET, socket.SOCK_DGRAM)
    for frame in frames(sys.argv[1]):
        companion.sendto(json.dumps(frame).encode(), COMPANION)
