"""Long tests begin first on every worker."""

import pytest
from dealt_tests import dealt


def worksteal_parts(tests: list[str], workers: int) -> list[list[str]]:
    """What ``worksteal`` gives each worker at first."""
    left, parts = list(tests), []
    for part in range(workers):
        size = len(left) // (workers - part)
        parts.append(left[:size])
        del left[:size]
    return parts


@pytest.mark.parametrize("workers", [1, 2, 3, 5, 8])
def test_each_worker_begins_with_its_share_of_the_long_tests_the_longest_first(workers: int):
    long, short = [f"long {k}" for k in range(11)], [f"short {k}" for k in range(97)]
    tests = dealt(long, short, workers)
    assert sorted(tests) == sorted(long + short)
    assert [test for test in tests if test in short] == short, "in their order: modules stay together"
    for part, given in enumerate(worksteal_parts(tests, workers)):
        share = long[part::workers]
        assert given[: len(share)] == share
        assert not set(given[len(share) :]) & set(long)


@pytest.mark.parametrize(("long", "short"), [(0, 0), (0, 3), (3, 0), (1, 2), (9, 1)])
def test_fewer_tests_than_workers_are_all_dealt(long: int, short: int):
    tests = dealt([f"long {k}" for k in range(long)], [f"short {k}" for k in range(short)], 5)
    assert len(tests) == len(set(tests)) == long + short
