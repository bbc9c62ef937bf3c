"""Which targets may move: each by its label, as a pad on a boat next to a mast ashore."""

from __future__ import annotations

from collections.abc import Mapping

import msgspec


class Motions(msgspec.Struct, frozen=True):
    """Which targets may move, by their label."""

    default: bool = False
    by_label: Mapping[str, bool] = {}

    def moves(self, label: str) -> bool:
        """Whether targets of this label may move."""
        return self.by_label.get(label, self.default)

    @property
    def any_moves(self) -> bool:
        """Whether targets of any label may move."""
        return self.default or any(self.by_label.values())
