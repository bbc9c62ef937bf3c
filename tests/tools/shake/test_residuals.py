"""Residuals of the corners contain only noise if the model describes the motion: with hardly any noise they are as
small.
"""

import pytest
from hands import Hands, correction_deg

STEADY = Hands(seed=4, corner_px=0.02, attitude_deg=0.0)
ROWS = STEADY.but(readout_s=0.02, assumed_readout=(0.02, 0.0))


@pytest.mark.parametrize(
    ("hands", "most_px"),
    [
        (STEADY, 0.022),
        (STEADY.but(slope_deg=(0.5, -0.4)), 0.022),
        (ROWS, 0.08),
        (ROWS.but(assumed_readout=(1 / 60, 1 / 30 / 12**0.5)), 0.08),
    ],
    ids=["plain", "slope", "rows", "rows unknown"],
)
def test_what_is_modelled_leaves_only_the_corners_noise(hands, most_px):
    """Without modelling, the slope leaves 0.065 px, and the hand's own speed from row to row 0.155.

    With a readout a residual remains: that speed is only known as its mean over a third of a second.
    """
    shaken = hands.found()
    assert shaken.pixel_sigma < most_px
    assert abs(shaken.delay.value - hands.delay_s) < 5e-5
    assert (abs(correction_deg(shaken) - hands.mount_deg) < (0.01, 0.01, 0.1)).all()
