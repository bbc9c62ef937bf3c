"""The messages of a fleet as JSON, schema 1, at most 64 kB each. Pure.

Covariances are upper triangles (nn, ne, nd, ee, ed, dd) with three significant digits. Received bytes are checked: the
result is one of these structs with possible values, or the reason why they are not a message.
"""

from __future__ import annotations

from collections.abc import Sequence
from typing import Annotated, TypeVar

import msgspec
from msgspec import Meta

from fwav_companion.geometry.vectors import Matrix3

SCHEMA = 1
MAX_BYTES = 64_000
MAX_PARTS = 16
MAX_TRACKS = 256
"""Most tracks of one vehicle in all parts."""
MAX_TRACKS_A_PART = 64
MAX_NAME = 64
"""Most characters of a vehicle's name."""
BIAS_NAMES = ("position_north", "position_east", "position_down", "heading")
DIGITS = 3

MOST_BIAS_M = 1e4
"""Largest effect of one sigma of a bias on a position, metres: the square root of the largest variance. Beyond it, the
fusion's equations of a vehicle alone would be singular in double precision."""

Triangle = Annotated[tuple[float, ...], Meta(min_length=6, max_length=6)]
Derivative = Annotated[float, Meta(ge=-1e6, le=1e6)]
"""Metres by metres or radians: the heading's is the distance."""
Row = Annotated[tuple[Derivative, ...], Meta(max_length=16)]
Sigma = Annotated[float, Meta(ge=0.0, le=1e4)]
Word = Annotated[str, Meta(max_length=MAX_NAME)]
Age = Annotated[float, Meta(ge=0.0, le=1e9)]
Time = Annotated[float, Meta(ge=0.0, le=1e11)]
Number = Annotated[int, Meta(ge=0, le=2**53)]
"""A number that every reader of JSON keeps exactly."""
Altitude = Annotated[float, Meta(ge=-1e4, le=1e5)]
Speed = Annotated[float, Meta(ge=-1e4, le=1e4)]
Latitude = Annotated[float, Meta(ge=-90, le=90)]
Longitude = Annotated[float, Meta(ge=-180, le=180)]
Offset = Annotated[float, Meta(ge=-1e6, le=1e6)]
"""Metres from the zero of a local world."""


class VehicleBias(msgspec.Struct, frozen=True, kw_only=True):
    """A vehicle's own biases."""

    names: Annotated[tuple[Word, ...], Meta(max_length=16)] = BIAS_NAMES
    sigma: Annotated[tuple[Sigma, ...], Meta(max_length=16)] = ()
    """One sigma of each bias, metres and radians."""
    time_constant_s: Age = 60.0
    """Time constant of the position's bias, seconds."""


class SharedTrack(msgspec.Struct, frozen=True, kw_only=True):
    """One track."""

    track: Number
    label: Word = ""
    state: Word = ""
    lat: Latitude
    lon: Longitude
    alt_amsl: Altitude | None = None
    cov: Triangle
    """Covariance including every error source, m^2."""
    cov_shared: Triangle
    """Covariance of the errors that other vehicles may share: terrain, target height, GNSS, m^2."""
    bias_jacobian: Annotated[tuple[Row, ...], Meta(min_length=3, max_length=3)]
    """d(position)/d(bias): north, east and down by the biases."""
    vel: Annotated[tuple[Speed, ...], Meta(min_length=3, max_length=3)] | None = None
    vel_cov: Triangle | None = None
    last_seen_s: Annotated[float, Meta(ge=-1e9, le=1e9)] = 0.0
    """Seconds since its last fix."""


class LocalTrack(msgspec.Struct, frozen=True, kw_only=True):
    """One track in its vehicle's local world: it has no place on the earth, and takes no part in the fusion."""

    track: Number
    label: Word = ""
    state: Word = ""
    north: Offset
    """From the world's zero, metres; the other axes alike."""
    east: Offset
    down: Offset
    cov: Triangle
    """Covariance including every error source, m^2."""
    last_seen_s: Annotated[float, Meta(ge=-1e9, le=1e9)] = 0.0
    """Seconds since its last fix."""


class LocalPlace(msgspec.Struct, frozen=True, kw_only=True):
    """Place of a vehicle in its own local world, metres from that world's zero."""

    north: Offset
    east: Offset
    down: Offset


class TracksMessage(msgspec.Struct, frozen=True, kw_only=True):
    """Tracks of one vehicle, or a part of them."""

    schema: int = SCHEMA
    vehicle: Word
    time_unix: Time
    """UTC, seconds."""
    seq: Number
    part: Annotated[int, Meta(ge=1, le=MAX_PARTS)] = 1
    parts: Annotated[int, Meta(ge=1, le=MAX_PARTS)] = 1
    session: Word = ""
    """Random name of the sender's run, which distinguishes two senders with one vehicle's name."""
    bias: VehicleBias = VehicleBias()
    tracks: Annotated[tuple[SharedTrack, ...], Meta(max_length=MAX_TRACKS)] = ()
    local_tracks: Annotated[tuple[LocalTrack, ...], Meta(max_length=MAX_TRACKS_A_PART)] = ()
    """Tracks in the vehicle's local world, while that has no place on the earth: ``tracks`` is empty then, as readers
    that do not know this field need the latitude of every track. All are in one part."""


