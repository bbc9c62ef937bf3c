"""Holds the layout of MAVLink's messages, read once from pymavlink: the only module that imports it.

pymavlink has names, types and checksums, but does not mark extension fields. They follow from the signature of a
message's constructor, where only extensions have a default. The checksum seed (crc_extra), which covers exactly the
other fields, proves this for every message (tests/mavlink/test_against_pymavlink.py).
"""

from __future__ import annotations

from collections.abc import Callable
from functools import cached_property
from struct import Struct, calcsize
from typing import Any, Final

import msgspec
from pymavlink.dialects.v20 import ardupilotmega as _dialect

from fwav_companion.errors import EncodeError
from fwav_companion.mavlink.wire.payloads import (
    FORMAT_OF_TYPE,
    Field,
    FieldRecord,
    Pack,
    Unpack,
    build_pack,
    build_unpack,
    complaint,
)

INSTANCE_FIELDS: Final = {"ADSB_VEHICLE": "ICAO_address", "AIS_VESSEL": "MMSI"}
"""Fields that separate the streams of one message and that the dialect does not mark as such: one aircraft, one
ship."""


class Definition:
    """Layout of one message's payload, and the seed of its checksum.

    Parts that only some messages need are computed on first use, so that start-up stays quick.
    """

    def __init__(self, source: Any) -> None:
        """``source``: pymavlink's class of the message. It is not kept: see :func:`forget_dialect`."""
        self.msgid: int = source.id
        self.name: str = source.msgname
        self.crc_byte = bytes((source.crc_extra,))
        """Checksum seed (crc_extra), appended to the bytes that the checksum covers."""
        self.id_bytes = self.msgid.to_bytes(3, "little")
        """Message id as in a MAVLink 2 header."""
        self.struct: Struct = source.unpacker
        """Whole payload in wire order, with extensions."""
        self.field_names: tuple[str, ...] = tuple(source.fieldnames)
        """Field names in the order of the definition, which is the order of decoded fields."""
        self.wire_names: tuple[str, ...] = tuple(source.ordered_fieldnames)
        """Field names in the order of the payload."""
        self._types: list[str] = source.fieldtypes
        self._array_lengths: list[int] = source.array_lengths
        self._instance_field: str | None = source.instance_field
        self._extension_count = len(source.__init__.__defaults__ or ())

    @property
    def length(self) -> int:
        """Length of the whole payload with extensions, bytes."""
        return self.struct.size

    @cached_property
    def base_length(self) -> int:
        """Length of the payload without extensions, bytes: that of every MAVLink 1 frame."""
        return sum(
            calcsize(f"<{max(1, field.array_length)}{FORMAT_OF_TYPE[field.type]}")
            for field in self.fields.values()
            if not field.extension
        )

    @cached_property
    def fields(self) -> dict[str, Field]:
        """Fields by name, in wire order."""
        types = dict(zip(self.field_names, self._types, strict=True))
        array_lengths = dict(zip(self.wire_names, self._array_lengths, strict=True))
        extensions = self.field_names[len(self.field_names) - self._extension_count :]
        fields = {}
        offset = 0
        for name in self.wire_names:
            fields[name] = Field(
                name=name,
                type=types[name],
                array_length=array_lengths[name],
                offset=offset,
                extension=name in extensions,
            )
            offset += calcsize(f"<{max(1, array_lengths[name])}{FORMAT_OF_TYPE[types[name]]}")
        return fields

    @cached_property
    def target_system_offset(self) -> int:
        """Offset of the target system in the payload; -1 without that field."""
        return self._offset("target_system")

    @cached_property
    def target_component_offset(self) -> int:
        """Offset of the target component in the payload; -1 without that field."""
        return self._offset("target_component")

    def instance(self, payload: bytes) -> int:
        """Return the instance of this message that a payload belongs to, for example the second battery; 0 without
        instances.

        A payload may lack its trailing zeros.
        """
        start, length = self._instance_span
        return int.from_bytes(payload[start : start + length], "little") if length else 0

    @cached_property
    def _instance_span(self) -> tuple[int, int]:
        """Offset and length of the field that separates the instances of this message; length 0 without one."""
        name = self._instance_field or INSTANCE_FIELDS.get(self.name)
        if not name:
            return 0, 0
        field = self.fields[name]
        return field.offset, calcsize(f"<{max(1, field.array_length)}{FORMAT_OF_TYPE[field.type]}")

    def _offset(self, name: str) -> int:
        return self.fields[name].offset if name in self.field_names else -1

    @cached_property
    def record(self) -> Callable[..., Any]:
        """Class of the decoded fields: a :class:`FieldRecord`."""
        return msgspec.defstruct(
            self.name, self.field_names, bases=(FieldRecord,), frozen=True, gc=False, module=__name__
        )

    @cached_property
    def unpack(self) -> Unpack:
        """Function from a frame, with header, to its :attr:`record`. Text ends at its first NUL, missing bytes are
        0.
        """
        return build_unpack(self.struct, tuple(self.fields.values()), self.field_names, self.record)

    @cached_property
    def pack(self) -> Pack:
        """Function from fields by name to the whole payload. It raises one of ``PACK_ERRORS`` if they do not fit."""
        return build_pack(self.struct, tuple(self.fields.values()), self._defaults)

    @cached_property
    def _defaults(self) -> dict[str, Any]:
        zeros = {name: field.zero for name, field in self.fields.items() if field.extension}
        # The protocol fills in this field, not the sender (common.xml); 3 is MAVLink 1 and 2.
        return {**zeros, "mavlink_version": 3} if self.name == "HEARTBEAT" else zeros

    def refusal(self, given: dict[str, Any]) -> EncodeError:
        """Return the error for fields that could not be packed, with the given and the accepted values."""
        return EncodeError(self.name + complaint(self.fields, self._defaults, given))

    def __repr__(self) -> str:
        return f"Definition({self.name}, {self.msgid})"


DEFINITIONS: Final[dict[int, Definition]] = {source.id: Definition(source) for source in _dialect.mavlink_map.values()}
"""Messages of the ardupilotmega dialect, which includes common, by message id."""

BY_NAME: Final[dict[str, Definition]] = {definition.name: definition for definition in DEFINITIONS.values()}


def forget_dialect() -> None:
    """Free pymavlink's classes, constants and texts, 9 MiB, at the next garbage collection.

    Everything that a :class:`Definition` needs has been read. The module cannot be used afterwards in this process.
    """
    vars(_dialect).clear()


def definition_of(name: str) -> Definition:
    """Return the definition of the message of this name; EncodeError if the dialect has none."""
    try:
        return BY_NAME[name]
    except KeyError:
        raise EncodeError(f"there is no MAVLink message {name!r} in the ardupilotmega dialect") from None
