"""One flight in invented time with rendered pictures and detections, shared by the tests."""

import pytest
from rendered_flights import fly_rendered


@pytest.fixture(scope="session")
def flight():
    """(companion, mock)."""
    return fly_rendered(8, 9.0)
