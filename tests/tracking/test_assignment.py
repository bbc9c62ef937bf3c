"""The assignment against scipy's."""

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from scipy.optimize import linear_sum_assignment

from fwav_companion.tracking.assignment import least_cost_assignment


@settings(max_examples=150, derandomize=True, deadline=None)
@given(st.integers(1, 10), st.integers(0, 10), st.integers(0, 2**32 - 1), st.booleans())
def test_it_costs_what_scipys_costs(rows, more, seed, ties):
    rng = np.random.default_rng(seed)
    shape = (rows, rows + more)
    costs = rng.integers(-3, 4, shape).astype(float) if ties else rng.normal(size=shape) * 10
    chosen = least_cost_assignment([dict(enumerate(row)) for row in costs.tolist()])
    assert len(set(chosen)) == rows
    expected = costs[linear_sum_assignment(costs)].sum()
    assert sum(costs[i, j] for i, j in enumerate(chosen)) == pytest.approx(expected, abs=1e-9)


def test_nothing_to_assign():
    assert least_cost_assignment([]) == ()


def test_more_rows_than_columns_are_refused():
    with pytest.raises(ValueError, match="row 1 cannot be assigned"):
        least_cost_assignment([{0: 1.0}, {0: 2.0}])
