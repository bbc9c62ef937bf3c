"""Telemetry in the subtitles of videos: DJI's .SRT from 2017 to today, Autel's .ASS and text tracks. PURE.

Known layouts: GPS(lon,lat,n) BAROMETER:x of the Mavic Pro, once a second; GPS(lat,lon,0.0M) of the M300; one line with
F/, SS, GPS (lon, lat, n), D, H of the Phantom 4, Mini and Mavic 2, some with G.PRY (pitch, roll, yaw); brackets with
latitude, longitude (also "longtitude"), altitude or rel_alt and abs_alt, newer ones with gb_yaw, gb_pitch, gb_roll;
Autel's GPS(W: lon, N: lat, alt) ReH:x, with letters beside or in place of signs.
Cue times are the video's. Read by key, as firmwares differ in spaces and in the decimal sign.
"""

from __future__ import annotations

import re
from collections.abc import Iterator, Mapping
from typing import Final

from fwav_companion.errors import InputFileError
from fwav_companion.photographs.telemetry_rows import TelemetryRow, is_place

CUE: Final = re.compile(r"(\d{1,3}):(\d{2}):(\d{2})[,.](\d{1,3})\s*-->\s*(\d{1,3}):(\d{2}):(\d{2})[,.](\d{1,3})")
DIALOGUE: Final = re.compile(
    r"^Dialogue:[^,\n]*,\s*(\d{1,3}):(\d{2}):(\d{2})[.,](\d{1,3}),\s*(\d{1,3}):(\d{2}):(\d{2})[.,](\d{1,3}),",
    re.MULTILINE,
)
NUMBER: Final = r"[-+]?\d+(?:\.\d+)?"
PAIR: Final = re.compile(rf"([A-Za-z_]+)\s*:\s*({NUMBER})")
GPS: Final = re.compile(rf"GPS\s*\(\s*({NUMBER})\s*,\s*({NUMBER})\s*(?:,\s*({NUMBER})\s*(M?))?\s*\)")
LETTERED: Final = re.compile(
    rf"GPS\s*\(\s*([EW])\s*:\s*({NUMBER})\s*,\s*([NS])\s*:\s*({NUMBER})\s*(?:,\s*({NUMBER})\s*m?)?\s*\)", re.IGNORECASE
)
BROKEN_SIGN: Final = re.compile(r"(\d\.)-(\d)")
"""Autel's firmware writes -117.9605 as -117.-9605."""
HEIGHT: Final = re.compile(rf"\bH\s+({NUMBER})\s*m\b")
BAROMETER: Final = re.compile(rf"\b(?:BAROMETER|Hb|ReH)\s*:\s*({NUMBER})")
GIMBAL: Final = re.compile(rf"G\.PRY\s*\(\s*({NUMBER})\D+?({NUMBER})\D+?({NUMBER})\D*?\)")
MOST_ROWS: Final = 2_000_000
"""Rows of nine hours of video at 60 frames/s."""
TENTHS_FROM: Final = 100.0
"""focal_len above this is in tenths of a millimetre: 240 is 24.0 mm."""


def parse_srt(text: str, name: str) -> list[TelemetryRow]:
    """The rows of a .SRT or .ASS that have a place. InputFileError where none has."""
    text = text.removeprefix("\ufeff").replace("\r", "")
    rows = [row for row in _rows(text) if row.lat_deg is not None]
    if not rows:
        raise InputFileError(
            f"{name}: no subtitle in it has a position; accepted: the .SRT of a DJI drone, Autel's .ASS"
        )
    return sorted(rows[:MOST_ROWS], key=lambda row: row.at_s)


def end_of_srt_s(text: str) -> float:
    """The end of the last subtitle, also of one without a position; 0 where there is none."""
    return max((_seconds(cue.groups()[4:]) for cue in _cues(text)), default=0.0)


def subtitle_row(at_s: float, until_s: float, body: str) -> TelemetryRow:
    """What one subtitle says."""
    body = BROKEN_SIGN.sub(r"\1\2", body.replace(r"\N", "\n"))
    pairs = {key.lower(): float(value) for key, value in PAIR.findall(body)}
    lat, lon, absolute = _place(pairs, body)
    height, barometer = HEIGHT.search(body), BAROMETER.search(body)
    above = pairs.get("rel_alt")
    if above is None and (height or barometer):
        above = float((height or barometer)[1])  # type: ignore[index]
    return TelemetryRow(
        at_s=at_s,
        until_s=until_s,
        lat_deg=lat,
        lon_deg=lon,
        above_takeoff_m=above,
        absolute_m=pairs.get("abs_alt", pairs.get("altitude", absolute)),
        angles_deg=_angles(pairs, body),
        focal_35mm=_focal(pairs),
    )


def _rows(text: str) -> Iterator[TelemetryRow]:
    cues = _cues(text)
    for cue, following in zip(cues, [*cues[1:], None], strict=False):
        body = text[cue.end() : len(text) if following is None else following.start()]
        yield subtitle_row(_seconds(cue.groups()[:4]), _seconds(cue.groups()[4:]), body)


def _cues(text: str) -> list[re.Match[str]]:
    return list(CUE.finditer(text)) or list(DIALOGUE.finditer(text))


def _seconds(parts: tuple[str, ...]) -> float:
    hours, minutes, seconds, fraction = parts
    return int(hours) * 3600.0 + int(minutes) * 60.0 + int(seconds) + int(fraction.ljust(3, "0")) * 1e-3


def _place(pairs: Mapping[str, float], body: str) -> tuple[float | None, float | None, float | None]:
    """Latitude, longitude, absolute altitude. In GPS(...) longitude comes first, but where the third is metres."""
    lat, lon, absolute = pairs.get("latitude"), pairs.get("longitude", pairs.get("longtitude")), None
    lettered = LETTERED.search(body)
    if lettered is not None:
        lon, lat = abs(float(lettered[2])), abs(float(lettered[4]))
        lon, lat = (-lon if lettered[1] in "Ww" else lon), (-lat if lettered[3] in "Ss" else lat)
        absolute = None if lettered[5] is None else float(lettered[5])
    elif lat is None or lon is None:
        found = GPS.search(body)
        if found is None:
            return None, None, None
        first, second = float(found[1]), float(found[2])
        lat, lon = (first, second) if found[4] else (second, first)
    return (lat, lon, absolute) if is_place(lat, lon) else (None, None, None)


def _angles(pairs: Mapping[str, float], body: str) -> tuple[float, float, float] | None:
    if all(key in pairs for key in ("gb_yaw", "gb_pitch", "gb_roll")):
        return (pairs["gb_roll"], pairs["gb_pitch"], pairs["gb_yaw"])
    found = GIMBAL.search(body)
    return None if found is None else (float(found[2]), float(found[1]), float(found[3]))


def _focal(pairs: Mapping[str, float]) -> float | None:
    focal = pairs.get("focal_len")
    if focal is None or focal <= 0.0:
        return None
    zoom = pairs.get("dzoom_ratio", 1.0)
    zoom = zoom / 10000.0 if zoom >= 1000.0 else zoom  # newer firmware: 10000 is 1x
    return (focal / 10.0 if focal > TENTHS_FROM else focal) * max(1.0, zoom)
