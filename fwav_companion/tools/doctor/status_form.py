"""What the doctor takes for granted of a status file: another version may have other things in its places. Pure."""

from __future__ import annotations

from typing import Any

import msgspec


class _Peer(msgspec.Struct):
    system: int
    component: int
    received: int = 0
    lost: int = 0
    rates_hz: dict[str, float] = {}


class _Traffic(msgspec.Struct):
    name: str
    bytes_in: int = 0
    skipped_bytes: int = 0
    echoes: int = 0
    refused_signatures: int = 0
    refused_unsigned: int = 0
    peers: list[_Peer] = []


class _Rate(msgspec.Struct):
    asked_hz: float | None = None
    measured_hz: float | None = None
    state: str = ""
    undone_by: str | None = None


class _Clock(msgspec.Struct):
    status: str | None = None


class _Intake(msgspec.Struct):
    age_s: float | None = None


class _Telemetry(msgspec.Struct):
    attitude_source: str | None = None
    rates_hz: dict[str, float] = {}


class _Place(msgspec.Struct):
    lat: float
    lon: float


class _Status(msgspec.Struct):
    traffic: list[_Traffic] | None = None
    rates: dict[str, _Rate] | None = None
    clock: _Clock | None = None
    intake: _Intake | None = None
    telemetry: _Telemetry | None = None
    origin: _Place | None = None
    parameters: dict[str, float | None] | None = None
    dropped: dict[str, int] | None = None


def is_of_our_form(status: Any) -> bool:
    """Whether everything that findings are made of is of its kind where it is there at all."""
    try:
        msgspec.convert(status, _Status)
    except msgspec.ValidationError:
        return False
    return True
