"""What the model of the corners holds leaves nothing in them: with hardly any noise, as little is left."""

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
    """Not modelled, the slope leaves 0.065 px, and the hand's own speed from row to row 0.155.

    Behind rows something stays: that speed is only known as it is over a third of a second.
    """
    shaken = hands.found()
    assert shaken.pixel_sigma < most_px
    assert abs(shaken.delay.value - hands.delay_s) < 5e-5
    assert (abs(correction_deg(shaken) - hands.mount_deg) < (0.01, 0.01, 0.1)).all()
