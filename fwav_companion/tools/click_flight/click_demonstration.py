"""SHELL: ``demo --click``: flies, clicks, compares with the truth, and writes the report."""

from __future__ import annotations

from collections.abc import Callable
from itertools import pairwise
from math import hypot
from pathlib import Path
from typing import Final

import msgspec

from fwav_companion.geometry.earth import Geodetic, TangentPlane
from fwav_companion.geometry.ellipses import circle_radius
from fwav_companion.on_disk import whole
from fwav_companion.recording.line_types import TargetLine
from fwav_companion.service.configured_files import load_calibration
from fwav_companion.tools.click_flight.click_report import click_page
from fwav_companion.tools.click_flight.click_score import PASS_GAP_S, ClickScore, is_whole, sample, with_troubles
from fwav_companion.tools.click_flight.clicked_flight import Click, ClickedFlight
from fwav_companion.tools.click_flight.rendered_flight import RenderedFlight, TrueSpot
from fwav_companion.types.spots import CLICK_LABEL
from fwav_companion.vision.images import Found, Pixels
from fwav_companion.vision.preview_drawing import drawn

LOOKS_AFTER_S: Final = 5.5
"""Time after the first frame at which the operator looks: the clock has settled, the vehicle is localized."""
KEPT_PICTURES: Final = 3
"""Pictures in the report: the click, the next pass, the last one."""

Shown = tuple[str, bytes]
"""(caption, JPEG)."""


class ClickDemonstration:
    """One flight with a click, in a folder of its own."""

    def __init__(self, out: Path, seed: int, seconds: float) -> None:
        self._out, self._seed, self._seconds = out, seed, seconds

    def fly(self, progress: Callable[[str], None]) -> tuple[ClickScore, Path]:
        """The score, and the path of the report. ``progress`` is called with the name of each step."""
        progress("the vehicle flies")
        mock = RenderedFlight(self._out / "click", self._seed, self._seconds)
        recording, calibration = mock.recorded(), load_calibration(mock.config)
        flight = ClickedFlight(mock.config, calibration, recording, seed=self._seed, from_s=LOOKS_AFTER_S)
        with mock.pictures(flight.first_shown) as pictures:
            flight.fly(pictures, lambda frame: progress(f"picture {frame}"))
        progress("the truth")
        spot = None if flight.click is None else mock.spot(flight.click.frame, flight.click.pixel)
        score = self._score(flight, spot, calibration.image_size)
        shown = [] if flight.click is None else _pictures(mock, flight.click, score)
        path = self._out / "report.html"
        command = f"fwav-companion demo --click --seed {self._seed} --seconds {self._seconds:g}"
        with whole(path) as file:
            file.write(click_page(score, shown, command=command).encode())
        return score, path

    def _score(self, flight: ClickedFlight, spot: TrueSpot | None, size: tuple[int, int]) -> ClickScore:
        if flight.click is None or spot is None:
            why = "; ".join(flight.refusals) or "no ground in view"
            return ClickScore(refusals=tuple(flight.refusals), troubles=(f"no click was taken: {why}",))
        found = {each.frame: each.pixel for each in flight.found}
        seen = [each for each in spot.sights if each.frame > flight.click.frame]
        samples = tuple(
            sample(
                each.frame,
                at_s=each.at_s,
                true=each.pixel,
                blur_px=each.blur_px,
                scale=each.metres_per_px,
                found=found.get(each.frame),
            )
            for each in seen
            if is_whole(each.pixel, size) and each.frame >= flight.followed_from
        )
        confirmed = [line for line in flight.lines if line.is_confirmed]
        score = ClickScore(samples=samples, refusals=tuple(flight.refusals), confirmed=bool(confirmed))
        if not confirmed or flight.origin is None:
            return with_troubles(score, None, right_picture=_is_right(flight.click), strays=())
        last = confirmed[-1]
        score = msgspec.structs.replace(
            score, error_m=_error_m(last, spot, flight.origin), claimed95_m=circle_radius(last.cov, 0.95)
        )
        strays = sorted(found.keys() - {each.frame for each in spot.sights})
        return with_troubles(score, last.cov, right_picture=_is_right(flight.click), strays=strays)


def _is_right(click: Click) -> bool:
    return click.frame == click.taken_frame


def _error_m(line: TargetLine, spot: TrueSpot, origin: Geodetic) -> float:
    """Horizontal distance of a target from the spot, both on the globe."""
    north, east, _ = TangentPlane(origin).ned_from_geodetic(Geodetic.from_degrees(spot.lat, spot.lon, 0.0))
    return hypot(line.north - north, line.east - east)


def _pictures(mock: RenderedFlight, click: Click, score: ClickScore) -> list[Shown]:
    """The picture that was clicked on, and later ones in which the spot was found, rendered again."""
    wanted: dict[int, tuple[str, list[Found]]] = {
        click.frame: ("The picture that was clicked on.", [_mark(click.pixel, "click")])
    }
    found = [each for each in score.samples if each.found_px is not None]
    later = [after for before, after in pairwise(found) if after.at_s > before.at_s + PASS_GAP_S]
    for each in [*later[-1:], *found[-1:]][: KEPT_PICTURES - 1]:
        if each.found_px is not None and each.frame not in wanted:
            text = f"Found again {each.at_s - _first_s(score):.1f} s later, {each.error_px:.1f} px from the true spot."
            wanted[each.frame] = (text, [_mark(each.found_px, CLICK_LABEL)])
    shown = []
    for frame in sorted(wanted):
        caption, marks = wanted[frame]
        pixels = _rendered(mock, frame)
        if pixels is not None:
            shown.append((caption, drawn(pixels, marks)))
    return shown


def _first_s(score: ClickScore) -> float:
    return score.samples[0].at_s if score.samples else 0.0


def _mark(pixel: tuple[float, float], label: str) -> Found:
    u, v = pixel
    return {"u": u, "v": v, "label": label, "box": [u - 15.0, v - 15.0, u + 15.0, v + 15.0]}


def _rendered(mock: RenderedFlight, frame: int) -> Pixels | None:
    with mock.pictures(frame) as pictures:
        number, pixels = next(pictures, (-1, None))
        return pixels if number == frame else None
