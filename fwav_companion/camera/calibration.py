"""Calibration files of six tools, told apart by their content."""

from __future__ import annotations

from typing import Any

import msgspec

from fwav_companion.camera.fields import Fields
from fwav_companion.camera.native import MODEL, native_lens
from fwav_companion.errors import InputFileError
from fwav_companion.geometry.vectors import Matrix3
from fwav_companion.nouns import Lens


class Calibration(msgspec.Struct, frozen=True):
    """What a calibration file says."""

    lens: Lens
    time_offset_s: float | None = None
    """By the sign of [camera] time_offset_s: positive where stamps come late. None: the file does not say."""
    body_from_camera: Matrix3 | None = None
    """None: the file does not say, or not in body axes."""
    note: str = ""
    """What was left out or assumed, for the log."""

    @property
    def image_size(self) -> tuple[int, int]:
        """Width, height in pixels."""
        return self.lens.image_size


def parse_calibration(text: str, name: str) -> Calibration:
    """The calibration in ``text``; ``name`` is the file's, for complaints. InputFileError says what is wrong."""
    fields = Fields(_document(text, name), name)
    if "model" in fields and fields.text("model") == MODEL:
        return Calibration(native_lens(fields))
    raise InputFileError(f"{name}: model: no known camera file; {MODEL} is accepted")


def _document(text: str, name: str) -> dict[str, Any]:
    import yaml  # here: a relay without a camera never needs it

    try:
        document = yaml.safe_load(text)
    except yaml.YAMLError as error:
        raise InputFileError(f"{name}: {' '.join(str(error).split())}; YAML is accepted") from error
    if not isinstance(document, dict) or not all(isinstance(key, str) for key in document):
        raise InputFileError(f"{name}: no keys stand there; a camera file of keys and values is accepted")
    return document
