"""A thing that moves and one that does not, in one flight: each is tracked by the motion of its own label."""

import numpy as np
import pytest
from flying import LINK, fly

from sitl_mock import TargetOptions, scenario

CAMERA = '[camera]\ncalibration = "camera.yaml"\nreadout_s = 0.0\n'
BOAT_MOVES = '[[target]]\nlabel = "boat"\nmotion = "moving"\n'
POST_STANDS = '[tracking]\nmotion = "moving"\n[[target]]\nlabel = "post"\nmotion = "static"\n'
HARBOUR = scenario("copter_circles").but(
    {
        "seconds": 18.0,
        "camera.clutter": 0.0,
        "targets": (
            TargetOptions(label="boat", north=-3.0, east=-2.0, speed_m_s=0.5, course_deg=60.0),
            TargetOptions(label="post", north=1.0, east=2.0),
        ),
    }
)


@pytest.mark.parametrize("targets", [BOAT_MOVES, POST_STANDS])
def test_each_label_is_tracked_by_its_own_motion(targets):
    flight = fly(HARBOUR, ("tracking.self_calibration=false",), text=LINK + CAMERA + targets)
    boat, post = (
        [line for line in flight.companion.targets(label) if line.state == "confirmed" and line.fix][60:]
        for label in ("boat", "post")
    )
    assert len({line.track for line in boat + post}) == 2, "one track each"
    assert all(line.vel is None for line in post)
    north, east, _ = np.mean([line.vel for line in boat[-100:]], axis=0)
    assert (north, east) == pytest.approx((0.25, 0.43), abs=0.2)
    for lines in (boat, post):
        squares = [flight.relative_error(line)[1] for line in lines]
        assert np.mean(squares) < 3.0, "two degrees of freedom"
