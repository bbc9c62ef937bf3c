"""One flight in invented time, whose pictures were rendered and looked at, for all tests that want one."""

import pytest
from rendered_flights import fly_rendered


@pytest.fixture(scope="session")
def flight():
    """(companion, mock)."""
    return fly_rendered(8, 9.0)
