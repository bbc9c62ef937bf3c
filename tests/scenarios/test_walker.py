"""A walker that reverses, seen from a vehicle that flaps, with all other errors drawn from the priors."""

import pytest
from draws import first_of
from flying import fly

from sitl_mock import scenario


@pytest.mark.parametrize("seed", first_of(1, 2, 6))
def test_a_walker_who_turns_about_stays_one_target(seed):
    """It reverses at once, every five seconds: 3 m/s from one frame to the next. It had up to eight ids in a minute."""
    flight = fly(scenario("walker").but({"seconds": 22.0, "seed": seed}), ["tracking.motion=moving"])
    believed = [line for line in flight.companion.targets("person") if line.is_confirmed]
    assert {line.track for line in believed} == {1}
    assert not [line for line in believed if line.state == "coasting"]
