"""The format of detections on the wire and in recordings: one JSON object per frame. PURE.

For any bytes :func:`parse_frame` gives a Frame, or the reason why they are not one. In any notation (``NaN``, ``null``,
``1e999``), a pixel that is not a finite number becomes NaN, and a sigma that is not finite becomes 0: pairing then
rejects that one detection with ``not_finite`` and keeps the others. In any other field, it rejects the whole frame.
"""

from __future__ import annotations

import json
from collections.abc import Iterator
from itertools import chain
from math import isfinite, nan
from typing import Annotated, Any, TypeAlias

import msgspec
from msgspec import Meta

from fwav_companion.geometry.stamps import HostNs, host_from_seconds
from fwav_companion.types import Corners, Detection, Frame, NoFrame, Outline, Pixel, Reason, StampClock
from fwav_companion.vision.wall_clock import StampClocks

MAX_DETECTIONS = 256
"""Most detections per frame; part of the interface contract."""
MOST_FRAME_BYTES = 1 << 20
"""Most bytes of one line or datagram: MAX_DETECTIONS with labels, boxes and corners take a fifth of it."""
MAX_LABEL = 256
"""Most characters of a label; each track stores its label."""
MAX_FILE = 255
"""Most characters of a file's name, the limit of common file systems."""
LATEST_UNIX_S = 1e11
"""Latest Unix time, the year 5138: a larger number is in another unit. Today's milliseconds are 1.8e12, microseconds
1.8e15, nanoseconds 1.8e18."""
LATEST_MONOTONIC_S = 1e9
"""Latest monotonic time: 32 years of uptime. Nanoseconds exceed it after one second."""
LATEST_BOOT_S = 1e8
"""Latest boot time: three years without a reboot of the autopilot. Nanoseconds exceed it after 0.1 s, microseconds
after 100 s."""
LONGEST_EXPOSURE_S = 10.0
"""Longest exposure: libcamera's are in microseconds, and its shortest are above this."""

Int64: TypeAlias = Annotated[int, Meta(ge=-(2**63), le=2**63 - 1)]
Pixels: TypeAlias = Annotated[int, Meta(ge=1, le=1_000_000)]
WireOutline: TypeAlias = Annotated[Outline, Meta(min_length=3, max_length=16)]
Label: TypeAlias = Annotated[str, Meta(max_length=MAX_LABEL)]


class WireDetection(msgspec.Struct, gc=False):
    """One element of ``detections`` as sent."""

    u: float | None
    v: float | None
    sigma: float | tuple[float | None, float | None] | None = None
    label: Label | None = None
    score: float | None = None
    box: tuple[float, float, float, float] | None = None
    id: Int64 | None = None
    corners: Any = None
    """Four corners of a marker. Any other value is another program's field of that name, and is ignored."""
    outline: Any = None
    """Convex outline of a thing, from 3 to 16 points; any other value is ignored."""
    foot: Any = None
    """Pixel between the ankles of a person; any other value is ignored."""


class WireFrame(msgspec.Struct):
    """One frame as sent; unknown fields are ignored."""

    detections: list[WireDetection]
    time_unix: float | None = None
    time_monotonic: float | None = None
    time_boot: float | None = None
    received_unix: float | None = None
    frame: Int64 | None = None
    size: tuple[Pixels, Pixels] | None = None
    exposure_s: float | None = None
    picture: Int64 | None = None
    """Number of the kept picture, from this package's camera process."""
    file: Any = None
    """Name of the photograph; what is no text of at most MAX_FILE characters is ignored."""


class _RecordedFrame(msgspec.Struct, omit_defaults=True, kw_only=True):
    """One line of a recording, with the same names in reading order."""

    time_unix: float | None = None
    time_boot: float | None = None
    received_unix: float | None = None
    frame: int | None = None
    size: tuple[int, int] | None = None
    exposure_s: float | None = None
    detections: tuple[_RecordedDetection, ...]


class _RecordedDetection(msgspec.Struct, omit_defaults=True):
    u: float
    v: float
    sigma: tuple[float, float] | None = None
    label: str = ""
    score: float | None = None
    box: tuple[float, float, float, float] | None = None
    id: int | None = None
    corners: Corners | None = None
    outline: Outline | None = None
    foot: Pixel | None = None


_decoder = msgspec.json.Decoder(WireFrame)
_encoder = msgspec.json.Encoder()


