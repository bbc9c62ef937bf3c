"""Builds the functions that unpack a payload to a record of fields, and pack fields to a payload.

Each message gets its own small functions on first use: most need only one ``struct`` call.
"""

from __future__ import annotations

from collections.abc import Callable, Iterator, Mapping, Sequence
from operator import itemgetter
from struct import Struct
from struct import error as struct_error
from typing import Any, Final

import msgspec

FORMAT_OF_TYPE: Final = {
    "char": "s",
    "uint8_t": "B",
    "int8_t": "b",
    "uint16_t": "H",
    "int16_t": "h",
    "uint32_t": "I",
    "int32_t": "i",
    "uint64_t": "Q",
    "int64_t": "q",
    "float": "f",
    "double": "d",
}
_MARKER_V2: Final = 0xFD
_HEADER_V2: Final = 10
_HEADER_V1: Final = 6

Values = tuple[Any, ...]
Unpack = Callable[[bytes], Any]
"""Converts a frame, with header, to the record of its fields."""
Pack = Callable[[Mapping[str, Any]], bytes]
"""Converts fields by name to the whole payload. Raises one of :data:`PACK_ERRORS` if they do not fit."""
PACK_ERRORS: Final = (KeyError, TypeError, ValueError, OverflowError, AttributeError, struct_error)


class Field(msgspec.Struct, frozen=True):
    """One field of a message: its place in the payload and its type."""

    name: str
    type: str
    """C type as in the XML: ``uint8_t``, ``float``, ``char``."""
    array_length: int
    """Number of elements, or 0 for a single value. Characters are always an array."""
    offset: int
    """Offset of its first byte in the payload."""
    extension: bool
    """Whether it was added after the message was published: absent in MAVLink 1 and outside the checksum seed."""

    @property
    def is_text(self) -> bool:
        """Whether it holds characters, which are a str in the rest of the program."""
        return self.type == "char"

    @property
    def width(self) -> int:
        """Number of values that ``struct`` reads or writes for it."""
        return 1 if self.is_text else max(1, self.array_length)

    @property
    def zero(self) -> Any:
        """Value of a field that was not set."""
        return "" if self.is_text else (0,) * self.array_length if self.array_length else 0


class FieldRecord(msgspec.Struct, frozen=True, gc=False):
    """Base of decoded fields: attributes in the order of the definition; it iterates and indexes like a tuple.

    It is a struct because a struct is built three times as fast as a named tuple, and every wanted message needs one.
    """

    @property
    def _fields(self) -> tuple[str, ...]:
        return self.__struct_fields__

    def _asdict(self) -> dict[str, Any]:
        return msgspec.structs.asdict(self)

    def _replace(self, **changes: Any) -> FieldRecord:
        return msgspec.structs.replace(self, **changes)

    def __iter__(self) -> Iterator[Any]:
        return iter(msgspec.structs.astuple(self))

    def __getitem__(self, index: int) -> Any:
        return msgspec.structs.astuple(self)[index]

    def __len__(self) -> int:
        return len(self.__struct_fields__)


def build_unpack(layout: Struct, fields: Sequence[Field], order: Sequence[str], record: Callable[..., Any]) -> Unpack:
    """Return the unpack function. ``fields``: in wire order; ``order``: that of the record. A payload that is cut short
    is filled up with zeros.
    """
    size, unpack = layout.size, layout.unpack_from

    def values(data: bytes) -> Values:
        start = _HEADER_V2 if data[0] == _MARKER_V2 else _HEADER_V1
        return unpack(data[start : start + data[1]].ljust(size, b"\0"))

    # A payload longer than our definition has newer extensions.
    def unpack_in_order(data: bytes) -> Any:
        return record(*(unpack(data, _HEADER_V2) if data[1] >= size and data[0] == _MARKER_V2 else values(data)))

    if all(field.array_length == 0 for field in fields) and [field.name for field in fields] == list(order):
        return unpack_in_order
    arrange = _arranger(fields, order)

    def unpack_arranged(data: bytes) -> Any:
        return record(*arrange(unpack(data, _HEADER_V2) if data[1] >= size and data[0] == _MARKER_V2 else values(data)))

    return unpack_arranged


