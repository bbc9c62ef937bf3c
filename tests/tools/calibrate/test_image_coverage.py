"""The progress of the search says which parts of the image the boards have covered."""

import numpy as np

from fwav_companion.tools.calibrate.image_coverage import ImageCoverage


def test_coverage_counts_parts_with_a_corner_and_names_the_corners_without_a_board():
    coverage = ImageCoverage()
    assert coverage.shown() == (
        "0 % of the image covered, no board in the upper left, upper right, lower left, lower right"
    )
    coverage.add(np.array([(5.0, 5.0), (635.0, 5.0), (636.0, 6.0)]), 640, 480)
    assert coverage.share == 2 / 24
    assert coverage.shown() == "8 % of the image covered, no board in the lower left, lower right"
    everywhere = np.stack(np.meshgrid(np.linspace(-0.5, 639.5, 50), np.linspace(-0.5, 479.5, 50)), -1).reshape(-1, 2)
    coverage.add(everywhere, 640, 480)
    assert coverage.shown() == "100 % of the image covered"
