"""The sections with the map, the picture that the camera saw, and the table of targets. Pure."""

from __future__ import annotations

from base64 import b64encode
from collections.abc import Sequence
from html import escape

from fwav_companion.geometry.ellipses import NORMAL_95
from fwav_companion.recording.labels import display_name
from fwav_companion.tools.report.drawing import cross, drawing, number, text
from fwav_companion.tools.report.flight_data import CameraPicture, FlightData
from fwav_companion.tools.report.map_drawing import flight_map
from fwav_companion.tools.report.page_elements import KeyEntry, figure, key, row, table
from fwav_companion.tools.report.target_series import TargetSeries
from fwav_companion.tools.report.wording import table_length

FROM_ORIGIN = "View from above, north up, metres from the origin."
FROM_VEHICLE = (
    "View from above, north up, metres from the point below the camera. The vehicle's own position was not known, so "
    "a target that does not move on the ground moves here."
)
MAP_WORDS = (
    "Each small dot is one sighting, projected to the ground with the vehicle's attitude at the time when its image "
    "row was exposed. The ellipse contains the target with 95 %. It includes errors that the dots cannot show: errors "
    "of position, compass and mount are equal in all pictures and do not average out."
)
RELATIVE_ERROR, MAP_ERROR, PLACE = ("error relative to the vehicle",), ("error on the map",), ("latitude", "longitude")
"""Columns that a table has only where something is known for them."""


def map_section(flight: FlightData, right: str = "") -> str:
    """Two sections: the map with the camera's picture, or else with the figure ``right``; and the table."""
    drawn = flight_map(flight)
    if flight.picture is not None:
        right = _picture_figure(flight.picture)
    if drawn:
        caption = f"{FROM_ORIGIN if flight.origin else FROM_VEHICLE} {MAP_WORDS}"
        drawn = figure("Map", drawn, caption, key=_key(flight))
    both = f'<section class="two">{drawn}{right}</section>' if drawn or right else ""
    return f"{both}{_table(flight)}{_landmark_table(flight)}"


def _key(flight: FlightData) -> str:
    entries: list[KeyEntry] = []
    if flight.path:
        entries.append(("path", "line", "true path" if flight.path_is_true else "estimated position at the sightings"))
    if any(target.fixes for target in flight.targets):
        entries.append(("fix", "dot", "one sighting on the ground"))
    if any(target.last for target in flight.targets):
        entries += [("estimate", "dot", "estimate"), ("ellipse", "area", "95 % ellipse")]
    if any(target.relative_ned for target in flight.targets):
        entries.append(("relative", "dot", "estimate without the GNSS error"))
    if any(target.true_ned for target in flight.targets):
        entries.append(("truth", "cross", "truth"))
    if flight.landmarks:
        entries.append(("landmark", "dot", "landmark"))
    return key(entries)


def _landmark_table(flight: FlightData) -> str:
    """Result of each landmark; empty without landmarks."""
    if not flight.landmarks:
        return ""
    head = ["landmark", "north, m", "east, m", "surveyed to, 95 %", "sights used", "sights refused", "result"]
    rows = [
        row(
            [
                display_name(each.label), f"{each.north:.2f}", f"{each.east:.2f}",
                table_length(NORMAL_95 * each.sigma_m), f"{each.used}", f"{each.refused}", each.result,
            ],
            "off" if each.left_out else "",
        )
        for each in flight.landmarks
    ]  # fmt: skip
    return f"<section>{table(head, rows)}</section>"


def _table(flight: FlightData) -> str:
    if not flight.targets:
        return ""
    columns = [
        column for column, is_known in (
            (RELATIVE_ERROR, any(target.relative_error_m is not None for target in flight.targets)),
            (MAP_ERROR, flight.has_truth),
            (PLACE, any(target.place for target in flight.targets)),
        ) if is_known
    ]  # fmt: skip
    head = ["target", "north, m", "east, m", "claimed radius, 95 %", *(name for each in columns for name in each)]
    return f"<section>{table(head, [_row(target, columns) for target in flight.targets])}</section>"


def _row(target: TargetSeries, columns: Sequence[tuple[str, ...]]) -> str:
    last = target.last
    if last is None:
        width = 3 + sum(map(len, columns))
        return f'<tr><td>{escape(target.name)}</td><td colspan="{width}">not found</td></tr>'
    cells = [target.title, f"{last.north:.2f}", f"{last.east:.2f}", table_length(last.radius95_m)]
    kind, judged = "", -1
    for column in columns:
        if column is RELATIVE_ERROR:
            cells.append("" if target.relative_error_m is None else table_length(target.relative_error_m))
        elif column is PLACE:
            cells += [f"{target.place[0]:.7f}", f"{target.place[1]:.7f}"] if target.place else ["", ""]
        else:
            judged = len(cells)
            cells.append("" if last.error_m is None else table_length(last.error_m))
            if last.error_m is not None:
                kind = "good" if last.error_m <= last.radius95_m else "off"
    return row(cells, kind, judged)


def _picture_figure(shown: CameraPicture) -> str:
    caption = (
        f"Frame {shown.frame}, {shown.size[0]} × {shown.size[1]} pixels, as the camera delivered it: fisheye, rolling "
        "shutter, motion blur of the flapping, noise. Boxes and crosses are the detections."
    )
    items = "".join(
        f"<li><b>{escape(display_name(str(each.get('label', ''))))}</b> at ({each['u']:.1f}, {each['v']:.1f}) px, "
        f"± {NORMAL_95 * _sigma(each.get('sigma')):.1f} px (95 %)</li>"
        for each in shown.detections
    )
    return figure("Picture of the camera", _picture(shown), caption, below=f'<ul class="seen">{items}</ul>')


def _picture(shown: CameraPicture) -> str:
    """The frame with the detections' boxes, centres and names."""
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
            parts.append(text((left, above), display_name(str(found.get("label", ""))), "box-label"))
        parts.append(cross((u, v), 9, "aim"))
    return drawing(width, height, parts, f"Frame {shown.frame} with its detections")


def _sigma(sigma: object) -> float:
    """The larger of a detection's sigmas, pixels."""
    if isinstance(sigma, int | float):
        return float(sigma)
    return max((float(each) for each in sigma), default=0.0) if isinstance(sigma, list | tuple) else 0.0