def _arranger(fields: Sequence[Field], order: Sequence[str]) -> Callable[[Values], Any]:
    """Return a function from values in wire order to one value per field in the order of the record."""
    slots: dict[str, tuple[int, Field]] = {}
    index = 0
    for field in fields:
        slots[field.name] = (index, field)
        index += field.width
    ordered = [slots[name] for name in order]
    if len(ordered) > 1 and not any(field.is_text for _, field in ordered):
        return itemgetter(*(_key(index, field) for index, field in ordered))
    pickers = [_picker(index, field) for index, field in ordered]
    return lambda values: [pick(values) for pick in pickers]


def _picker(index: int, field: Field) -> Callable[[Values], Any]:
    if field.is_text:
        return lambda values: values[index].split(b"\0", 1)[0].decode("utf-8", "replace")
    return itemgetter(_key(index, field))


def _key(index: int, field: Field) -> int | slice:
    return slice(index, index + field.array_length) if field.array_length else index


def build_pack(layout: Struct, fields: Sequence[Field], defaults: Mapping[str, Any]) -> Pack:
    """Return the pack function. ``fields``: in wire order; ``defaults``: values by name of fields that may be left
    out.
    """
    pack, count = layout.pack, len(fields)
    names = [field.name for field in fields]
    # Arrays are expanded from the last to the first, so that the positions of the remaining ones stay valid.
    arrays = [(i, f.array_length, f.is_text) for i, f in enumerate(fields) if f.array_length][::-1]
    pick = itemgetter(*names) if count > 1 else lambda given: (given[names[0]],)

    def complete(given: Mapping[str, Any]) -> Mapping[str, Any]:
        merged = {**defaults, **given}
        if len(merged) != count:
            raise KeyError
        return merged

    def pack_flat(given: Mapping[str, Any]) -> bytes:
        return pack(*pick(given if len(given) == count else complete(given)))

    def pack_arrays(given: Mapping[str, Any]) -> bytes:
        values = list(pick(given if len(given) == count else complete(given)))
        for index, length, is_text in arrays:
            value = values[index]
            if is_text:
                values[index] = value = value.encode()
                if len(value) > length:
                    raise ValueError
            elif len(value) == length:
                values[index : index + 1] = value
            else:
                raise ValueError
        return pack(*values)

    return pack_arrays if arrays else pack_flat


def complaint(fields: Mapping[str, Field], defaults: Mapping[str, Any], given: Mapping[str, Any]) -> str:
    """Return why ``given`` cannot be packed, with the given and the accepted value. The text follows the message's
    name.
    """
    if unknown := [name for name in given if name not in fields]:
        return f" has no field {unknown[0]!r}: its fields are {', '.join(fields)}"
    merged = {**defaults, **given}
    if missing := [name for name in fields if name not in merged]:
        return f" wants {', '.join(missing)}; only {', '.join(given) or 'nothing'} was given"
    for field in fields.values():
        if trouble := _complaint_of(field, merged[field.name]):
            return f".{field.name} = {merged[field.name]!r}: {trouble}"
    return f" cannot be packed from {dict(given)!r}"


def _complaint_of(field: Field, value: Any) -> str:
    """Return why the value does not fit the field; "" if it does."""
    if field.is_text:
        if not isinstance(value, str):
            return "text is accepted (str)"
        size = len(value.encode(errors="replace"))
        return f"{size} bytes, at most {field.array_length} are accepted" if size > field.array_length else ""
    values = value if field.array_length else (value,)
    if isinstance(values, str) or not hasattr(values, "__len__") or len(values) != field.width:
        return f"exactly {field.width} values of {field.type} are accepted"
    single = Struct("<" + FORMAT_OF_TYPE[field.type])
    for one in values:
        try:
            single.pack(one)
        except (TypeError, OverflowError, struct_error) as error:
            return f"{one!r} is no {field.type} ({error})"
    return ""
