"""The map contains everything that it shows, with names."""

import re

from report_lines import header, summary, target

from fwav_companion.tools.report import flight_data
from fwav_companion.tools.report.map_drawing import MAP_SIZE, flight_map

WIDE_LETTER = 9.0
"""Width of a wide letter, 13 px bold."""


def test_names_stay_on_the_map():
    lines = [
        header(),
        *(target(0.0, 0.0, east, track=track, label="pedestrian") for track, east in enumerate((-9, 0, 9))),
    ]
    drawn = flight_map(flight_data([*lines, summary()], title=""))
    names = re.findall(r'<text class="label" x="([\d.]+)" y="[\d.]+" text-anchor="(\w+)">([^<]+)<', drawn)
    assert len(names) == 3
    for x, anchor, name in names:
        width = WIDE_LETTER * len(name)
        left = float(x) - (width if anchor == "end" else 0.0)
        assert left >= 0.0
        assert left + width <= MAP_SIZE
    assert [anchor for *_, anchor, _ in names] == ["start", "start", "end"]
