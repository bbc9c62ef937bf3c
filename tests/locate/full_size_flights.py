"""By hand: one rendered flight at full size (12 Mpx) for each maker's layout, from the pixels to the map.

    python -m tests.locate.full_size_flights [LAYOUT...]

The mock draws six pictures of a field with AprilTags and writes the tags of the maker; the detector finds the tags, and
`locate` their places. The truth is the mock's. Exit 1 where a place is beyond its claimed 99.9 %, or a tag is missed.
"""

# ruff: noqa: T201

from __future__ import annotations

import sys
import tempfile
from pathlib import Path

import pymap3d

from fwav_companion.geometry.ellipses import circle_radius
from fwav_companion.photographs.picture_pose import AltDatum
from fwav_companion.tools.locate.answers import PlaceAnswers
from fwav_companion.tools.locate.detections import detected_clicks
from fwav_companion.tools.locate.heights import VerticalOptions
from fwav_companion.tools.locate.photographs import CameraOptions, read_photographs
from fwav_companion.tools.locate.session import LocateOptions, LocateSession
from fwav_companion.vision.detectors import make_detector
from fwav_companion.vision.task import VisionTask
from sitl_mock import photograph_set
from sitl_mock.maker_tags import LAYOUTS
from tests.locate.test_makers_layouts import BY_GROUND

CERTAIN = 0.999


def flown(layout: str, seed: int) -> bool:
    """Draw, detect, locate and compare; prints a line for each tag."""
    photograph_set.WIDTH, photograph_set.HEIGHT, photograph_set.FOCAL_PX = 4000, 3000, 4000 * 24 / 36
    photograph_set.dji_rtk = LAYOUTS[layout]
    detector = make_detector(VisionTask(source="pictures", detector="apriltag"))
    good = True
    with tempfile.TemporaryDirectory() as folder:
        made = photograph_set.write_photographs(Path(folder), seed)
        photographs = read_photographs(made.pictures, CameraOptions())
        clicks = [click for each in photographs for click in detected_clicks(each, detector)]
        ground = photograph_set.HOME.alt_amsl
        given = VerticalOptions(ground_alt_m=ground) if layout in BY_GROUND else VerticalOptions()
        if layout == "wingtra":  # its tags do not state the datum
            given = VerticalOptions(ground_alt_m=ground, alt_datum=AltDatum.ELLIPSOID)
        answers = LocateSession(photographs, LocateOptions(vertical=given)).located(clicks, 0.5)
        if not isinstance(answers, PlaceAnswers):
            print(f"{layout}: {answers.line}")
            return False
        for mark in made.marks:
            answer = next((each for each in answers.targets if each.label == f"tag36h11:{mark.tag_id}"), None)
            if answer is None:
                print(f"{layout}: tag {mark.tag_id} is missed")
                good = False
                continue
            north, east, _ = pymap3d.geodetic2ned(answer.lat, answer.lon, 0.0, mark.place.lat, mark.place.lon, 0.0)
            error_m, claimed_m = (north**2 + east**2) ** 0.5, circle_radius(answer.cov, CERTAIN)
            good &= error_m <= claimed_m
            said = f"{error_m:.2f} m off, 95 % {answer.radius95_m:.2f} m, 99.9 % {claimed_m:.2f} m"
            print(f"{layout}: tag {mark.tag_id} in {len(answer.pictures)} pictures: {said}")
        for shared in answers.shared:
            print(f"{layout}: shared {shared.error} {shared.value:+.2f} +- {shared.sigma:.2f} {shared.unit}")
        if answers.contradiction:
            print(f"{layout}: {answers.contradiction}")
    return good


if __name__ == "__main__":
    results = [flown(layout, 3) for layout in sys.argv[1:] or LAYOUTS]
    sys.exit(0 if all(results) else 1)
