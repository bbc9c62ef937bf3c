"""AprilTags at 640x480: our detector against OpenCV's bare call, and what a picture costs besides its detection.

``python -m tests.benchmarks.detection``
"""

from __future__ import annotations

import socket
import zlib

import cv2

from fwav_companion.vision.detectors.markers import apriltags
from fwav_companion.vision.images import Picture, frame_bytes, grey
from fwav_companion.vision.worker import LOOK_STEP_PX
from tests.benchmarks.camera import PICTURES, TAGS, picture
from tests.benchmarks.figure import Figure, interleaved

ROUNDS = 15


def detector() -> Figure:
    """The same call of OpenCV with the same parameters; ours adds centres, sigmas and nested tags."""
    ours = apriltags()
    bare = cv2.aruco.ArucoDetector(cv2.aruco.getPredefinedDictionary(cv2.aruco.DICT_APRILTAG_36h11))
    parameters = bare.getDetectorParameters()
    parameters.cornerRefinementMethod = cv2.aruco.CORNER_REFINE_SUBPIX
    bare.setDetectorParameters(parameters)
    pictures = [grey(picture(number)) for number in range(0, PICTURES, 3)]
    if any(len(ours.detect(each)) != TAGS for each in pictures):
        raise AssertionError("tags were not seen")
    bare_s, ours_s = interleaved(
        lambda: [bare.detectMarkers(each) for each in pictures],
        lambda: [ours.detect(each) for each in pictures],
        rounds=ROUNDS,
    )
    detail = f"OpenCV {bare_s / len(pictures) * 1e3:.2f} ms, ours {ours_s / len(pictures) * 1e3:.2f} ms, {TAGS} tags"
    return Figure("AprilTags at 640x480, CPU beside OpenCV's bare call", ours_s / bare_s, 1.2, False, detail)


def besides() -> Figure:
    """From the picture in the process to the datagram, without the detector: encoding, the checksum, and sending."""
    pixels = grey(picture(0))
    found = apriltags().detect(pixels)
    shown = Picture(pixels, {"time_monotonic": 12.5}, 7, 0.002)
    sender, receiver = socket.socketpair(socket.AF_UNIX, socket.SOCK_SEQPACKET)
    calls = 200

    def work() -> None:
        for _ in range(calls):
            zlib.crc32(pixels[::LOOK_STEP_PX, ::LOOK_STEP_PX].tobytes())
            sender.send(frame_bytes(shown, found))
            receiver.recv(65536)

    with sender, receiver:
        (seconds,) = interleaved(work)
    each_ms = seconds / calls * 1e3
    return Figure("from a picture to its datagram, without the detector, ms", each_ms, 2.0, False, f"{TAGS} tags")


def measure() -> list[Figure]:
    return [detector(), besides()]


if __name__ == "__main__":
    print(*measure(), sep="\n")
