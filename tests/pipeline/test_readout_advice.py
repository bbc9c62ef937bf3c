"""Advice to set `readout_s`: only where an unknown one limits the accuracy, and once."""

import pytest
from flying import fly

from fwav_companion.types import NoticeCode
from sitl_mock import scenario

SLOW_FRAMES = {"seed": 3, "camera.readout_s": 0.03, "camera.fps": 3.0, "seconds": 28.0}
CALM_RATES = ("rates.attitude=50",)
"""Ten attitudes a wing beat show the motion as well as twenty, and cost half."""


@pytest.mark.parametrize(
    ("changes", "readout", "advised"),
    [
        (SLOW_FRAMES, '"unknown"', 1),
        (SLOW_FRAMES, "0.03", 0),
        ({**SLOW_FRAMES, "flight.flapping_pitch_deg": 0.0, "flight.flapping_roll_deg": 0.0}, '"unknown"', 0),
    ],
    ids=["flapping and unknown", "known", "a calm vehicle"],
)
def test_the_advice_is_given_where_it_helps(changes, readout, advised):
    flown = fly(scenario("unbiased").but(changes), (f"camera.readout_s={readout}", *CALM_RATES))
    assert flown.companion.codes.count(NoticeCode.READOUT_UNKNOWN) == advised
    status = flown.companion.pipeline.status(flown.mock.end_ns).seen.readout
    assert status.matters is bool(advised)


def test_photographs_with_an_unknown_readout_are_used():
    """Half of a second between two pictures says nothing of the readout: it refuses none of them."""
    known, unknown = (
        fly(scenario("unbiased").but({**SLOW_FRAMES, "camera.fps": 1.1}), (f"camera.readout_s={each}", *CALM_RATES))
        for each in ("0.03", '"unknown"')
    )
    dropped = unknown.companion.lines[-1].dropped
    assert not {"stale_attitude", "attitude_gap"} & dropped.keys()
    assert unknown.companion.lines[-1].fixes > 0.5 * known.companion.lines[-1].fixes
