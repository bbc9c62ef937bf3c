"""The tags of a picture by their names: XMP by a forgiving scanner, EXIF as Pillow returns it."""

from __future__ import annotations

import re
from collections.abc import Mapping
from fractions import Fraction
from html import unescape
from math import isfinite
from typing import Any, Final

import msgspec

ELEMENT: Final = re.compile(r"<(/?)([\w.-]+):([\w.-]+)((?:[^<>\"']|\"[^\"]*\"|'[^']*')*?)(/?)>([^<]*)")
ATTRIBUTE: Final = re.compile(r"([\w.-]+):([\w.-]+)\s*=\s*(?:\"([^\"]*)\"|'([^']*)')")
STRUCTURE: Final = frozenset({"rdf", "x", "xml"})
"""Prefixes of elements that only hold others."""
DEEPEST: Final = 16
"""Nested elements that are followed; deeper ones occur in broken files only."""


class PictureTags(msgspec.Struct, frozen=True, kw_only=True):
    """The tags of one picture."""

    size: tuple[int, int]
    """Width and height of the stored image, pixels."""
    xmp: Mapping[str, str] = {}
    """Values by ``name``, by ``prefix:name`` and, of a struct, by ``struct/name``."""
    exif: Mapping[int, Any] = {}
    """Main and photographic directory of EXIF by tag number."""
    gps: Mapping[int, Any] = {}

    def number(self, *names: str) -> float | None:
        """The first of these XMP values that is a finite number."""
        return next((number for name in names if (number := finite_number(self.xmp.get(name))) is not None), None)

    def text(self, *names: str) -> str:
        """The first of these XMP values that is not empty, else ""."""
        return next((text for name in names if (text := self.xmp.get(name, "").strip())), "")


def xmp_values(packet: str) -> dict[str, str]:
    """The values of an XMP packet: attributes, and elements with text; the first of equal names counts.

    Read by pattern and not as XML: some makers' packets are not well-formed.
    """
    found: dict[str, str] = {}
    inside: list[tuple[str, str]] = []
    for match in ELEMENT.finditer(packet):
        closes, prefix, name, attributes, empty, text = match.groups()
        if closes:
            while inside and inside[-1] != (prefix, name):
                inside.pop()
            if inside:
                inside.pop()
            continue
        holder = next((n for p, n in reversed(inside) if p not in STRUCTURE), "")
        if prefix not in STRUCTURE and text.strip():
            _put(found, holder, prefix, name, text)
        inner = holder if prefix in STRUCTURE else name
        for attribute in ATTRIBUTE.finditer(attributes):
            if attribute[1] not in ("xmlns", *STRUCTURE):
                _put(found, inner, attribute[1], attribute[2], attribute[3] or attribute[4] or "")
        if not empty and len(inside) < DEEPEST:
            inside.append((prefix, name))
    return found


def _put(found: dict[str, str], holder: str, prefix: str, name: str, value: str) -> None:
    value = unescape(value).strip()
    keys = (f"{holder}/{name}",) if holder else (name, f"{prefix}:{name}")
    for key in keys:
        found.setdefault(key, value)


def finite_number(value: Any) -> float | None:
    """The value as a finite number, also "a/b" and with a plus sign; None where it is not one."""
    try:
        number = float(Fraction(value.strip())) if isinstance(value, str) and "/" in value else float(value)
    except (TypeError, ValueError, ZeroDivisionError, OverflowError):
        return None
    return number if isfinite(number) else None
