"""One local cluster for all tests of studies: its start costs seconds."""

import pytest

from fwav_companion.tools.study.cluster import workers


@pytest.fixture(scope="session")
def cluster():
    with workers(count=2) as connected:
        yield connected
