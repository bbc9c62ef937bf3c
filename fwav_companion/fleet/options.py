"""The table [fleet] of the configuration."""

from __future__ import annotations

from typing import Annotated, Final

import msgspec
from msgspec import Meta

from fwav_companion.types.secrets import SecretUrl

FLEET_NAME = r"^[A-Za-z0-9_.-]{1,64}$"
FUSION_NAME: Final = "fleet"
"""Name under which fused targets are shown: a vehicle's tracks of this name would hide them."""
FleetWord = Annotated[str, Meta(pattern=FLEET_NAME, description="letters, digits, _ . -")]


class FleetTable(msgspec.Struct, frozen=True, kw_only=True):
    """[fleet]: present: tracks and state are shared with others over Zenoh."""

    name: FleetWord = "fleet"
    """Name of the fleet: vehicles of one name share."""
    vehicle: Annotated[str, Meta(pattern=r"^[A-Za-z0-9_.-]{0,64}$", description="letters, digits, _ . -")] = ""
    """Name of this vehicle, unique in the fleet; "": the MAVLink system id."""
    connect: tuple[SecretUrl, ...] = ()
    """Zenoh endpoints to connect to, for example "tcp/10.0.0.1:7447"; retried while they are not there. One: a router
    or a program that listens. Several: programs that listen; nothing passes through routers then."""
    listen: tuple[SecretUrl, ...] = ()
    """Zenoh endpoints to listen on."""
    scouting: bool = False
    """Whether peers are searched by multicast on the local network."""
    config: str = ""
    """Path of a Zenoh configuration (JSON5) with TLS and access control; the keys above add to it."""
    rate_hz: Annotated[float, Meta(gt=0, le=10)] = 2.0
    """Rate of the messages, hertz."""
    gnss_shared_m: Annotated[float, Meta(ge=0, le=100)] = 0.5
    """One sigma of the part of the position error that vehicles near one another may share, metres an axis."""
