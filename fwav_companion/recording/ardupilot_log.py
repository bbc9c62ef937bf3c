"""Reads ArduPilot's own log (``.bin``) into a :class:`FlightLog`. PURE.

Messages: ATT or, if that is rare, AHR2, XKF1, NKF1, XKQ or NKQ (attitude), POS (position), XKF1 or NKF1 (velocity),
IMU (rates), RFND, GPS and ORGN, in the form that ArduPilot has written since its times became microseconds (``TimeUS``,
2015). Where there are several instances (filters, receivers), the first is read.
"""

from __future__ import annotations

from bisect import bisect_right
from collections.abc import Mapping, Sequence
from math import hypot, isfinite, radians
from typing import Final

from fwav_companion.geometry.rotations import (
    Quaternion,
    difference,
    exp,
    multiply,
    normalized,
    quaternion_from_euler,
)
from fwav_companion.geometry.vectors import Vector3, scale
from fwav_companion.recording.dataflash import Values, Wanted, read_records
from fwav_companion.recording.flight_log import (
    LONGEST_PAIR_US,
    FlightLog,
    LoggedAttitude,
    LoggedGps,
    LoggedPosition,
    LoggedRange,
)
from fwav_companion.recording.time_checks import timely
from fwav_companion.recording.tlog import SkippedBytes

_INSTANCE: Final = frozenset({"I", "C", "Instance"})
"""Names of the column with the instance of a receiver, a filter core or a rangefinder."""
_ANGLES: Final = frozenset({"TimeUS", "Roll", "Pitch", "Yaw"})
_PLACE: Final = frozenset({"TimeUS", "Lat", "Lng", "Alt"})
_VELOCITY: Final = ("VN", "VE", "VD")
_QUATERNION: Final = ("Q1", "Q2", "Q3", "Q4")
_RATES: Final = ("GyrX", "GyrY", "GyrZ")
WANTED: Final = {
    "ATT": Wanted(_ANGLES),
    "AHR2": Wanted(_ANGLES),
    "XKF1": Wanted(_ANGLES.union(_VELOCITY), _INSTANCE),
    "NKF1": Wanted(_ANGLES.union(_VELOCITY), _INSTANCE),
    "XKQ": Wanted(frozenset({"TimeUS", *_QUATERNION}), _INSTANCE),
    "NKQ": Wanted(frozenset({"TimeUS", *_QUATERNION}), _INSTANCE),
    "POS": Wanted(_PLACE | {"RelHomeAlt"}),
    "ORGN": Wanted(_PLACE | {"Type"}),
    "IMU": Wanted(frozenset({"TimeUS", *_RATES}), _INSTANCE),
    "RFND": Wanted(frozenset({"TimeUS", "Dist", "Stat"}), _INSTANCE | {"Orient"}),
    "GPS": Wanted(frozenset({"TimeUS", "Status", "GMS", "GWk"}), _INSTANCE),
}
ATTITUDE_SOURCES: Final = ("ATT", "AHR2", "XKF1", "NKF1", "XKQ", "NKQ")
"""Messages with attitudes, in order of preference: the vehicle flies by ATT. Another source must be twice as frequent
to replace it."""
QUATERNIONS: Final = ("XKQ", "NKQ")
"""Messages with the filters' quaternions: logged at a high rate where ATT is slow."""
FILTERS: Final = ("XKF1", "NKF1")
"""Messages of the third and the second generation of ArduPilot's EKF, in order of preference."""
GPS_EPOCH_UNIX_S: Final = 315_964_800
"""Epoch of GPS time, 1980-01-06, Unix seconds."""
LEAP_SECONDS: Final = 18
"""GPS minus UTC since 2017, seconds; no leap second has been added since."""
RANGE_GOOD: Final = 4
"""RangeFinder::Status::Good."""
LOOKING_DOWN: Final = 25
"""MAV_SENSOR_ROTATION_PITCH_270."""
FIX_3D: Final = 3
_WEEK_S: Final = 604_800

_Series = Mapping[str, list[Values]]


def read_ardupilot_log(data: bytes) -> tuple[FlightLog, list[SkippedBytes]]:
    """The log's content, and the damaged stretches."""
    series: dict[str, list[Values]] = {name: [] for name in WANTED}
    skipped: list[SkippedBytes] = []
    for item in read_records(data, WANTED):
        if isinstance(item, SkippedBytes):
            skipped.append(item)
            continue
        name, values = item
        if _is_first(values) and all(map(isfinite, values.values())) and _is_rotation(values):
            series[name].append(values)
    return _flight({name: _timely(each) for name, each in series.items()}), skipped


def _is_first(values: Values) -> bool:
    return not any(values.get(name) for name in _INSTANCE)


