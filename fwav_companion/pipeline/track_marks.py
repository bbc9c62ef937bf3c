"""Pixels of the tracks in a picture of the service's own camera, for the preview. PURE."""

from __future__ import annotations

from collections.abc import Iterable
from typing import Final

from fwav_companion.pairing import PictureRows
from fwav_companion.pipeline.clicked_spots import SpotCamera, in_picture, spot_view
from fwav_companion.types import Frame, Track
from fwav_companion.types.track_marks import TrackMark, TrackMarks

MOST_MARKS: Final = 32
"""Most marks in a picture: more would hide it."""


def track_marks(camera: SpotCamera, frame: Frame, tracks: Iterable[Track], selected: Track | None) -> TrackMarks:
    """Marks of the tracks that a picture shows, at most MOST_MARKS, the selected track's first."""
    rows = camera.picture_rows(frame)
    if rows is None:
        return TrackMarks(frame.picture or 0, ())
    chosen = None if selected is None else selected.id
    in_order = sorted(tracks, key=lambda track: track.id != chosen)
    marks = (_mark(camera, rows, track, chosen) for track in in_order)
    return TrackMarks(frame.picture or 0, tuple(mark for mark in marks if mark is not None)[:MOST_MARKS])


def _mark(camera: SpotCamera, rows: PictureRows, track: Track, chosen: int | None) -> TrackMark | None:
    """The mark of one track, at the capture of the row that shows it; None where it is outside the picture."""
    middle = camera.view_at(rows.middle_ns)
    at = None if middle is None else middle.pixel_of(track.apparent_ned)
    view = None if at is None else camera.view_at(rows.host_ns(at[1]))
    seen = None if view is None else spot_view(view, track.apparent_ned, 0.0)
    if seen is None:
        return None
    shown = in_picture(seen, rows.scaling)
    (nn, ne, _), (_, ee, _), _ = track.relative_cov
    u_n, u_e, v_n, v_e = shown.pixel_from_ground
    return TrackMark(
        track=track.id,
        label=track.label,
        state=track.state.value,
        selected=track.id == chosen,
        at=shown.at,
        cov=(
            u_n * u_n * nn + 2.0 * u_n * u_e * ne + u_e * u_e * ee,
            u_n * v_n * nn + (u_n * v_e + u_e * v_n) * ne + u_e * v_e * ee,
            v_n * v_n * nn + 2.0 * v_n * v_e * ne + v_e * v_e * ee,
        ),
    )
