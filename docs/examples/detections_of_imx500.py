"""Sends what a model in Sony's IMX500 camera finds to the companion: ``python detections_of_imx500.py model.rpk``.

On a Raspberry Pi with the AI camera. Needs picamera2 and imx500-all; [camera] stamp = "row0_end", and [detections] url
as below. The model must give boxes, scores and classes, as the SSD that imx500-all brings.
"""

import json
import socket
import sys

from picamera2 import Picamera2
from picamera2.devices import IMX500

COMPANION, SIZE, LEAST_SCORE = ("127.0.0.1", 14601), (640, 480), 0.5


def found(outputs, imx500, camera, metadata):
    """Detections of one picture; the camera sends them with the metadata of the picture that they are of."""
    for place, score, number in zip(outputs[0][0], outputs[1][0], outputs[2][0], strict=True):
        if score >= LEAST_SCORE:
            left, top, width, height = imx500.convert_inference_coords(place, metadata, camera)
            box = [left - 0.5, top - 0.5, left + width - 0.5, top + height - 0.5]
            middle = {"u": (box[0] + box[2]) / 2, "v": (box[1] + box[3]) / 2}
            label = imx500.network_intrinsics.labels[int(number)]
            yield {**middle, "label": label, "score": float(score), "box": box}


def frames(model_file):
    """Frames as the companion takes them, one a picture; the time is that of the exposure, not of now."""
    imx500 = IMX500(model_file)
    camera = Picamera2(imx500.camera_num)
    camera.configure(camera.create_preview_configuration(main={"size": SIZE}))
    camera.start()
    while True:
        metadata = camera.capture_metadata()
        outputs = imx500.get_outputs(metadata, add_batch=True)
        if outputs is not None:  # else the network has not finished this picture
            seen = list(found(outputs, imx500, camera, metadata))
            time = {"time_monotonic": metadata["SensorTimestamp"] / 1e9, "exposure_s": metadata["ExposureTime"] / 1e6}
            yield {**time, "size": SIZE, "detections": seen}


if __name__ == "__main__":
    companion = socket.socket(socket.AF_INET, socket.SOCK_DGRAM)
    for frame in frames(sys.argv[1]):
        companion.sendto(json.dumps(frame).encode(), COMPANION)
