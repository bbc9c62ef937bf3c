"""report.html: one file that tells a flight to somebody who was not there. Pure: lines of a recording in, HTML out."""

from fwav_companion.tools.report.courses import Replayed
from fwav_companion.tools.report.learning import learning
from fwav_companion.tools.report.page import Chapter, page
from fwav_companion.tools.report.story import PictureShown, Planted, Story, tell
from fwav_companion.tools.report.three_ways import three_ways
from fwav_companion.tools.report.ways import CALIBRATED, PAPER, PLAIN, WAYS, Way, way_of

__all__ = [
    "CALIBRATED",
    "PAPER",
    "PLAIN",
    "WAYS",
    "Chapter",
    "PictureShown",
    "Planted",
    "Replayed",
    "Story",
    "Way",
    "learning",
    "page",
    "tell",
    "three_ways",
    "way_of",
]
