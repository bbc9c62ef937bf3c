"""Detectors: one module per kind, each behind :class:`fwav_companion.vision.images.Detector`."""

from __future__ import annotations

from fwav_companion.vision.images import Detector
from fwav_companion.vision.task import VisionTask


def make_detector(task: VisionTask) -> Detector:
    """The detector that the task names."""
    if task.detector == "color":
        from fwav_companion.vision.detectors.color import ColorDetector

        return ColorDetector(task.color_hue_deg)
    from fwav_companion.vision.detectors.markers import apriltags, aruco

    return aruco(task.aruco_dictionary) if task.detector == "aruco" else apriltags()
