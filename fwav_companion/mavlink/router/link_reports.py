"""Reports what was refused on the links, as notices: each kind once a minute for each link."""

from __future__ import annotations

from collections.abc import Callable, Iterator
from typing import Final

import msgspec

from fwav_companion.geometry.stamps import NS_PER_S, HostNs
from fwav_companion.mavlink.router.routing import Port
from fwav_companion.types import Notice, NoticeCode, Severity

REPORT_NS: Final = 60 * NS_PER_S


class _Kind(msgspec.Struct, frozen=True):
    """One count that is reported when it grows."""

    code: NoticeCode
    count: Callable[[Port], int]
    text: str
    """Text with {count}, {link} and {sender}."""
    to_ground: bool = True


_KINDS: Final = (
    _Kind(
        NoticeCode.OWN_IDS_ON_GCS,
        lambda port: port.own_ids_on_gcs,
        "{count} frames with the autopilot's ids came on link {link!r} and were dropped: a station that forwards back;"
        ' or a second way to our own autopilot (make it role = "autopilot"); or another vehicle with this system id;'
        " or a forgery",
    ),
    _Kind(
        NoticeCode.ID_CONFLICT,
        lambda port: port.id_conflict,
        "another program on link {link!r} uses our ids ({count} frames): set component_id = 192",
    ),
    _Kind(
        NoticeCode.SIGNED_IN_THE_PAST,
        lambda port: port.outdated,
        "{count} frames on link {link!r} are signed more than a minute in the past and were refused: set the sender's"
        " clock; or our signing time is ahead, then set a new key",
    ),
    _Kind(
        NoticeCode.RATE_REQUESTS_REJECTED,
        lambda port: port.rationed,
        "{count} requests for message rates on link {link!r} were rejected, the last of {sender}: a station may send"
        " two a second, and a link has places for eight stations",
    ),
    _Kind(
        NoticeCode.BYTES_SHED,
        lambda port: port.scanner.shed_bytes,
        "{count} bytes on link {link!r} were skipped unread, since they are not MAVLink: check what sends there",
        to_ground=False,
    ),
)


class LinkReports:
    """Follows the counts of all links."""

    def __init__(self, ports: list[Port]) -> None:
        self._ports = ports
        self._reported: dict[tuple[str, NoticeCode], tuple[int, HostNs]] = {}

    def take(self, now: HostNs) -> list[Notice]:
        """Return the notices that are due."""
        return [notice for port in self._ports for notice in self._of_port(port, now)]

    def _of_port(self, port: Port, now: HostNs) -> Iterator[Notice]:
        for kind in _KINDS:
            count = kind.count(port)
            before, reported_ns = self._reported.get((port.name, kind.code), (0, None))
            if count == before or (reported_ns is not None and now - reported_ns < REPORT_NS):
                continue
            self._reported[port.name, kind.code] = (count, now)
            text = kind.text.format(count=count - before, link=port.name, sender=port.rationed_sender)
            yield Notice(kind.code, Severity.WARNING, text, kind.to_ground)
