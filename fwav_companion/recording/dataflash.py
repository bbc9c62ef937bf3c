"""ArduPilot's own log (DataFlash, ``.bin``): it describes itself by FMT records. Pure.

Read: ATT or, where that comes seldom, AHR2 or XKF1 (attitude), POS (position), XKF1 (velocity), IMU (rates), RFND, GPS
and ORGN. The format has no checksums: after damage the next record is believed where another follows it.
"""

from __future__ import annotations

from bisect import bisect_right
from collections.abc import Iterator, Mapping
from math import isfinite, radians
from struct import Struct
from typing import Any, Final

import msgspec

from fwav_companion.geometry.rotations import quaternion_from_euler
from fwav_companion.recording.flight_log import (
    FlightLog,
    LoggedAttitude,
    LoggedGps,
    LoggedPosition,
    LoggedRange,
)
from fwav_companion.recording.tlog import SkippedBytes

HEAD: Final = b"\xa3\x95"
_FMT: Final = 128
_FMT_BODY: Final = Struct("<BB4s16s64s")
_TYPES: Final = {
    "a": "64s", "b": "b", "B": "B", "h": "h", "H": "H", "i": "i", "I": "I", "f": "f", "d": "d", "g": "e", "n": "4s",
    "N": "16s", "Z": "64s", "c": "h", "C": "H", "e": "i", "E": "I", "L": "i", "M": "B", "q": "q", "Q": "Q",
}  # fmt: skip
"""By format character (ArduPilot AP_Logger/LogStructure.h)."""
_SCALES: Final = {"c": 0.01, "C": 0.01, "e": 0.01, "E": 0.01, "L": 1e-7}
_ANGLES: Final = frozenset({"TimeUS", "Roll", "Pitch", "Yaw"})
_PLACE: Final = frozenset({"TimeUS", "Lat", "Lng", "Alt"})
NEEDED: Final = {
    "ATT": _ANGLES,
    "AHR2": _ANGLES,
    "XKF1": _ANGLES | {"VN", "VE", "VD"},
    "POS": _PLACE | {"RelHomeAlt"},
    "ORGN": _PLACE | {"Type"},
    "IMU": frozenset({"TimeUS", "GyrX", "GyrY", "GyrZ"}),
    "RFND": frozenset({"TimeUS", "Dist", "Stat"}),
    "GPS": frozenset({"TimeUS", "Status", "GMS", "GWk"}),
}
"""The columns that are used. A log whose own description lacks one has not that message, as far as we can tell."""
ATTITUDE_SOURCES: Final = ("ATT", "AHR2", "XKF1")
"""In order of preference: ATT is what the vehicle flies by. Another must come twice as often to be taken instead."""
GPS_EPOCH_UNIX_S: Final = 315_964_800
"""1980-01-06."""
_NEVER: Final = frozenset({""})
"""No column is called so."""
LEAP_SECONDS: Final = 18
"""GPS minus UTC since 2017; the earth has asked for none since."""
_WEEK_S: Final = 604_800
LONGEST_LOG_US: Final = 7 * 24 * 3600 * 1_000_000
"""A time further from the middle of a log is damage: there is no checksum that would tell."""


class _Format(msgspec.Struct, frozen=True):
    """One kind of record."""

    name: str
    length: int
    """With its three bytes of head."""
    struct: Struct
    columns: tuple[str, ...]
    scales: tuple[float | None, ...]

    def values(self, data: bytes, at: int) -> dict[str, Any]:
        raw = self.struct.unpack_from(data, at + 3)
        return {
            column: value if scale is None else value * scale
            for column, value, scale in zip(self.columns, raw, self.scales, strict=False)
        }


_FMT_FORMAT: Final = _Format("FMT", 3 + _FMT_BODY.size, _FMT_BODY, (), ())


def is_dataflash(data: bytes) -> bool:
    """Whether this looks like an ArduPilot log: it begins with a description."""
    return data[:3] == HEAD + bytes((_FMT,))


def read_dataflash(data: bytes) -> tuple[FlightLog, list[SkippedBytes]]:
    """What the log tells, and the damaged stretches."""
    records: dict[str, list[dict[str, Any]]] = {name: [] for name in NEEDED}
    skipped: list[SkippedBytes] = []
    for item in _records(data):
        if isinstance(item, SkippedBytes):
            skipped.append(item)
        else:
            name, values = item
            if all(isinstance(values[column], int | float) and isfinite(values[column]) for column in NEEDED[name]):
                records[name].append(values)
    return _flight(_timely(records)), skipped


def _records(data: bytes) -> Iterator[tuple[str, dict[str, Any]] | SkippedBytes]:
    """The records that are wanted, in file order."""
    formats: dict[int, _Format] = {_FMT: _FMT_FORMAT}
    at, skipped_from = 0, 0
    while at < len(data):
        found = _format_at(data, at, formats)
        if found is None or (skipped_from < at and not _follows(data, at + found.length, formats)):
            at = data.find(HEAD, at + 1)
            if at < 0:
                break
            continue
        if skipped_from < at:
            yield SkippedBytes(skipped_from, at - skipped_from)
        if found is _FMT_FORMAT:
            _learn(data, at, formats)
        elif NEEDED.get(found.name, _NEVER).issubset(found.columns):
            yield found.name, found.values(data, at)
        at = skipped_from = at + found.length
    if skipped_from < len(data):
        yield SkippedBytes(skipped_from, len(data) - skipped_from)


