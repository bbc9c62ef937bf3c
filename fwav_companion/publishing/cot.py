"""Cursor on Target: the selected target as an event for ATAK and similar maps. Pure.

``ce`` and ``le`` are one sigma, as the event schema defines them for an error: ``ce`` along the larger horizontal
semi-axis, ``le`` vertically, metres. ``hae`` is height above the ellipsoid: height above mean sea level plus the geoid
height of the autopilot's own receiver. Times are true UTC; without UTC no event is made.
"""

from __future__ import annotations

from datetime import UTC, datetime, timedelta

from fwav_companion.geometry.stamps import NS_PER_US, ns_from_s
from fwav_companion.publishing.options import PublishOptions
from fwav_companion.publishing.target_report import TargetReport, target_report
from fwav_companion.types.messages import NoticeCode
from fwav_companion.types.situation import Situation
from fwav_companion.types.tracks import Track

EPOCH = datetime(1970, 1, 1, tzinfo=UTC)
LARGEST_ERROR_M = 9_999_999.0
"""Value of the schema for an unknown error."""
MAX_UTC_NS = 10**9 * 4 * 10**9
"""The year 2096: a later time is not plausible."""


NO_EVENT = {
    NoticeCode.COT_WITHOUT_POSITION: "no global position: wait for the autopilot's GPS",
    NoticeCode.COT_WITHOUT_GEOID: "no geoid height: the autopilot's GPS_RAW_INT has no alt_ellipsoid",
    NoticeCode.COT_WITHOUT_UTC: "UTC is unknown: wait for the autopilot's GPS, or run NTP on this board",
}
"""Why an event is not sent, and what to do."""


def cot_event(track: Track, options: PublishOptions, situation: Situation) -> bytes | NoticeCode:
    """One event, valid for ``cot_stale_s``, or the code of why it is not sent.

    The uid names the board and the vehicle: a restart moves the old marker.
    """
    target = target_report(track, situation)
    if target.place is None:
        return NoticeCode.COT_WITHOUT_POSITION
    if situation.undulation_m is None:
        return NoticeCode.COT_WITHOUT_GEOID
    if situation.utc_minus_host_s is None:
        return NoticeCode.COT_WITHOUT_UTC
    utc_ns = situation.now_ns + ns_from_s(situation.utc_minus_host_s)
    if not 0 <= utc_ns < MAX_UTC_NS:
        return NoticeCode.COT_WITHOUT_UTC
    return _event(
        target, target.place.alt_amsl_m + situation.undulation_m, utc_ns=utc_ns, options=options, situation=situation
    ).encode()


def _event(target: TargetReport, hae_m: float, utc_ns: int, options: PublishOptions, situation: Situation) -> str:
    place, track = target.place, target.track
    if place is None:
        return ""
    time, stale = _utc(utc_ns), _utc(utc_ns + ns_from_s(options.cot_stale_s))
    system = situation.autopilot.system if situation.autopilot is not None else 0
    unit = options.unit or "fwav"
    callsign = options.cot_callsign or track.label or "target"
    remarks = f"track {track.id}, {track.label or 'no label'}, {track.state}; ce and le are one sigma"
    return (
        '<?xml version="1.0" encoding="UTF-8"?>'
        f'<event version="2.0" uid="{_xml(f"fwav-companion.{unit}.{system}.target")}" type="{_xml(options.cot_type)}"'
        f' how="m-f" time="{time}" start="{time}" stale="{stale}">'
        f'<point lat="{place.lat_deg:.7f}" lon="{place.lon_deg:.7f}" hae="{hae_m:.2f}"'
        f' ce="{_error(target.horizontal_sigma_m)}" le="{_error(target.vertical_sigma_m)}"/>'
        f'<detail><contact callsign="{_xml(callsign)}"/><remarks>{_xml(remarks)}</remarks></detail></event>'
    )


def _utc(utc_ns: int) -> str:
    moment = EPOCH + timedelta(microseconds=utc_ns // NS_PER_US)
    return moment.strftime("%Y-%m-%dT%H:%M:%S.") + f"{moment.microsecond // 1000:03d}Z"


def _error(sigma_m: float) -> str:
    return f"{min(sigma_m, LARGEST_ERROR_M) if sigma_m >= 0.0 else LARGEST_ERROR_M:.2f}"


def _xml(text: str) -> str:
    """Escaped text for an attribute or element; spaces for characters that XML 1.0 does not allow."""
    shown = "".join(character if character.isprintable() else " " for character in text)
    for character, entity in (("&", "&amp;"), ("<", "&lt;"), (">", "&gt;"), ('"', "&quot;"), ("'", "&apos;")):
        shown = shown.replace(character, entity)
    return shown
