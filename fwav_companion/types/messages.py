"""What crosses the wire, decoded and to be encoded."""

from __future__ import annotations

from collections.abc import Mapping
from enum import StrEnum
from typing import Any

import msgspec


class Message(msgspec.Struct, frozen=True, gc=False):
    """A MAVLink message that arrived, or that a recording holds."""

    name: str
    """Its MAVLink name, as ATTITUDE."""
    system: int
    """The sender's system id."""
    component: int
    """The sender's component id."""
    link: str
    """The name of the link it came over; "" in a recording."""
    fields: Any
    """A record with the definition's fields as attributes, in its order, that iterates as a tuple; arrays as tuples,
    text as str."""
    signed: bool = False
    """It carried a signature that was verified."""


class Destination(StrEnum):
    """Whom an outgoing message is meant for; the links follow from it."""

    AUTOPILOT = "autopilot"
    """The adopted autopilot, over the links it was heard on."""
    GROUND = "ground"
    """Ground stations: every gcs link, and through the autopilot's link while none is heard on a gcs link."""
    GROUND_LINKS = "ground_links"
    """Every gcs link, never the autopilot's."""
    EVERYONE = "everyone"
    """All links: heartbeats."""
    REPLY = "reply"
    """The one link in :attr:`Outgoing.link`."""


class Outgoing(msgspec.Struct, frozen=True, kw_only=True):
    """A message of ours that is to be sent."""

    name: str
    """Its MAVLink name."""
    fields: Mapping[str, Any]
    """Values by field name; an extension field left out is 0."""
    to: Destination
    component: int
    """The component of ours that speaks: the companion or its camera."""
    link: str = ""
    """For REPLY: the link the request came over."""


class Severity(StrEnum):
    """How loud a notice is."""

    INFO = "info"
    WARNING = "warning"
    ERROR = "error"


class Notice(msgspec.Struct, frozen=True):
    """One line for the log, and for people at a ground station where ``to_ground`` is set."""

    severity: Severity
    text: str
    to_ground: bool = False
