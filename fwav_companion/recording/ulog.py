"""SHELL: reads PX4's own log (``.ulg``) with pyulog, an extra that only this module imports, when a log is read."""

from __future__ import annotations

from collections.abc import Iterator, Mapping, Sequence
from contextlib import redirect_stdout
from io import SEEK_SET, BytesIO
from math import isfinite, sqrt
from pathlib import Path
from typing import Any, Final

from fwav_companion.errors import InputFileError
from fwav_companion.geometry.rotations import normalized
from fwav_companion.geometry.vectors import Vector3
from fwav_companion.libraries import require
from fwav_companion.on_disk import content
from fwav_companion.recording.flight_log import (
    FlightLog,
    LoggedAttitude,
    LoggedGps,
    LoggedPosition,
    LoggedRange,
)
from fwav_companion.recording.time_checks import timely
from fwav_companion.recording.tlog import SkippedBytes

HEAD: Final = b"ULog\x01\x12\x35"
HEAD_BYTES: Final = 3
"""Length of a message's head: its size (two bytes) and its kind (a letter)."""
TOPICS: Final = (
    "vehicle_attitude",
    "vehicle_angular_velocity",
    "vehicle_global_position",
    "vehicle_local_position",
    "home_position",
    "distance_sensor",
    "vehicle_gps_position",
    "sensor_gps",
)


def is_ulog(data: bytes) -> bool:
    """Whether the data begins as a PX4 log does."""
    return data.startswith(HEAD)


def read_ulog(path: Path) -> tuple[FlightLog, list[SkippedBytes], bool]:
    """The log's content, its end if that is not a whole message, and whether pyulog met damage before the end.

    Since v1.10, PX4 writes a SYNC message every half second, with which pyulog continues after damage; it does not
    report the place. UserError where the log cannot be read, or where pyulog is not installed.
    """
    require(f"{path}: a PX4 log", "pyulog")
    from pyulog import ULog

    try:
        file = _ForwardFile(content(path))
    except OSError as error:
        raise InputFileError(f"{path}: {error.strerror}; accepted: a PX4 log (.ulg)") from error
    try:
        with redirect_stdout(None):  # pyulog prints a line for every message that it cannot read
            log = ULog(file, list(TOPICS), disable_str_exceptions=True)
    except Exception as error:  # what damaged definitions raise depends on the place of the damage
        raise InputFileError(f"{path}: {' '.join(str(error).split())}; accepted: a PX4 log (.ulg)") from error
    topics = {each.name: _Rows(each.data) for each in log.data_list if each.multi_id == 0}
    damaged = bool(log.file_corruption)
    return _flight(topics), [] if damaged else file.rest(), damaged


class _ForwardFile(BytesIO):
    """A file in memory that refuses to be read in an endless loop.

    Where a damaged definition has a size beyond the file's end, pyulog 1.3 goes back by that size, and therefore never
    reaches the end. It reads each message's head by ``read(3)``, and the head after the last definition twice.
    """

    def __init__(self, data: bytes) -> None:
        super().__init__(data)
        self._size = len(data)
        self._head_at = 0
        """Position of the head that was read last."""
        self._lowest = 0
        """Lowest permitted position of the next head."""

    def rest(self) -> list[SkippedBytes]:
        """The bytes after the last whole message; also available after the file was closed."""
        left = self._size - self._head_at
        return [SkippedBytes(self._head_at, left)] if left else []

    def read(self, size: int | None = -1, /) -> bytes:
        """The next bytes. ValueError if a head lies before the present one, or is read for the third time."""
        if size == HEAD_BYTES:
            at = self.tell()
            if at < self._lowest:
                raise ValueError(f"its definitions are damaged near byte {at}")
            self._lowest = at + (at == self._head_at)
            self._head_at = at
        return super().read(size)

    def seek(self, offset: int, whence: int = 0, /) -> int:
        """Move to an offset; returns the new position. An absolute offset (appended data, a SYNC message) begins a new
        pass.
        """
        if whence == SEEK_SET:
            self._lowest = 0
        return super().seek(offset, whence)


