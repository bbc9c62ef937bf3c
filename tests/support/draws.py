"""Parameters of which the default run takes the first few, ``-m slow`` the next, and ``-m nightly`` the others."""

from __future__ import annotations

from typing import Any

import pytest


def first_of(*values: Any, few: int = 1) -> list[Any]:
    """Values for ``parametrize`` with one name: every value is a draw that tests the same claim."""
    return [*values[:few], *(pytest.param(value, marks=pytest.mark.slow) for value in values[few:])]


def draws_of(few: Any, some: Any, many: Any) -> list[Any]:
    """Numbers of draws for ``parametrize``: of the default run, the slow one and the nightly one."""
    return [few, pytest.param(some, marks=pytest.mark.slow), pytest.param(many, marks=pytest.mark.nightly)]


def slow_of(*values: Any, few: int) -> list[Any]:
    """Values for ``parametrize`` with one name: the slow run takes the first ``few``, the nightly run the others."""
    return [
        pytest.param(value, marks=pytest.mark.slow if k < few else pytest.mark.nightly)
        for k, value in enumerate(values)
    ]


def first_rows_of(*rows: tuple[Any, ...], few: int = 1) -> list[Any]:
    """Rows for ``parametrize`` with several names: every row is a draw that tests the same claim."""
    return [*rows[:few], *(pytest.param(*row, marks=pytest.mark.slow) for row in rows[few:])]
