"""The picture that the camera saw, with what was found in it. Pure."""

from __future__ import annotations

from base64 import b64encode

from fwav_companion.tools.report.story import PictureShown
from fwav_companion.tools.report.svg import cross, drawing, number, text
from fwav_companion.tools.report.words import short


def picture(shown: PictureShown) -> str:
    """The frame, with boxes, centres and labels over it."""
    width, height = shown.size
    data = b64encode(shown.jpeg).decode()
    parts = [f'<image href="data:image/jpeg;base64,{data}" width="{width}" height="{height}"/>']
    for found in shown.detections:
        u, v = found["u"] + 0.5, found["v"] + 0.5
        if found.get("box"):
            left, top, right, bottom = (side + 0.5 for side in found["box"])
            box = f'x="{number(left)}" y="{number(top)}" width="{number(right - left)}" height="{number(bottom - top)}"'
            parts.append(f'<rect class="box" {box}/>')
            above = top - 8 if top > 30 else bottom + 22
            parts.append(text((left, above), short(str(found.get("label", ""))), "box-label"))
        parts.append(cross((u, v), 9, "aim"))
    return drawing(width, height, parts, f"Frame {shown.frame} with its detections")
