"""SHELL: what a detector finds in a photograph, as pixels of targets."""

from __future__ import annotations

from typing import Any

from fwav_companion.errors import InputFileError
from fwav_companion.pixels import read_pixels
from fwav_companion.tools.locate.clicks import PictureClick
from fwav_companion.tools.locate.photographs import Photograph
from fwav_companion.vision.images import Detector, DetectorError


def detected_clicks(photograph: Photograph, detector: Detector, pixels: Any = None) -> list[PictureClick]:
    """The best detection of each label. InputFileError where the picture, or the detector, does not work.

    ``pixels``: of a video's frame, which is no file.
    """
    if pixels is None:
        pixels = read_pixels(photograph.path, as_stored=True)
    try:
        found = detector.detect(pixels)
    except DetectorError as error:
        raise InputFileError(str(error)) from None
    best: dict[str, tuple[float, PictureClick]] = {}
    for each in found:
        label, score = str(each.get("label") or "target"), float(each.get("score") or 0.0)
        if label not in best or score > best[label][0]:
            pixel = photograph.viewed_pixel((float(each["u"]), float(each["v"])))
            best[label] = (score, PictureClick(photograph.path.name, pixel, label))
    return [click for _, click in best.values()]
