"""Assignment of least total cost over the possible pairs.

Shortest augmenting paths with dual prices (Jonker & Volgenant 1987), on lists of pairs instead of a full cost matrix. A
path stays among the rows and columns that pairs connect, so connected components are solved one by one.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from heapq import heappop, heappush


def least_cost_assignment(costs: Sequence[Mapping[int, float]]) -> tuple[int, ...]:
    """The column of each row, no column twice. ``costs``: each row's finite costs by column.

    ValueError if not all rows can be assigned. Equal costs go to the lower column.
    """
    row_price = [0.0] * len(costs)
    column_price: dict[int, float] = {}
    row_of: dict[int, int] = {}
    for row in range(len(costs)):
        _augment(row, costs, row_price=row_price, column_price=column_price, row_of=row_of)
    column_of = {row: column for column, row in row_of.items()}
    return tuple(column_of[row] for row in range(len(costs)))


def _augment(
    new_row: int,
    costs: Sequence[Mapping[int, float]],
    *,
    row_price: list[float],
    column_price: dict[int, float],
    row_of: dict[int, int],
) -> None:
    """Assign one more row along the cheapest augmenting path, keeping every reduced cost non-negative."""
    distance: dict[int, float] = {}
    came_from: dict[int, int | None] = {}
    done: dict[int, None] = {}
    heap: list[tuple[float, int]] = []
    row, reached, column = new_row, 0.0, None
    while True:
        start = reached - row_price[row]
        for j, cost in costs[row].items():
            through = start + cost - column_price.get(j, 0.0)
            if j not in done and (j not in distance or through < distance[j]):
                distance[j], came_from[j] = through, column
                heappush(heap, (through, j))
        while heap and heap[0][1] in done:
            heappop(heap)
        if not heap:
            raise ValueError(f"row {new_row} cannot be assigned beside those before it")
        reached, column = heappop(heap)
        if column not in row_of:
            break
        done[column] = None
        row = row_of[column]
    row_price[new_row] += reached
    for j in done:
        row_price[row_of[j]] += reached - distance[j]
        column_price[j] = column_price.get(j, 0.0) - (reached - distance[j])
    while (before := came_from[column]) is not None:
        row_of[column] = row_of[before]
        column = before
    row_of[column] = new_row
