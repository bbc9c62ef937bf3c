"""Reads printed sheets back: a PDF's polygons by the few operators that they need, a PNG with its resolution."""

from __future__ import annotations

import re
import struct

import cv2
import numpy as np

DOTS_PER_MM = 10.0


def png_with_resolution(data: bytes):
    """The picture, and its dots a millimetre by the file's own words."""
    place = data.index(b"pHYs") + 4
    across, down, unit = struct.unpack(">IIB", data[place : place + 9])
    assert (across, unit) == (down, 1)
    return cv2.imdecode(np.frombuffer(data, np.uint8), cv2.IMREAD_GRAYSCALE), across / 1000.0


def pdf_pages(data: bytes):
    """Each page as a picture of DOTS_PER_MM, and its strokes as ((x, y), (x, y)) in millimetres of the paper."""
    boxes = re.findall(rb"/MediaBox \[0 0 ([\d.]+) ([\d.]+)\]", data)
    contents = re.findall(rb"stream\n(.*?)\nendstream", data, re.DOTALL)
    assert len(boxes) == len(contents)
    return [_page(content.decode("latin-1"), *map(float, box)) for content, box in zip(contents, boxes, strict=True)]


def _page(content, width, height):  # noqa: C901  (an operator a line)
    mm = 25.4 / 72.0
    size = (round(height * mm * DOTS_PER_MM), round(width * mm * DOTS_PER_MM))
    picture, strokes = np.full(size, 255, np.uint8), []
    matrix, stack, path, clip, grey = np.eye(3), [], [], None, 0
    for line in content.split("\n"):
        stroke = re.fullmatch(r"(?:[\d.]+ w )?(-?[\d.]+) (-?[\d.]+) m (-?[\d.]+) (-?[\d.]+) l S", line)
        if stroke is not None:
            x0, y0, x1, y1 = map(float, stroke.groups())
            ends = np.array([(x0, y0, 1.0), (x1, y1, 1.0)]) @ matrix
            strokes.append(tuple((float(x) * mm, float(height - y) * mm) for x, y, _ in ends))
            continue
        *numbers, operator = line.split() if "BT" not in line else ["Tj"]
        values = [float(each) for each in numbers if re.fullmatch(r"-?[\d.]+", each)]
        if operator == "q":
            stack.append((matrix, clip))
        elif operator == "Q":
            matrix, clip = stack.pop()
        elif operator == "cm":
            a, b, c, d, e, f = values
            matrix = np.array([(a, b, 0.0), (c, d, 0.0), (e, f, 1.0)]) @ matrix
        elif operator == "n":
            x, y, w, h = values
            clip = np.array([(x, y, 1.0), (x + w, y + h, 1.0)]) @ matrix
        elif operator == "g":
            grey = round(255 * values[0])
        elif operator == "m":
            path.append([values])
        elif operator == "l":
            path[-1].append(values)
        elif operator == "f":
            _fill(picture, path, matrix, clip, height, grey)
            path = []
    return picture, strokes


def _fill(picture, path, matrix, clip, height, grey):
    k = 25.4 / 72.0 * DOTS_PER_MM * 16
    drawn = picture.copy()
    for polygon in path:
        places = np.array([(x, y, 1.0) for x, y in polygon]) @ matrix
        dots = np.round(np.column_stack([places[:, 0], height - places[:, 1]]) * k - 8).astype(np.int32)
        cv2.fillPoly(drawn, [dots], grey, cv2.LINE_8, 4)
    (x0, y0), (x1, y1) = clip[0, :2], clip[1, :2]
    left, right = sorted((round(x0 * k / 16), round(x1 * k / 16)))
    top, bottom = sorted((round((height - y0) * k / 16), round((height - y1) * k / 16)))
    picture[top:bottom, left:right] = drawn[top:bottom, left:right]