def _is_rotation(values: Values) -> bool:
    """Whether the quaternion has about unit length, where there is one."""
    return "Q1" not in values or 0.95 <= hypot(*(values[name] for name in _QUATERNION)) <= 1.05


def _timely(series: list[Values]) -> list[Values]:
    return [series[index] for index in timely([_us(values) for values in series])]


def _flight(series: _Series) -> FlightLog:
    source = _attitude_source(series)
    rates = _Latest(series["IMU"], _RATES)
    velocities = _Latest(next((series[name] for name in FILTERS if series[name]), []), _VELOCITY)
    origin, home = (next((each for each in series["ORGN"] if each["Type"] == kind), None) for kind in (0, 1))
    return FlightLog(
        autopilot="ardupilot",
        attitude_source=source,
        attitudes=[
            LoggedAttitude(at_us, ned_from_body, rates.at(at_us) or (0.0, 0.0, 0.0))
            for at_us, ned_from_body in _attitudes(source, series)
        ],
        positions=[
            LoggedPosition(
                boot_us=_us(each),
                lat=each["Lat"],
                lon=each["Lng"],
                alt_amsl_m=each["Alt"],
                height_above_home_m=each["RelHomeAlt"],
                velocity_ned=velocities.at(_us(each)),
            )
            for each in series["POS"]
        ],
        ranges=[
            LoggedRange(_us(each), each["Dist"], int(each.get("Orient", LOOKING_DOWN)))
            for each in series["RFND"]
            if each["Stat"] == RANGE_GOOD
        ],
        gps=[LoggedGps(_us(each), int(each["Status"]), _unix_us(each)) for each in series["GPS"]],
        origin=None if origin is None else (origin["Lat"], origin["Lng"], origin["Alt"]),
        home=None if home is None else (home["Lat"], home["Lng"], home["Alt"]),
    )


def _attitude_source(series: _Series) -> str:
    best = ATTITUDE_SOURCES[0]
    for name in ATTITUDE_SOURCES[1:]:
        if len(series[name]) >= 2 * len(series[best]) and series[name]:
            best = name
    return best


def _us(values: Values) -> int:
    return int(values["TimeUS"])


def _attitudes(source: str, series: _Series) -> list[tuple[int, Quaternion]]:
    """Attitudes of a source. A filter's quaternion lacks the trim (AHRS_TRIM) that ATT contains; it is corrected."""
    attitudes = [(_us(each), _quaternion(each)) for each in series[source]]
    reference = [(_us(each), _quaternion(each)) for each in series["ATT"]]
    if source not in QUATERNIONS or not reference:
        return attitudes
    trim = mean_rotation(attitudes, reference)
    return [(at_us, multiply(q, trim)) for at_us, q in attitudes]


def mean_rotation(
    attitudes: Sequence[tuple[int, Quaternion]], reference: Sequence[tuple[int, Quaternion]]
) -> Quaternion:
    """Mean rotation, about the body's axes, from attitudes to the reference's at the same instants."""
    times = [at_us for at_us, _ in attitudes]
    turns: list[Vector3] = []
    for at_us, q in reference:
        index = bisect_right(times, at_us)
        if 0 < index < len(times) and times[index] - times[index - 1] <= LONGEST_PAIR_US:
            (before_us, before), (after_us, after) = attitudes[index - 1], attitudes[index]
            share = (at_us - before_us) / max(1, after_us - before_us)
            between = multiply(before, exp(scale(difference(after, before), share)))
            turns.append(difference(q, between))
    if not turns:
        return (1.0, 0.0, 0.0, 0.0)
    x, y, z = (sum(turn[axis] for turn in turns) / len(turns) for axis in range(3))
    return exp((x, y, z))


def _quaternion(values: Values) -> Quaternion:
    if "Q1" in values:
        w, x, y, z = (values[name] for name in _QUATERNION)
        return normalized((w, x, y, z))
    return quaternion_from_euler(radians(values["Roll"]), radians(values["Pitch"]), radians(values["Yaw"]))


def _unix_us(values: Values) -> int | None:
    if values["Status"] < FIX_3D or not values["GWk"]:
        return None
    seconds = GPS_EPOCH_UNIX_S - LEAP_SECONDS + values["GWk"] * _WEEK_S
    return int(seconds * 1_000_000 + values["GMS"] * 1000)


class _Latest:
    """The last vector logged up to a time; None before the first."""

    def __init__(self, series: list[Values], columns: tuple[str, str, str]) -> None:
        self._times = [each["TimeUS"] for each in series]
        x, y, z = columns
        self._vectors: list[Vector3] = [(each[x], each[y], each[z]) for each in series]

    def at(self, boot_us: int) -> Vector3 | None:
        index = bisect_right(self._times, boot_us) - 1
        return self._vectors[index] if index >= 0 else None
