"""The argparse type of a seed."""

from __future__ import annotations

import argparse

MOST_DIGITS = 18
"""The most digits that fit into 64 bits for every number."""


def seed(text: str) -> int:
    """A whole number of at least 0."""
    if not (text.isascii() and text.isdecimal() and len(text) <= MOST_DIGITS):
        raise argparse.ArgumentTypeError(f"{text}: accepted: a whole number from 0, of at most {MOST_DIGITS} digits")
    return int(text)
