"""The assignment of least total cost, for small tables (ten tracks, twenty fixes).

Shortest augmenting paths with dual prices (Kuhn-Munkres in the form of Jonker and Volgenant): one row after another is
brought in along the cheapest path of swaps, O(rows^2 columns).
"""

from __future__ import annotations

from collections.abc import Sequence
from math import inf


def least_cost_assignment(costs: Sequence[Sequence[float]]) -> tuple[int, ...]:
    """The column of each row, no column twice; finite costs, rows <= columns. Ties go to the lower column first met."""
    rows, columns = len(costs), len(costs[0]) if costs else 0
    if rows > columns:
        msg = f"at most as many rows as columns can be assigned, got {rows} x {columns}"
        raise ValueError(msg)
    row_price = [0.0] * rows
    column_price = [0.0] * columns
    row_of = [-1] * columns
    for row in range(rows):
        _bring_in(row, costs, row_price, column_price, row_of)
    column_of = [0] * rows
    for column, row in enumerate(row_of):
        if row >= 0:
            column_of[row] = column
    return tuple(column_of)


def _bring_in(
    new_row: int,
    costs: Sequence[Sequence[float]],
    row_price: list[float],
    column_price: list[float],
    row_of: list[int],
) -> None:
    """Assign one more row along the cheapest augmenting path, keeping every reduced cost non-negative."""
    columns = len(row_of)
    distance = [inf] * columns
    came_from = [-1] * columns
    done: list[int] = []
    open_columns = list(range(columns))
    row, reached, column = new_row, 0.0, -1
    while True:
        for j in open_columns:
            through = reached + costs[row][j] - row_price[row] - column_price[j]
            if through < distance[j]:
                distance[j], came_from[j] = through, column
        column = min(open_columns, key=distance.__getitem__)
        reached = distance[column]
        open_columns.remove(column)
        if row_of[column] < 0:
            break
        done.append(column)
        row = row_of[column]
    row_price[new_row] += reached
    for j in done:
        row_price[row_of[j]] += reached - distance[j]
        column_price[j] -= reached - distance[j]
    while True:
        before = came_from[column]
        row_of[column] = new_row if before < 0 else row_of[before]
        if before < 0:
            break
        column = before
