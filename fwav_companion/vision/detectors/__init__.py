"""Detectors: one module per kind, each behind :class:`fwav_companion.vision.images.Detector`."""

from __future__ import annotations

from collections.abc import Collection

from fwav_companion.vision.images import Detector, Found, Pixels
from fwav_companion.vision.task import VisionTask


def needs_color(task: VisionTask) -> bool:
    """Whether the detector of a task needs colour."""
    return task.detector in ("color", "onnx")


def make_detector(task: VisionTask, pad_tags: Collection[str] = ()) -> Detector:
    """The detector that the task names. DetectorError where it cannot work.

    ``pad_tags``: labels of the tags of pads, each reported under its own label.
    """
    if task.detector == "color":
        from fwav_companion.vision.detectors.color import ColorDetector

        return ColorDetector(task.color_hue_deg)
    if task.detector == "onnx":
        from fwav_companion.vision.detectors.onnx import OnnxDetector

        return OnnxDetector(task)
    if task.detector == "none":
        return NoDetector()
    from fwav_companion.vision.detectors.markers import apriltags, aruco

    if task.detector == "aruco":
        return aruco(task.aruco_dictionary, pad_tags)
    return apriltags(task.apriltag_family, pad_tags)


class NoDetector:
    """Finds nothing: for pictures in which an operator clicks on targets."""

    def detect(self, pixels: Pixels) -> list[Found]:  # noqa: ARG002
        """No detections."""
        return []
