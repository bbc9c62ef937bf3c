"""Minimal writers of autopilots' own log formats, for tests of the readers."""

from __future__ import annotations

import struct
from collections.abc import Iterable, Mapping, Sequence
from typing import Any

HEAD = b"\xa3\x95"
TYPES = {
    "B": "B",
    "I": "I",
    "Q": "Q",
    "f": "f",
    "L": "i",
    "c": "h",
    "C": "H",
    "N": "16s",
    "n": "4s",
    "Z": "64s",
    "H": "H",
    "e": "i",
}
SCALES = {"c": 100, "C": 100, "e": 100, "L": 1e7}


class DataFlash:
    """ArduPilot's .bin: a format is written before its first record."""

    def __init__(self) -> None:
        self.data = bytearray()
        self._formats: dict[str, tuple[int, str]] = {}
        self.describe("FMT", 128, "BBnNZ", "Type,Length,Name,Format,Columns")

    def describe(self, name: str, kind: int, form: str, columns: str) -> None:
        length = 3 + struct.calcsize("<" + "".join(TYPES[c] for c in form))
        self._formats[name] = (kind, form)
        body = struct.pack("<BB4s16s64s", kind, length, name.encode(), form.encode(), columns.encode())
        self.data += HEAD + bytes((128,)) + body

    def put(self, name: str, *values: Any) -> None:
        kind, form = self._formats[name]
        raw = [round(v * SCALES[c]) if c in SCALES else v for c, v in zip(form, values, strict=True)]
        self.data += HEAD + bytes((kind,)) + struct.pack("<" + "".join(TYPES[c] for c in form), *raw)


def usual(log: DataFlash) -> DataFlash:
    """The messages of ArduPilot 4.5 that matter here, described as it describes them."""
    log.describe("ATT", 70, "QccccCCCC", "TimeUS,DesRoll,Roll,DesPitch,Pitch,DesYaw,Yaw,ErrRP,ErrYaw")
    log.describe("AHR2", 71, "QccCfLLffff", "TimeUS,Roll,Pitch,Yaw,Alt,Lat,Lng,Q1,Q2,Q3,Q4")
    log.describe("POS", 72, "QLLfff", "TimeUS,Lat,Lng,Alt,RelHomeAlt,RelOriginAlt")
    log.describe("XKF1", 73, "QBccCffffffff", "TimeUS,C,Roll,Pitch,Yaw,VN,VE,VD,dPD,PN,PE,PD,GX")
    log.describe("GPS", 74, "QBBIHBcLLf", "TimeUS,I,Status,GMS,GWk,NSats,HDop,Lat,Lng,Alt")
    log.describe("RFND", 75, "QBCBB", "TimeUS,Instance,Dist,Stat,Orient")
    log.describe("IMU", 76, "QBffffff", "TimeUS,I,GyrX,GyrY,GyrZ,AccX,AccY,AccZ")
    log.describe("ORGN", 77, "QBLLf", "TimeUS,Type,Lat,Lng,Alt")
    log.describe("MSG", 78, "QZ", "TimeUS,Message")
    return log


SYNC = bytes.fromhex("2f731320250cbb12")
SYNC_PERIOD_US = 500_000
"""PX4 writes a SYNC message every half second since v1.10; a reader resynchronises with it after damage."""


def ulog(topics: Mapping[str, tuple[Sequence[tuple[str, str]], Iterable[Sequence[Any]]]]) -> bytes:
    """PX4's .ulg (ULog file format, docs.px4.io), by topic: (type, field) pairs without the timestamp, and rows with
    it.
    """
    codes = {"float": "f", "double": "d", "uint64_t": "Q", "uint8_t": "B", "bool": "?"}
    data = bytearray(b"ULog\x01\x12\x35\x01" + struct.pack("<Q", 0))

    def message(kind: str, body: bytes) -> None:
        data.extend(struct.pack("<HB", len(body), ord(kind)) + body)

    message("B", bytes(40))
    for name, (fields, _) in topics.items():
        text = ";".join(f"{kind} {field}" for kind, field in (("uint64_t", "timestamp"), *fields))
        message("F", f"{name}:{text};".encode())
    for number, name in enumerate(topics):
        message("A", struct.pack("<BH", 0, number) + name.encode())
    rows = [
        (row, number, "<HQ" + "".join(codes[kind.split("[")[0]] * _count(kind) for kind, _ in fields))
        for number, (fields, each) in enumerate(topics.values())
        for row in each
    ]
    synced_us = 0
    for row, number, form in sorted(rows, key=lambda item: item[0][0]):
        if row[0] - synced_us > SYNC_PERIOD_US:
            message("S", SYNC)
            synced_us = row[0]
        message("D", struct.pack(form, number, *row))
    return bytes(data)


def _count(kind: str) -> int:
    return int(kind.partition("[")[2].rstrip("]") or 1)
