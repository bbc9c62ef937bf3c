"""Cursor on Target: the selected target as an event for ATAK and similar maps. Pure.

``ce`` and ``le`` are one sigma, metres, as the event schema defines errors: ``ce`` along the larger horizontal
semi-axis, ``le`` vertically. ``hae`` is height above the ellipsoid: height above mean sea level plus the geoid height
from the autopilot's receiver. Times are true UTC; without UTC no event is made.
"""

from __future__ import annotations

from datetime import UTC, datetime, timedelta

import msgspec

from fwav_companion.geometry.stamps import NS_PER_US, ns_from_s
from fwav_companion.publishing.options import PublishOptions
from fwav_companion.publishing.target_report import TargetReport, target_report
from fwav_companion.types.messages import NoticeCode
from fwav_companion.types.situation import Situation
from fwav_companion.types.tracks import Track

EPOCH = datetime(1970, 1, 1, tzinfo=UTC)
LARGEST_ERROR_M = 9_999_999.0
"""Value of the schema for an unknown error."""
UNKNOWN_HAE_M = 9_999_999.0
"""Value of the schema for an unknown height."""
MAX_UTC_NS = 10**9 * 4 * 10**9
"""Latest plausible UTC, the year 2096, Unix nanoseconds."""


NO_EVENT = {
    NoticeCode.COT_WITHOUT_POSITION: "no global position: wait for the autopilot's GPS",
    NoticeCode.COT_WITHOUT_GEOID: "no geoid height: the autopilot's GPS_RAW_INT has no alt_ellipsoid",
    NoticeCode.COT_WITHOUT_UTC: "UTC is unknown: wait for the autopilot's GPS, or run NTP on this board",
}
"""Reasons why an event is not sent, and what to do."""


def cot_event(track: Track, options: PublishOptions, situation: Situation) -> bytes | NoticeCode:
    """One event, valid for ``cot_stale_s``, or the code of the reason why it is not sent.

    The uid names the board and the vehicle, so that the service moves the old marker after a restart.
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


class MapEvent(msgspec.Struct, frozen=True, kw_only=True):
    """The content of one event."""

    uid: str
    """Name of the marker: a later event with this uid moves the marker."""
    kind: str
    """CoT type, such as a-u-G."""
    utc_ns: int
    stale_s: float
    """Validity, seconds."""
    lat_deg: float
    lon_deg: float
    hae_m: float
    """Height above the ellipsoid, metres; :data:`UNKNOWN_HAE_M` where it is not known."""
    horizontal_sigma_m: float
    vertical_sigma_m: float
    """One sigma of the height, metres; NaN where it is not known."""
    callsign: str
    remarks: str

    def as_xml(self) -> str:
        """The event as one XML document."""
        time, stale = _utc(self.utc_ns), _utc(self.utc_ns + ns_from_s(self.stale_s))
        contact = f'<contact callsign="{_xml(self.callsign)}"/>'
        return (
            '<?xml version="1.0" encoding="UTF-8"?>'
            f'<event version="2.0" uid="{_xml(self.uid)}" type="{_xml(self.kind)}"'
            f' how="m-f" time="{time}" start="{time}" stale="{stale}">'
            f'<point lat="{self.lat_deg:.7f}" lon="{self.lon_deg:.7f}" hae="{self.hae_m:.2f}"'
            f' ce="{_error(self.horizontal_sigma_m)}" le="{_error(self.vertical_sigma_m)}"/>'
            f"<detail>{contact}<remarks>{_xml(self.remarks)}</remarks></detail></event>"
        )


def _event(target: TargetReport, hae_m: float, utc_ns: int, options: PublishOptions, situation: Situation) -> str:
    place, track = target.place, target.track
    if place is None:
        return ""
    system = situation.autopilot.system if situation.autopilot is not None else 0
    return MapEvent(
        uid=f"fwav-companion.{options.unit or 'fwav'}.{system}.target",
        kind=options.cot_type,
        utc_ns=utc_ns,
        stale_s=options.cot_stale_s,
        lat_deg=place.lat_deg,
        lon_deg=place.lon_deg,
        hae_m=hae_m,
        horizontal_sigma_m=target.horizontal_sigma_m,
        vertical_sigma_m=target.vertical_sigma_m,
        callsign=options.cot_callsign or track.label or "target",
        remarks=f"track {track.id}, {track.label or 'no label'}, {track.state}; ce and le are one sigma",
    ).as_xml()


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