class _Rows:
    """One topic, one row per sample. A topic that the log does not have has no rows."""

    def __init__(self, columns: Mapping[str, Any]) -> None:
        self._columns = {name: column.tolist() for name, column in columns.items()}

    def rows(self, *names: str) -> Iterator[tuple[int, tuple[float, ...]]]:
        """(boot time in microseconds, values) of each finite row, by time. A name may have alternatives: ``a|b``."""
        logged, sampled = self._column("timestamp") or (), self._column("timestamp_sample")
        # Drivers that do not know the sampling time leave 0, as those of real GPS receivers do.
        given = [sample or at_us for at_us, sample in zip(logged, sampled or logged, strict=True)]
        # A damaged definition may call them floats. A time before boot is left out as damage.
        times = [int(at_us) if isfinite(at_us) else -1 for at_us in given]
        columns = [self._column(name) for name in names]
        if any(column is None for column in columns):
            return
        found = [column for column in columns if column is not None]
        for index in timely(times):
            values = tuple(column[index] for column in found)
            if all(map(isfinite, values)):
                yield times[index], values

    def _column(self, alternatives: str) -> Sequence[float] | None:
        return next((self._columns[name] for name in alternatives.split("|") if name in self._columns), None)


_NOTHING: Final = _Rows({})


def _flight(topics: Mapping[str, _Rows]) -> FlightLog:
    return FlightLog(
        autopilot="px4",
        attitude_source="vehicle_attitude",
        attitudes=list(_attitudes(topics)),
        positions=list(_positions(topics)),
        ranges=[
            LoggedRange(at_us, distance_m, round(orientation))
            for at_us, (distance_m, orientation) in topics.get("distance_sensor", _NOTHING).rows(
                "current_distance", "orientation"
            )
        ],
        gps=list(_gps(topics)),
        origin=_origin(topics),
        home=next(
            ((lat, lon, alt) for _, (lat, lon, alt) in topics.get("home_position", _NOTHING).rows("lat", "lon", "alt")),
            None,
        ),
    )


def _attitudes(topics: Mapping[str, _Rows]) -> Iterator[LoggedAttitude]:
    rates = iter(topics.get("vehicle_angular_velocity", _NOTHING).rows("xyz[0]", "xyz[1]", "xyz[2]"))
    newest, waiting = (0.0, 0.0, 0.0), next(rates, None)
    for at_us, q in topics.get("vehicle_attitude", _NOTHING).rows("q[0]", "q[1]", "q[2]", "q[3]"):
        while waiting is not None and waiting[0] <= at_us:
            x, y, z = waiting[1]
            newest, waiting = (x, y, z), next(rates, None)
        if 0.95 <= sqrt(sum(c * c for c in q)) <= 1.05:
            w, i, j, k = q
            yield LoggedAttitude(at_us, normalized((w, i, j, k)), newest)


def _positions(topics: Mapping[str, _Rows]) -> Iterator[LoggedPosition]:
    home = [alt for _, (alt,) in topics.get("home_position", _NOTHING).rows("alt")]
    velocities = iter(topics.get("vehicle_local_position", _NOTHING).rows("vx", "vy", "vz"))
    velocity: Vector3 | None = None
    waiting = next(velocities, None)
    ground_m = home[-1] if home else None
    for at_us, (lat, lon, alt) in topics.get("vehicle_global_position", _NOTHING).rows("lat", "lon", "alt"):
        while waiting is not None and waiting[0] <= at_us:
            x, y, z = waiting[1]
            velocity, waiting = (x, y, z), next(velocities, None)
        # Without a home position the flight is assumed to begin on the ground.
        ground_m = alt if ground_m is None else ground_m
        yield LoggedPosition(
            boot_us=at_us, lat=lat, lon=lon, alt_amsl_m=alt, height_above_home_m=alt - ground_m, velocity_ned=velocity
        )


def _gps(topics: Mapping[str, _Rows]) -> Iterator[LoggedGps]:
    rows = topics.get("vehicle_gps_position") or topics.get("sensor_gps") or _NOTHING
    for at_us, (fix, utc_us) in rows.rows("fix_type", "time_utc_usec"):
        yield LoggedGps(at_us, round(fix), int(utc_us) or None)


def _origin(topics: Mapping[str, _Rows]) -> tuple[float, float, float] | None:
    rows = topics.get("vehicle_local_position", _NOTHING).rows("ref_lat", "ref_lon", "ref_alt", "xy_global")
    return next(((lat, lon, alt) for _, (lat, lon, alt, is_global) in rows if is_global), None)
