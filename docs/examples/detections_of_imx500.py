"""Sends what a model in Sony's IMX500 camera finds to the companion: ``python detections_of_imx500.py model.rpk``.

On a Raspberry Pi with the AI camera. Needs picamera2 and imx500-all; [camera] stamp = "row0_end", and [detections] url
as below. The model must give boxes, scores and classes, as the SSD that imx500-all brings.
"""

import json
import socket
import sys
from itertools import count

from picamera2 import Picamera2
from picamera2.devices import IMX500

COMPANION = ("127.0.0.1", 14601)
SIZE = (640, 480)
LEAST_SCORE = 0.5


def found(imx500, camera, metadata):
    """Detections of one picture; the camera sends them with the metadata of the picture that they are of."""
    outputs = imx500.get_outputs(metadata, add_batch=True)
    if outputs is None:  # the network has not finished this picture
        return None
    detections = []
    for place, score, number in zip(outputs[0][0], outputs[1][0], outputs[2][0], strict=True):
        if score >= LEAST_SCORE:
            left, top, width, height = imx500.convert_inference_coords(place, metadata, camera)
            box = [left - 0.5, top - 0.5, left + width - 0.5, top + height - 0.5]
            label = imx500.network_intrinsics.labels[int(number)]
            u, v = (box[0] + box[2]) / 2, (box[1] + box[3]) / 2
            detections.append({"u": u, "v": v, "label": label, "score": float(score), "box": box})
    return detections


def frames(model_file, pictures=None):
    """Frames as the companion takes them, one a picture."""
    imx500 = IMX500(model_file)
    camera = Picamera2(imx500.camera_num)
    camera.configure(camera.create_preview_configuration(main={"size": SIZE}))
    camera.start()
    for number in count() if pictures is None else range(pictures):
        metadata = camera.capture_metadata()
        detections = found(imx500, camera, metadata)
        if detections is None:
            continue
        yield {
            "time_monotonic": metadata["SensorTimestamp"] / 1e9,  # of the exposure, not of now
            "exposure_s": metadata["ExposureTime"] / 1e6,
            "frame": number,
            "size": SIZE,
            "detections": detections,
        }


if __name__ == "__main__":
    with socket.socket(socket.AF_INET, socket.SOCK_DGRAM) as companion:
        for frame in frames(sys.argv[1]):
            companion.sendto(json.dumps(frame).encode(), COMPANION)
