"""The printed pad: the service's own detector reads it, and its sizes and places are true."""

from __future__ import annotations

import json

import numpy as np
import pytest
from printed_pages import DOTS_PER_MM, pdf_pages, png_with_resolution

from fwav_companion.cli.main import main
from fwav_companion.pads.pad_layout import PadLayout
from fwav_companion.tools.pad_sheet.pdf_pages import MARGIN_MM, TILE_MM, page_count, pdf_of
from fwav_companion.tools.pad_sheet.png_picture import png_of
from fwav_companion.tools.pad_sheet.sheet import pad_sheet
from fwav_companion.types import Pad, PadTag
from fwav_companion.vision.detectors.markers import apriltags, aruco

PAD = Pad(
    label="pad",
    tags=(
        PadTag(label="tag36h11:4", size_m=0.12),
        PadTag(label="tag36h11:1", size_m=0.04, at_m=(0.105, 0.02), yaw_deg=20.0),
        PadTag(label="tag36h11:2", size_m=0.02, at_m=(-0.09, -0.03), yaw_deg=-90.0),
    ),
)
LARGE = Pad(
    label="large",
    tags=(PadTag(label="tag36h11:7", size_m=0.4), PadTag(label="tag36h11:8", size_m=0.1, at_m=(0.3, 0.0))),
)


def corners_mm(found, dots_per_mm):
    """Corners of each tag by label, millimetres."""
    return {each["label"]: (np.array(each["corners"]) + 0.5) / dots_per_mm for each in found}


def assert_as_configured(pad, seen, tolerance_mm):
    """The corners have the layout of the pad, but for one displacement of the page."""
    layout = PadLayout(pad)
    assert set(seen) == set(layout.number)
    here = np.concatenate([seen[label] for label in layout.number])
    there = np.concatenate([1000.0 * layout.corners[k][:, [1, 0]] * [1.0, -1.0] for k in layout.number.values()])
    apart = here - there
    assert np.abs(apart - apart.mean(axis=0)).max() < tolerance_mm


def test_png_is_read_by_the_detector_at_the_true_size():
    picture, dots_per_mm = png_with_resolution(png_of(pad_sheet(PAD, "4x4_50")))
    assert_as_configured(PAD, corners_mm(apriltags(apart=PAD_TAGS).detect(picture), dots_per_mm), 0.15)


def test_pdf_is_read_by_the_detector_at_the_true_size():
    ((picture, _),) = pdf_pages(pdf_of([pad_sheet(PAD, "4x4_50")]))
    assert picture.shape == (round(297 * DOTS_PER_MM), round(210 * DOTS_PER_MM))
    assert_as_configured(PAD, corners_mm(apriltags(apart=PAD_TAGS).detect(picture), DOTS_PER_MM), 0.2)


def test_rulers_are_true():
    (_, strokes), *_ = pdf_pages(pdf_of([pad_sheet(PAD, "4x4_50")]))
    line = max(strokes, key=lambda ends: abs(ends[1][0] - ends[0][0]))
    assert line[1][0] - line[0][0] == pytest.approx(150.0, abs=0.01)
    picture, dots_per_mm = png_with_resolution(png_of(pad_sheet(PAD, "4x4_50")))
    longest = max(_longest_dark_run(row) for row in picture[-round(24 * dots_per_mm) :])
    assert longest / dots_per_mm == pytest.approx(100.0, abs=0.4)


def test_large_pad_is_tiles_that_fit_together():
    sheet = pad_sheet(LARGE, "4x4_50")
    rows, columns = page_count(sheet)
    assert (rows, columns) == (3, 3)
    pages = pdf_pages(pdf_of([sheet]))
    left, top = round(MARGIN_MM * DOTS_PER_MM), round(MARGIN_MM * DOTS_PER_MM)
    width, height = (round(side * DOTS_PER_MM) for side in TILE_MM)
    tiles = [picture[top : top + height, left : left + width] for picture, _ in pages]
    whole = np.vstack([np.hstack(tiles[columns * row : columns * (row + 1)]) for row in range(rows)])
    assert_as_configured(LARGE, corners_mm(apriltags(apart=("tag36h11:8",)).detect(whole), DOTS_PER_MM), 0.3)


