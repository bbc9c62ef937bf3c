"""The network in the service's status: links, their MAVLink, requested rates and TIMESYNC."""

from __future__ import annotations

from typing import Final

import msgspec
from msgspec import UNSET, UnsetType

REQUESTS: Final = 20
"""Number of TIMESYNC requests without an answer before the autopilot counts as silent: 2 s."""


class PeerStatistics(msgspec.Struct, frozen=True, kw_only=True):
    """Statistics of one (system, component) on one link."""

    system: int
    component: int
    received: int = 0
    """Number of received frames."""
    lost: int = 0
    """Lost frames by sequence number, on this link, before any filtering; a lower bound after long silences."""
    late: int = 0
    """Number of frames that arrived after their successors. They count as received, not as lost."""
    silent_s: float = 0.0
    """Time since the last frame, seconds."""
    rates_hz: dict[str, float] = {}
    """Rates by message name, hertz."""

    @property
    def loss(self) -> float:
        """Share of lost frames, 0 to 1."""
        return self.lost / (self.received + self.lost) if self.lost > 0 else 0.0


class ThinnedMessage(msgspec.Struct, frozen=True, kw_only=True):
    """A message that leaves at a lower rate than it arrives."""

    message: str
    why: str = ""
    at_most_hz: float | None = None
    """Highest rate per sender, hertz; None: as the budget allows."""
    thinned: int = 0
    """Number of frames that were not forwarded, since the start."""


class LinkThinning(msgspec.Struct, frozen=True, kw_only=True):
    """Messages thinned on one link, and the reasons."""

    messages: list[ThinnedMessage] = []
    max_bytes_per_s: float | None = None
    """Present budget, the radio's feedback included; None: no budget."""
    why: str | None = None
    """Source of the budget: ``max_bytes_per_s`` or ``radio_status``."""
    sent_bytes_per_s: float | None = None
    offered_bytes_per_s: float | None = None
    """Load offered to the link in the last second; as the bytes sent, None where there is no budget and no radio."""
    common_hz: float | None = None
    """Rate that fast streams are cut to, hertz; None: all fit."""
    txbuf: int | None = None
    """Free part of the radio's send buffer, percent; None: no radio is heard."""


class LinkStatistics(msgspec.Struct, frozen=True, kw_only=True):
    """MAVLink counters of one link since the start. Peers count since they were first heard, or restarted."""

    name: str
    up: bool = False
    bytes_in: int = 0
    bad_checksums: int = 0
    skipped_bytes: int = 0
    """Bytes that belong to no frame."""
    shed_bytes: int = 0
    """Number of skipped bytes that were not examined, because the link used up its trials."""
    not_understood: int = 0
    duplicates: int = 0
    echoes: int = 0
    """Frames of this service that came back."""
    own_ids_on_gcs: int = 0
    """Frames with the autopilot's ids that arrived on a link of another role, and were dropped."""
    id_conflict: int = 0
    """Frames of a second program with the service's ids."""
    stopped: int = 0
    thinned: int = 0
    refused_signatures: int = 0
    """Frames with a signature that does not verify."""
    refused_unsigned: int = 0
    """Unsigned frames that were refused."""
    late_copy: int = 0
    """Genuine signed frames with an old timestamp, dropped."""
    outdated: int = 0
    """Number of late copies of a sender whose clock is more than a minute behind the service's."""
    signed_unverified: int = 0
    """Signed frames for the service, received while no key is configured."""
    ground_station: bool = False
    thinning: LinkThinning = LinkThinning()
    peers: list[PeerStatistics] = []
    """Statistics of the peers with the most frames, the vehicle's first."""
    peers_left_out: int = 0


class LinkReport(msgspec.Struct, frozen=True, kw_only=True):
    """Connection of one link, and its counters over all its connections."""

    state: str = "not opened"
    """A :class:`~fwav_companion.links.base.LinkState`."""
    why: str = ""
    """Reason of the last loss, or of the last attempt that failed."""
    times_up: int = 0
    bytes_in: int = 0
    bytes_out: int = 0
    dropped: int = 0
    """Number of ``send`` calls whose bytes did not leave."""
    clients: list[str] | UnsetType = UNSET
    """Addresses of the clients in order of arrival; only of a server."""
    refused: int | UnsetType = UNSET
    """Number of times that a source was refused because all places were taken; only of a server."""
    device: str | UnsetType = UNSET
    """Name under which a serial device was found; only while it is open."""


class StreamReport(msgspec.Struct, frozen=True, kw_only=True):
    """One message that is requested from the autopilot at a rate."""

    wanted_hz: float = 0.0
    asked_hz: float | None = None
    """Requested rate, Hz; None while nothing is requested."""
    before_hz: float | None = None
    """Rate before the first request, Hz; None: not known, or with every new value."""
    before_by: str | None = None
    """Source of that rate: ``stated`` by the autopilot, or ``measured``; None before it is known."""
    contradicted: int = 0
    """Number of rates that the autopilot stated and the arrivals contradicted: the measured rate was used."""
    measured_hz: float | None = None
    """Rate over the last full window since the request was granted, Hz; None before the first window ended."""
    state: str = ""
    """``asking``, ``granted``, ``denied``, ``unanswered``, ``unsupported``; ``held_back``: another message serves."""
    undone_by: str | None = None
    """Cause of a recent loss of the rate."""


class TimesyncReport(msgspec.Struct, frozen=True, kw_only=True):
    """TIMESYNC exchanges with the autopilot."""

    requests: int = REQUESTS
    """Number of requests since the adoption. A status without this number is read as one that waited long enough."""
    exchanges: int = 0
    """Number of answered requests."""
    round_trip_s: float | None = None
    """The last round trip, seconds."""
    least_round_trip_s: float | None = None
    jitter_s: float | None = None
    ignored: dict[str, int] = {}
    """TIMESYNC messages that were not used, by reason."""