class StateMessage(msgspec.Struct, frozen=True, kw_only=True):
    """State and health of one vehicle."""

    schema: int = SCHEMA
    vehicle: Word
    time_unix: Time
    session: Word = ""
    lat: Latitude | None = None
    lon: Longitude | None = None
    alt_amsl: Altitude | None = None
    local: LocalPlace | None = None
    """Place in the vehicle's local world, while that has no place on the earth: ``lat`` and ``lon`` are null then."""
    heading_deg: Annotated[float, Meta(ge=-360, le=360)] | None = None
    armed: bool = False
    ready: bool = False
    trouble: Annotated[str, Meta(max_length=300)] = ""
    """Why the vehicle is not ready, and what to do; "" if it is ready."""
    position_age_s: Age | None = None
    """Age of the place and the heading at ``time_unix``, seconds; None where the sender does not report it."""
    autopilot_age_s: Age | None = None
    """Seconds since the autopilot's last heartbeat; None where the sender does not report it."""
    frame_age_s: Age | None = None
    """Seconds since the newest frame of detections; None without one, and where the sender does not report it."""
    footprint: Annotated[tuple[tuple[Latitude, Longitude], ...], Meta(max_length=16)] = ()
    """Border of the camera's footprint on the ground; empty if not known."""


class FusedTrack(msgspec.Struct, frozen=True, kw_only=True):
    """One target of the fused picture."""

    track: int
    label: str = ""
    state: str = ""
    lat: float
    lon: float
    alt_amsl: float | None = None
    cov: Triangle
    last_seen_s: float = 0.0
    vehicles: dict[str, int] = {}
    """Track number by vehicle."""
    left_out: dict[str, str] = {}
    """Reason why a vehicle is left out, by vehicle."""


class FusedMessage(msgspec.Struct, frozen=True, kw_only=True):
    """The fused picture, or a part of it."""

    schema: int = SCHEMA
    time_unix: float
    seq: int
    part: int = 1
    parts: int = 1
    tracks: tuple[FusedTrack, ...] = ()


AnyMessage = TypeVar("AnyMessage", TracksMessage, StateMessage)


def triangle(cov: Matrix3) -> tuple[float, ...]:
    """Upper triangle of a symmetric matrix, three significant digits."""
    (nn, ne, nd), (_, ee, ed), (_, _, dd) = cov
    return tuple(shortened(value) for value in (nn, ne, nd, ee, ed, dd))


def shortened(value: float) -> float:
    """The number with three significant digits."""
    return float(f"{value:.{DIGITS}g}")


def encoded(message: TracksMessage | FusedMessage) -> list[bytes]:
    """The message as parts of at most MAX_BYTES. Tracks beyond the largest number of parts are left out."""
    tracks = message.tracks[: MAX_PARTS * MAX_TRACKS_A_PART]
    size = MAX_TRACKS_A_PART
    while True:
        pieces = [tracks[at : at + size] for at in range(0, len(tracks), size)] or [()]
        pieces = pieces[:MAX_PARTS]
        parts = [
            msgspec.json.encode(msgspec.structs.replace(message, part=number, parts=len(pieces), tracks=tuple(piece)))
            for number, piece in enumerate(pieces, 1)
        ]
        if all(len(part) <= MAX_BYTES for part in parts) or size == 1:
            return [part for part in parts if len(part) <= MAX_BYTES]
        size = max(1, size // 2)


def decoded(data: bytes, kind: type[AnyMessage]) -> AnyMessage | str:
    """The message, or the reason why it is refused: oversized, malformed (also with an impossible value), or another
    schema.
    """
    if len(data) > MAX_BYTES:
        return "oversized"
    try:
        message = msgspec.json.decode(data, type=kind)
    except (msgspec.MsgspecError, ValueError, RecursionError):
        return "malformed"
    if message.schema != SCHEMA:
        return "another schema"
    if isinstance(message, TracksMessage):
        fine = message.part <= message.parts and all(_is_sound(track, message.bias) for track in message.tracks)
        fine = fine and all(_is_covariance(track.cov) for track in message.local_tracks)
        return message if fine else "malformed"
    return message


def _is_sound(track: SharedTrack, bias: VehicleBias) -> bool:
    """Whether the covariances are possible, and the Jacobian has a column for each bias."""
    width = len(bias.names)
    if len(bias.sigma) != width or any(len(row) != width for row in track.bias_jacobian):
        return False
    for row in track.bias_jacobian:
        if any(abs(each) * sigma > MOST_BIAS_M for each, sigma in zip(row, bias.sigma, strict=True)):
            return False
    return all(map(_is_covariance, (track.cov, track.cov_shared, *filter(None, (track.vel_cov,)))))


def _is_covariance(values: Sequence[float]) -> bool:
    nn, ne, nd, ee, ed, dd = values
    if min(nn, ee, dd) < 0.0 or max(nn, ee, dd) >= MOST_BIAS_M**2:
        return False
    return all(each * each <= 1.02 * a * b for each, a, b in ((ne, nn, ee), (nd, nn, dd), (ed, ee, dd)))  # rounded
