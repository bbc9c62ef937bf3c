"""Cursor on Target: events of targets, vehicles and camera views as XML for ATAK and similar maps. Pure.

``ce`` and ``le`` are one sigma, metres, as the event schema defines errors: ``ce`` along the larger horizontal
semi-axis, ``le`` vertically. ``hae`` is height above the ellipsoid. Times are true UTC.
"""

from __future__ import annotations

from collections.abc import Mapping
from datetime import UTC, datetime, timedelta

import msgspec

from fwav_companion.geometry.stamps import NS_PER_US, ns_from_s

EPOCH = datetime(1970, 1, 1, tzinfo=UTC)
UNKNOWN = 9_999_999.0
"""Value of the schema for an unknown height or error."""
UNKNOWN_XML = "9999999.0"
MAX_UTC_NS = 10**9 * 4 * 10**9
"""Latest plausible UTC, the year 2096, Unix nanoseconds."""
ESTIMATED, MACHINE, FUSED = "h-e", "m-g", "m-f"
"""``how`` of an event: estimated by a person, from GPS, fused by a machine."""
DELETE_KIND = "t-x-d-d"
SPI_KIND, SPI_HOW = "b-m-p-s-p-i", "m-p"
"""Type and ``how`` of the point that a sensor looks at."""
DELETE_STALE_S = 60.0

Detail = tuple[str, Mapping[str, str]]
"""Name and attributes of one element of <detail>."""


class MapEvent(msgspec.Struct, frozen=True, kw_only=True):
    """The content of one event."""

    uid: str
    """Name of the marker: a later event with this uid moves the marker."""
    kind: str
    """CoT type, such as a-u-G."""
    how: str = FUSED
    utc_ns: int
    stale_s: float
    """Validity, seconds."""
    lat_deg: float
    lon_deg: float
    hae_m: float = UNKNOWN
    """Height above the ellipsoid, metres; :data:`UNKNOWN` where it is not known."""
    horizontal_sigma_m: float = UNKNOWN
    """One sigma along the larger semi-axis, metres; NaN where it is not known."""
    vertical_sigma_m: float = UNKNOWN
    """One sigma of the height, metres; NaN where it is not known."""
    callsign: str = ""
    """Name on the map; "": none."""
    remarks: str = ""
    """Text for people; "": none."""
    details: tuple[Detail, ...] = ()
    """Further elements of <detail>, in order."""

    def as_xml(self) -> str:
        """The event as one XML document."""
        time, stale = utc_text(self.utc_ns), utc_text(self.utc_ns + ns_from_s(self.stale_s))
        contact = (_element("contact", {"callsign": self.callsign}),) if self.callsign else ()
        remarks = (f"<remarks>{_xml(self.remarks)}</remarks>",) if self.remarks else ()
        detail = "".join((*contact, *(_element(name, values) for name, values in self.details), *remarks))
        return (
            '<?xml version="1.0" encoding="UTF-8"?>\n'
            f'<event version="2.0" uid="{_xml(self.uid)}" type="{_xml(self.kind)}"'
            f' how="{self.how}" time="{time}" start="{time}" stale="{stale}">'
            f'<point lat="{self.lat_deg:.7f}" lon="{self.lon_deg:.7f}" hae="{_metres(self.hae_m, least=-UNKNOWN)}"'
            f' ce="{_metres(self.horizontal_sigma_m)}" le="{_metres(self.vertical_sigma_m)}"/>'
            f"<detail>{detail}</detail></event>"
        )


def delete_event(marker: MapEvent, utc_ns: int) -> MapEvent:
    """The event that removes a marker from the map."""
    return MapEvent(
        uid=f"{marker.uid}.delete",
        kind=DELETE_KIND,
        how=MACHINE,
        utc_ns=utc_ns,
        stale_s=DELETE_STALE_S,
        lat_deg=marker.lat_deg,
        lon_deg=marker.lon_deg,
        details=(("link", {"uid": marker.uid, "type": marker.kind, "relation": "none"}), ("__forcedelete", {})),
    )


def utc_text(utc_ns: int) -> str:
    """An instant as ISO 8601 with milliseconds."""
    moment = EPOCH + timedelta(microseconds=utc_ns // NS_PER_US)
    return moment.strftime("%Y-%m-%dT%H:%M:%S.") + f"{moment.microsecond // 1000:03d}Z"


def clock_text(utc_ns: int) -> str:
    """An instant as HH:MM."""
    return (EPOCH + timedelta(microseconds=utc_ns // NS_PER_US)).strftime("%H:%M")


def _metres(value: float, least: float = 0.0) -> str:
    """The value; the schema's "unknown" for NaN and for values outside its range."""
    return f"{value:.2f}" if least <= value < UNKNOWN else UNKNOWN_XML


def _element(name: str, values: Mapping[str, str]) -> str:
    attributes = "".join(f' {key}="{_xml(value)}"' for key, value in values.items())
    return f"<{name}{attributes}/>"


def _xml(text: str) -> str:
    """Escaped text for an attribute or element; spaces for characters that XML 1.0 does not allow."""
    shown = "".join(character if character.isprintable() else " " for character in text)
    for character, entity in (("&", "&amp;"), ("<", "&lt;"), (">", "&gt;"), ('"', "&quot;"), ("'", "&apos;")):
        shown = shown.replace(character, entity)
    return shown
