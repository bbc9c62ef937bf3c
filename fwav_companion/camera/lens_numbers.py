"""The range of numbers that a lens can have: beyond it polynomials overflow, and rays are no longer unit vectors."""

from __future__ import annotations

from collections.abc import Iterable
from typing import Final

LARGEST: Final = 1e9
"""Largest coefficient or length. The highest terms of a telephoto lens, 1e5 or so, are the largest that are seen: they
multiply the eighth power of a tangent of hundredths."""


def require_lens_numbers(positive: Iterable[float], other: Iterable[float]) -> None:
    """Refuse numbers that are not finite or beyond LARGEST, and of ``positive`` those not above 1 / LARGEST."""
    if not all(-LARGEST <= number <= LARGEST for number in (*positive, *other)):
        raise ValueError(f"every number of a lens must be finite, and at most {LARGEST:.0e} in size")
    if not all(number >= 1.0 / LARGEST for number in positive):
        raise ValueError(
            f"focal lengths, pixels per mm, first coefficient and image size must be above {1 / LARGEST:.0e}"
        )
