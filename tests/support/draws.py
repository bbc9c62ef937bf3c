"""Parameters of which the default run takes the first few, ``-m slow`` the next, and ``-m nightly`` the others."""

from __future__ import annotations

from typing import Any

import pytest


def _marks(number: int, few: int, some: int | None) -> tuple[pytest.MarkDecorator, ...]:
    """The mark of a parameter: ``few`` have none, the next ``some`` (None: all) are slow, the others nightly."""
    if number < few:
        return ()
    return (pytest.mark.slow if some is None or number < few + some else pytest.mark.nightly,)


def first_of(*values: Any, few: int = 1, some: int | None = None) -> list[Any]:
    """Values for ``parametrize`` with one name: every value is a draw that tests the same claim."""
    return [pytest.param(value, marks=_marks(k, few, some)) for k, value in enumerate(values)]


def first_rows_of(*rows: tuple[Any, ...], few: int = 1, some: int | None = None) -> list[Any]:
    """Rows for ``parametrize`` with several names: every row is a draw that tests the same claim."""
    return [pytest.param(*row, marks=_marks(k, few, some)) for k, row in enumerate(rows)]


def slow_of(*values: Any, few: int) -> list[Any]:
    """Values for ``parametrize`` with one name: the slow run takes the first ``few``, the nightly run the others."""
    return first_of(*values, few=0, some=few)


def draws_of(few: Any, some: Any, many: Any) -> list[Any]:
    """Numbers of draws for ``parametrize``: of the default run, the slow one and the nightly one."""
    return first_of(few, some, many, few=1, some=1)