def _format_at(data: bytes, at: int, formats: Mapping[int, _Format]) -> _Format | None:
    """The kind of the whole record that begins here."""
    if data[at : at + 2] != HEAD or at + 3 > len(data):
        return None
    found = formats.get(data[at + 2])
    return found if found is not None and at + found.length <= len(data) else None


def _follows(data: bytes, at: int, formats: Mapping[int, _Format]) -> bool:
    return at == len(data) or (data[at : at + 2] == HEAD and at + 2 < len(data) and data[at + 2] in formats)


def _learn(data: bytes, at: int, formats: dict[int, _Format]) -> None:
    kind, length, name, characters, columns = _FMT_BODY.unpack_from(data, at + 3)
    text = characters.split(b"\0")[0].decode("ascii", "replace")
    try:
        struct = Struct("<" + "".join(_TYPES[character] for character in text))
    except KeyError:
        return
    if kind == _FMT or length != struct.size + 3:
        return
    names = tuple(columns.split(b"\0")[0].decode("ascii", "replace").split(","))
    label = name.split(b"\0")[0].decode("ascii", "replace")
    formats[kind] = _Format(label, length, struct, names, tuple(_SCALES.get(character) for character in text))


def _timely(records: dict[str, list[dict[str, Any]]]) -> dict[str, list[dict[str, Any]]]:
    """In the order of their times, without those that cannot be of this flight."""
    for series in records.values():
        for values in series:
            values["TimeUS"] = int(values["TimeUS"])
    times = sorted(values["TimeUS"] for series in records.values() for values in series)
    if not times:
        return records
    middle = times[len(times) // 2]
    return {
        name: sorted(
            (values for values in series if abs(values["TimeUS"] - middle) <= LONGEST_LOG_US),
            key=lambda values: values["TimeUS"],
        )
        for name, series in records.items()
    }


def _flight(records: Mapping[str, list[dict[str, Any]]]) -> FlightLog:
    primary = {name: [each for each in records[name] if not each.get("C") and not each.get("I")] for name in records}
    source = _attitude_source(primary)
    rates = _Nearest(primary["IMU"], ("GyrX", "GyrY", "GyrZ"))
    velocities = _Nearest(primary["XKF1"], ("VN", "VE", "VD"))
    origin = next((each for each in records["ORGN"] if each["Type"] == 0), None)
    return FlightLog(
        autopilot="ardupilot",
        attitude_source=source,
        attitudes=[
            LoggedAttitude(each["TimeUS"], _quaternion(each), rates.at(each["TimeUS"])) for each in primary[source]
        ],
        positions=[
            LoggedPosition(
                each["TimeUS"],
                each["Lat"],
                each["Lng"],
                each["Alt"],
                each["RelHomeAlt"],
                velocities.at(each["TimeUS"]),
            )
            for each in records["POS"]
        ],
        ranges=[
            LoggedRange(each["TimeUS"], each["Dist"], each.get("Orient", 25))
            for each in records["RFND"]
            if each["Stat"] == _RANGE_GOOD and not each.get("Instance")
        ],
        gps=[LoggedGps(each["TimeUS"], each["Status"], _unix_us(each)) for each in primary["GPS"]],
        origin=None if origin is None else (origin["Lat"], origin["Lng"], origin["Alt"]),
    )


_RANGE_GOOD: Final = 4
"""RangeFinder::Status::Good."""


def _attitude_source(records: Mapping[str, list[dict[str, Any]]]) -> str:
    best = ATTITUDE_SOURCES[0]
    for name in ATTITUDE_SOURCES[1:]:
        if len(records[name]) >= 2 * len(records[best]) and records[name]:
            best = name
    return best


def _quaternion(values: Mapping[str, Any]) -> tuple[float, float, float, float]:
    return quaternion_from_euler(radians(values["Roll"]), radians(values["Pitch"]), radians(values["Yaw"]))


def _unix_us(values: Mapping[str, Any]) -> int | None:
    if values["Status"] < 3 or not values.get("GWk"):
        return None
    seconds = GPS_EPOCH_UNIX_S - LEAP_SECONDS + values["GWk"] * _WEEK_S
    return int(seconds * 1_000_000 + values["GMS"] * 1000)


class _Nearest:
    """The last vector that was logged by a time; zeros before the first."""

    def __init__(self, series: list[dict[str, Any]], columns: tuple[str, str, str]) -> None:
        self._times = [each["TimeUS"] for each in series]
        self._vectors = [tuple(float(each[column]) for column in columns) for each in series]

    def at(self, boot_us: int) -> tuple[float, float, float]:
        index = bisect_right(self._times, boot_us) - 1
        if index < 0:
            return (0.0, 0.0, 0.0)
        x, y, z = self._vectors[index]
        return (x, y, z)