def test_small_tag_in_the_middle_of_a_large_one_is_drawn_on_it():
    """The large one's code is broken by it here; a family with a blank in the middle has room for it."""
    small = PadTag(label="tag36h11:5", size_m=0.015)
    nested = Pad(label="pad", tags=(small, PadTag(label="tag36h11:4", size_m=0.15)))
    picture, dots_per_mm = png_with_resolution(png_of(pad_sheet(nested, "4x4_50")))
    seen = corners_mm(apriltags(apart=("tag36h11:5",)).detect(picture), dots_per_mm)
    sides = np.linalg.norm(np.diff(seen["tag36h11:5"], axis=0), axis=1)
    assert sides == pytest.approx(15.0, abs=0.1)


def test_aruco_marker_is_drawn_from_the_configured_dictionary():
    pad = Pad(label="pad", tags=(PadTag(label="aruco:7", size_m=0.1),))
    picture, dots_per_mm = png_with_resolution(png_of(pad_sheet(pad, "5x5_100")))
    assert_as_configured(pad, corners_mm(aruco("5x5_100").detect(picture), dots_per_mm), 0.15)


def configuration(tmp_path, pads):
    file = tmp_path / "f.toml"
    tables = "".join(
        f'[[pad]]\nlabel = "{pad.label}"\ntags = ['
        + ", ".join(
            f'{{ label = "{tag.label}", size_m = {tag.size_m}, at_m = {list(tag.at_m)}, yaw_deg = {tag.yaw_deg} }}'
            for tag in pad.tags
        )
        + "]\n"
        for pad in pads
    )
    file.write_text('[detections]\nurl = ""\n' + tables)
    return str(file)


def test_command_writes_the_sheet_of_the_configured_pad(tmp_path, capsys):
    config, out = configuration(tmp_path, [PAD]), tmp_path / "pad.pdf"
    assert main(["check", "--config", config, "--pad", str(out), "--json"]) == 0
    last = json.loads(capsys.readouterr().out.splitlines()[-1])
    assert (last["ok"], last["pads"][0]["pages"]) == (True, 1)
    ((picture, _),) = pdf_pages(out.read_bytes())
    assert_as_configured(PAD, corners_mm(apriltags(apart=PAD_TAGS).detect(picture), DOTS_PER_MM), 0.2)


@pytest.mark.parametrize(
    ("pads", "name", "line"),
    [
        ([PAD], "pad.jpg", "accepted: a name that ends in .pdf or .png"),
        ([], "pad.pdf", "[[pad]]: missing, while --pad prints it; accepted: at least one pad"),
        ([PAD, LARGE], "pad.png", "a picture has one pad, [[pad]] has 2; accepted: .pdf"),
        ([Pad(label="h", tags=(PadTag(label="helipad", size_m=1.0),))], "pad.pdf", '"helipad" cannot be drawn'),
        (
            [Pad(label="h", tags=(PadTag(label="tag36h11:587", size_m=1.0),))],
            "p.pdf",
            "accepted: tag36h11:0 to tag36h11:586",
        ),
        ([PAD], "nowhere/pad.pdf", "No such file or directory; accepted: a file that can be written"),
    ],
)
def test_what_cannot_be_printed_is_one_line_and_exit_2(tmp_path, capsys, pads, name, line):
    config = configuration(tmp_path, pads)
    assert main(["check", "--config", config, "--pad", str(tmp_path / name)]) == 2
    error = capsys.readouterr().err
    assert line in error
    assert error.count("\n") == 1


def _longest_dark_run(row):
    """Length of the longest run of dark dots."""
    dark = np.concatenate([[0], (row < 128).astype(int), [0]])
    starts, ends = np.flatnonzero(np.diff(dark) == 1), np.flatnonzero(np.diff(dark) == -1)
    return int((ends - starts).max()) if len(starts) else 0


PAD_TAGS = tuple(tag.label for tag in PAD.tags)
