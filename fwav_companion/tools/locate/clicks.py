"""The pixels of targets: `--pixel`, a CSV file, or OpenDroneMap's gcp_list.txt. PURE."""

from __future__ import annotations

import csv
import io
import re
from collections.abc import Iterator, Mapping, Sequence
from math import isfinite
from typing import Final

import msgspec

from fwav_companion.errors import InputFileError
from fwav_companion.photographs.ground_control import LINE, control_sights
from fwav_companion.types import Pixel

ACCEPTED: Final = "a CSV with the columns file, u, v and optionally label, or OpenDroneMap's gcp_list.txt"
MOST_CLICKS: Final = 20_000


class PictureClick(msgspec.Struct, frozen=True):
    """One target's pixel in one picture, as viewers turn it."""

    file: str
    """Name of the picture, without folders."""
    pixel: Pixel
    label: str


def parse_pixel(text: str) -> Pixel:
    """U,V. InputFileError otherwise."""
    parts = text.split(",")
    try:
        u, v = (float(part) for part in parts)
    except ValueError:
        u = v = float("nan")
    if not (isfinite(u) and isfinite(v)):
        raise InputFileError(f"--pixel {text}: accepted: column,row in pixels, as 1912,1034")
    return (u, v)


def parse_clicks(text: str, name: str) -> list[PictureClick]:
    """The clicks of a file. InputFileError names the line and what is accepted."""
    text = text.removeprefix("\ufeff")
    header = next((line for line in text.splitlines() if line.strip()), "").lower()
    is_csv = "file" in header and "," in header
    clicks = list(_csv_clicks(text, name) if is_csv else _ground_control(text, name))
    if not clicks:
        raise InputFileError(f"{name}: it has no pixel; accepted: {ACCEPTED}")
    if len(clicks) > MOST_CLICKS:
        raise InputFileError(f"{name}: {len(clicks)} pixels; accepted: at most {MOST_CLICKS}")
    return clicks


def clicks_of(files: Sequence[str], pixels: Sequence[Pixel], label: str) -> list[PictureClick]:
    """`--pixel` repeated in the order of the pictures. InputFileError where their numbers differ."""
    if len(pixels) != len(files):
        raise InputFileError(f"{len(pixels)} --pixel for {len(files)} pictures; accepted: one for each, in their order")
    return [PictureClick(file, pixel, label) for file, pixel in zip(files, pixels, strict=True)]


def _csv_clicks(text: str, name: str) -> Iterator[PictureClick]:
    reader = csv.DictReader(io.StringIO(text, newline=""), skipinitialspace=True)
    try:
        for row in reader:
            where = f"{name}: line {reader.line_num}"
            yield _click(row.get("file"), row.get("u"), row.get("v"), row.get("label") or "target", where)
    except csv.Error as error:
        raise InputFileError(f"{name}: line {reader.line_num}: {error}; accepted: {ACCEPTED}") from None


def _ground_control(text: str, name: str) -> Iterator[PictureClick]:
    for sight in control_sights(text, name, f"{LINE}, or {ACCEPTED}"):
        click = _click(sight.file, *sight.pixel, sight.label, sight.where)
        yield PictureClick(click.file, (click.pixel[0] - 0.5, click.pixel[1] - 0.5), sight.label)


def _click(file: str | None, u: str | None, v: str | None, label: str, where: str) -> PictureClick:
    if not file or not file.strip():
        raise InputFileError(f"{where}: no file; accepted: {ACCEPTED}")
    try:
        pixel = (float(u or ""), float(v or ""))
    except ValueError:
        pixel = (float("nan"), float("nan"))
    if not (isfinite(pixel[0]) and isfinite(pixel[1])):
        raise InputFileError(f"{where}: the pixel {u}, {v} is no number; accepted: {ACCEPTED}")
    return PictureClick(re.split(r"[/\\]", file.strip())[-1], pixel, label.strip() or "target")


def require_inside(click: PictureClick, viewed_size: tuple[int, int]) -> None:
    """InputFileError where a pixel lies outside its picture."""
    width, height = viewed_size
    u, v = click.pixel
    if not (-0.5 <= u <= width - 0.5 and -0.5 <= v <= height - 0.5):
        raise InputFileError(f"{click.file}: pixel {u:g}, {v:g} is outside its {width} x {height} pixels")


def by_file(files: Sequence[str]) -> Mapping[str, int]:
    """Index of each picture by its name. InputFileError where two have the same name."""
    found: dict[str, int] = {}
    for index, file in enumerate(files):
        if file in found:
            raise InputFileError(f"{file}: two pictures of this name; accepted: one of each name")
        found[file] = index
    return found
