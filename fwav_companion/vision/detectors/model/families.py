"""Families of detection models: how each wants its picture, and how it counts its classes.

A family is a preset that no file states: order of colours, normalization, resize, background slot. Sources: the
families' own export scripts and demonstration programs. [vision] model_input, model_normalize, model_resize and
model_background override a preset.
"""

from __future__ import annotations

from typing import Final, Literal

import msgspec

from fwav_companion.vision.detectors.model.letterbox import Resize

Normalize = Literal["none", "255", "imagenet"]
"""Values of the input: 0 to 255, 0 to 1, or less the mean of ImageNet's pictures over their deviation."""
Background = Literal["none", "first", "last"]
"""The class slot that is not a class."""
MeanAndDeviation = tuple[tuple[float, float, float], tuple[float, float, float]]
MEANS_AND_DEVIATIONS: Final[dict[str, MeanAndDeviation]] = {
    "none": ((0.0, 0.0, 0.0), (1.0, 1.0, 1.0)),
    "255": ((0.0, 0.0, 0.0), (255.0, 255.0, 255.0)),
    "imagenet": ((123.675, 116.28, 103.53), (58.395, 57.12, 57.375)),
}
"""Mean and deviation of each normalization, in the order red, green, blue of levels 0 to 255."""


class Family(msgspec.Struct, frozen=True):
    """Preset of one family, the value of [vision] model_format."""

    name: str
    colors: Literal["rgb", "bgr"] = "rgb"
    normalize: Normalize | MeanAndDeviation = "255"
    resize: Resize = "letterbox"
    background: Background = "none"


MMDETECTION: Final[MeanAndDeviation] = ((103.53, 116.28, 123.675), (57.375, 57.12, 58.395))
"""Blue, green, red: RTMDet's."""
FAMILIES: Final = {
    family.name: family
    for family in (
        Family("yolov5"),
        Family("yolov8"),
        Family("yolox", colors="bgr", normalize="none", resize="letterbox_topleft"),
        Family("yolov10"),
        Family("yolonas"),
        Family("rtdetr", resize="stretch"),
        Family("dfine", resize="stretch"),
        Family("rfdetr", normalize="imagenet", resize="stretch", background="last"),
        Family("detr", normalize="imagenet", resize="stretch", background="last"),
        Family("mmdeploy", colors="bgr", normalize=MMDETECTION, resize="letterbox_topleft"),
        Family("paddle", normalize="255", resize="stretch"),
        Family("torchvision", resize="stretch", background="first"),
        Family("tf", normalize="none", resize="stretch", background="first"),
        Family("nms7"),
        Family("ssd", normalize="imagenet", resize="stretch", background="first"),
    )
}
CAFFE_SSD: Final = Family(
    "ssd",
    colors="bgr",
    normalize=((127.5, 127.5, 127.5), (127.5, 127.5, 127.5)),
    resize="stretch",
    background="first",
)
"""The SSD of Caffe and OpenVINO, which have another preset than MLPerf's."""