def parse_frame(data: bytes | str, arrival_ns: HostNs | None, clocks: StampClocks) -> Frame | NoFrame:
    """The frame in a datagram, or in a line of a recording (``arrival_ns`` None: the line's ``received_unix``)."""
    wire = _decode(data)
    if isinstance(wire, NoFrame):
        return wire
    refusal = _refusal(wire)
    if refusal is not None:
        return refusal
    if arrival_ns is None and wire.received_unix is not None:
        received = clocks.host_from_unix(wire.received_unix, None)
        arrival_ns = None if isinstance(received, NoFrame) else received
    stamp = _stamp(wire, arrival_ns, clocks)
    if isinstance(stamp, NoFrame):
        return stamp
    stamp_ns, stamp_clock = stamp
    return Frame(
        number=wire.frame,
        stamp_ns=stamp_ns,
        stamp_clock=stamp_clock,
        arrival_ns=arrival_ns,
        detections=tuple(map(_detection, wire.detections)),
        size=wire.size,
        exposure_s=wire.exposure_s,
        picture=wire.picture,
        file=wire.file if isinstance(wire.file, str) and len(wire.file) <= MAX_FILE else "",
    )


def encode_frame(frame: Frame, unix_offset_ns: int) -> bytes:
    """The frame as one line of a recording, on the recording's clock: ``time_unix = host + unix_offset``.

    A stamp of the autopilot's clock is not converted: a replay does that as the live service did.
    """
    on_host = frame.stamp_clock is StampClock.HOST
    line = _RecordedFrame(
        time_unix=_seconds(frame.stamp_ns + unix_offset_ns) if on_host else None,
        time_boot=None if on_host else _seconds(frame.stamp_ns),
        received_unix=None if frame.arrival_ns is None else _seconds(frame.arrival_ns + unix_offset_ns),
        frame=frame.number,
        size=frame.size,
        exposure_s=frame.exposure_s,
        detections=tuple(
            _RecordedDetection(
                u=d.u,
                v=d.v,
                sigma=d.sigma,
                label=d.label,
                score=d.score,
                box=d.box,
                id=d.detector_id,
                corners=d.corners,
                outline=d.outline,
                foot=d.foot,
            )
            for d in frame.detections
        ),
    )
    return _encoder.encode(line) + b"\n"


def stamp_line(frame: Frame, file: str, unix_offset_ns: int) -> bytes:
    """The line of a kept picture in stamps.jsonl, on the recording's clock as in :func:`encode_frame`."""
    on_host = frame.stamp_clock is StampClock.HOST
    seconds = _seconds(frame.stamp_ns + unix_offset_ns) if on_host else _seconds(frame.stamp_ns)
    line: dict[str, str | float] = {"file": file, "time_unix" if on_host else "time_boot": seconds}
    if frame.number is not None:
        line["frame"] = frame.number
    if frame.exposure_s is not None:
        line["exposure_s"] = frame.exposure_s
    return _encoder.encode(line) + b"\n"


def _decode(data: bytes | str) -> WireFrame | NoFrame:
    if len(data) > MOST_FRAME_BYTES:
        return NoFrame(Reason.MALFORMED, f"{len(data)} bytes, accepted: {MOST_FRAME_BYTES}")
    try:
        return _decoder.decode(data)
    except (msgspec.ValidationError, UnicodeError, RecursionError) as error:
        out_of_range = "out of range" in str(error)
        return _decode_leniently(data) if out_of_range else NoFrame(Reason.MALFORMED, str(error))
    except msgspec.DecodeError:
        return _decode_leniently(data)


def _decode_leniently(data: bytes | str) -> WireFrame | NoFrame:
    """Decode JSON as Python's ``json`` writes it, with NaN and infinities: most detectors are in Python."""
    try:
        wire = msgspec.convert(json.loads(data), WireFrame)
        for detection in wire.detections:
            (detection.label or "").encode()  # half a surrogate pair could not be recorded
    except (ValueError, RecursionError) as error:
        return NoFrame(Reason.MALFORMED, str(error)[:100])
    return wire


