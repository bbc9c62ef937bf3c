"""report.html: one file that tells a flight to somebody who was not there. Pure: lines of a recording in, HTML out."""

from fwav_companion.report.page import page
from fwav_companion.report.story import PictureShown, Story, tell

__all__ = ["PictureShown", "Story", "page", "tell"]
