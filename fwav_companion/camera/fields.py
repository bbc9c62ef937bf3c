"""The content of a calibration file as typed fields. Each error names file, key, value, and the fix."""

from __future__ import annotations

import re
import reprlib
from collections.abc import Iterator, Mapping
from math import isfinite
from typing import Any

from fwav_companion.errors import InputFileError

BARE_EXPONENT = re.compile(r"[-+]?[0-9]+(\.[0-9]*)?[eE][-+]?[0-9]+")
"""1e-05 is a number everywhere but in YAML 1.1, and C++ programs write numbers this way."""


class Fields:
    """One mapping of a calibration file, read key by key."""

    __slots__ = ("_mapping", "_path", "name")

    def __init__(self, mapping: Mapping[str, Any], name: str, path: str = "") -> None:
        self._mapping = mapping
        self.name = name
        self._path = path

    def __contains__(self, key: str) -> bool:
        return key in self._mapping

    def __iter__(self) -> Iterator[str]:
        return iter(self._mapping)

    def refusal(self, key: str, accepted: str) -> InputFileError:
        """The error of this key: its value, and what is accepted."""
        found = f" = {reprlib.repr(self._mapping[key])}:" if key in self._mapping else ": missing;"
        return InputFileError(f"{self.name}: {self._path}{key}{found} accepted: {accepted}")

    def below(self, key: str) -> Fields:
        """The mapping under this key."""
        found = self._mapping.get(key)
        if not isinstance(found, Mapping):
            raise self.refusal(key, "a mapping of keys")
        return Fields(found, self.name, f"{self._path}{key}.")

    def plain(self, key: str) -> Any:
        """What stands under this key as it is; None where it is missing."""
        return self._mapping.get(key)

    def text(self, key: str) -> str:
        """The text under this key."""
        found = self._mapping.get(key)
        if not isinstance(found, str):
            raise self.refusal(key, "a word")
        return found

    def number(self, key: str) -> float:
        """The finite number under this key."""
        found = _finite(self._mapping.get(key))
        if found is None:
            raise self.refusal(key, "a finite number")
        return found

    def positive(self, key: str) -> float:
        """The finite number above zero under this key."""
        found = self.number(key)
        if found <= 0.0:
            raise self.refusal(key, "a positive number")
        return found

    def numbers(self, key: str, *counts: int) -> tuple[float, ...]:
        """The list of finite numbers under this key, its length one of ``counts``; a matrix is read row by row."""
        found = self._mapping.get(key)
        if isinstance(found, Mapping) and "data" in found:
            found = found["data"]
        numbers = [_finite(entry) for entry in _flat(found)] if isinstance(found, list) else []
        good = tuple(number for number in numbers if number is not None)
        if len(good) != len(numbers) or len(good) not in counts:
            raise self.refusal(key, f"a list of {' or '.join(map(str, counts))} finite numbers")
        return good

    def numbers_with_zeros(self, key: str, *counts: int) -> tuple[float, ...]:
        """As :meth:`numbers`, with any number of zeros after them: tools fill up to their longest model."""
        found = self._mapping.get(key)
        if isinstance(found, Mapping) and "data" in found:
            found = found["data"]
        numbers = [_finite(entry) for entry in _flat(found)] if isinstance(found, list) else []
        most = max((count for count in counts if count <= len(numbers)), default=0)
        if len(numbers) in counts or not most or any(number != 0.0 for number in numbers[most:]):
            return self.numbers(key, *counts)
        return tuple(number for number in numbers[:most] if number is not None) or self.numbers(key, *counts)

    def is_true(self, key: str) -> bool:
        """Whether a flag is set: true or 1."""
        return self._mapping.get(key) in (True, 1)

    def is_false(self, key: str) -> bool:
        """Whether a flag is there and not set: false or 0."""
        return self._mapping.get(key, True) in (False, 0)

    def size(self, key: str) -> tuple[int, int]:
        """The width and height under this key, whole pixels."""
        width, height = self.numbers(key, 2)
        if not (_is_pixels(width) and _is_pixels(height)):
            raise self.refusal(key, "[width, height] in whole pixels")
        return int(width), int(height)

    def whole_pixels(self, key: str) -> int:
        """The side of an image under this key, whole pixels."""
        found = self.number(key)
        if not _is_pixels(found):
            raise self.refusal(key, "a number of whole pixels")
        return int(found)


def _is_pixels(number: float) -> bool:
    return number == int(number) and 0 < number < 100_000


def _finite(found: Any) -> float | None:
    if isinstance(found, str) and BARE_EXPONENT.fullmatch(found):
        found = float(found)
    if isinstance(found, bool) or not isinstance(found, int | float):
        return None
    try:
        number = float(found)
    except OverflowError:
        return None
    return number if isfinite(number) else None


def _flat(found: list[Any]) -> list[Any]:
    if found and all(isinstance(row, list) for row in found):
        return [entry for row in found for entry in row]
    return found