def _refusal(wire: WireFrame) -> NoFrame | None:
    """Why the whole frame is rejected; None if it is not."""
    if len(wire.detections) > MAX_DETECTIONS:
        return NoFrame(Reason.TOO_MANY_DETECTIONS, f"{len(wire.detections)}, accepted: {MAX_DETECTIONS}")
    if not all(map(isfinite, _numbers(wire))):
        return NoFrame(Reason.NOT_FINITE)
    if abs(wire.received_unix or 0.0) > LATEST_UNIX_S:
        return NoFrame(Reason.WRONG_UNITS, f"received_unix {wire.received_unix:g}, accepted: seconds")
    if wire.exposure_s is not None and not 0.0 <= wire.exposure_s <= LONGEST_EXPOSURE_S:
        negative = wire.exposure_s < 0.0
        return NoFrame(Reason.MALFORMED if negative else Reason.WRONG_UNITS, f"exposure_s {wire.exposure_s:g}")
    return None


def _numbers(wire: WireFrame) -> Iterator[float]:
    """All numbers that must be finite for the frame to be usable."""
    for number in (wire.time_unix, wire.time_monotonic, wire.time_boot, wire.received_unix, wire.exposure_s):
        if number is not None:
            yield number
    for detection in wire.detections:
        if detection.score is not None:
            yield detection.score
        if detection.box is not None:
            yield from detection.box


def _stamp(wire: WireFrame, arrival_ns: HostNs | None, clocks: StampClocks) -> tuple[int, StampClock] | NoFrame:
    """The one stamp and its clock, host or boot."""
    given = [
        (name, seconds, latest)
        for name, seconds, latest in (
            ("time_unix", wire.time_unix, LATEST_UNIX_S),
            ("time_monotonic", wire.time_monotonic, LATEST_MONOTONIC_S),
            ("time_boot", wire.time_boot, LATEST_UNIX_S if clocks.boot_is_unix else LATEST_BOOT_S),
        )
        if seconds is not None
    ]
    if len(given) != 1:
        return NoFrame(Reason.NO_TIME, ", ".join(name for name, _, _ in given) or "none of the three")
    name, seconds, latest = given[0]
    if seconds < 0.0:
        return NoFrame(Reason.MALFORMED, f"{name} {seconds:g}")
    if seconds > latest:
        return NoFrame(Reason.WRONG_UNITS, f"{name} {seconds:g}, accepted: seconds")
    if name == "time_boot":
        return host_from_seconds(seconds), StampClock.BOOT
    if name == "time_monotonic" and arrival_ns is not None and _is_other_unit(seconds, arrival_ns * 1e-9):
        return NoFrame(Reason.WRONG_UNITS, f"{name} {seconds:g} at {arrival_ns * 1e-9:.3f} s")
    host_ns = clocks.host_from_unix(seconds, arrival_ns) if name == "time_unix" else clocks.host_from_monotonic(seconds)
    return host_ns if isinstance(host_ns, NoFrame) else (host_ns, StampClock.HOST)


def _is_other_unit(value: float, now_s: float) -> bool:
    """Whether the value lies in the future as seconds, but within a second of now in a smaller unit."""
    return value > now_s + 1.0 and any(abs(value / per_s - now_s) < 1.0 for per_s in (1e3, 1e6, 1e9))


def _detection(wire: WireDetection) -> Detection:
    return Detection(
        u=_pixel(wire.u),
        v=_pixel(wire.v),
        sigma=_sigma(wire.sigma),
        label=wire.label or "",
        score=wire.score,
        box=wire.box,
        detector_id=wire.id,
        corners=None if wire.corners is None else _points(wire.corners, Corners),
        outline=None if wire.outline is None else _points(wire.outline, WireOutline),
        foot=None if wire.foot is None else _foot(wire.foot),
    )


def _points(value: Any, kind: Any) -> Any:
    """The points in ``value`` as this kind of tuple; None where they are not such points, or not finite."""
    try:
        points = msgspec.convert(value, kind)
    except msgspec.ValidationError:
        return None
    return points if all(map(isfinite, chain.from_iterable(points))) else None


def _foot(value: Any) -> Pixel | None:
    points = _points([value], tuple[Pixel])
    return None if points is None else points[0]


def _pixel(value: float | None) -> float:
    return value if value is not None and isfinite(value) else nan


def _sigma(value: float | tuple[float | None, float | None] | None) -> tuple[float, float] | None:
    if value is None:
        return None
    first, second = value if isinstance(value, tuple) else (value, value)
    return (_finite_or_zero(first), _finite_or_zero(second))


def _finite_or_zero(value: float | None) -> float:
    return value if value is not None and isfinite(value) else 0.0


def _seconds(instant_ns: int) -> float:
    """The instant in seconds, cut to whole microseconds; rounded to microseconds it reads back exactly until 2255."""
    return (instant_ns // 1000) / 1e6
