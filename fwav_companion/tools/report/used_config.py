"""What a report reads of the configuration in a recording's header. PURE."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Annotated, Any

import msgspec

from fwav_companion.recording.line_types import PlausibleMetres


class UsedLandmark(msgspec.Struct, frozen=True):
    """A [[landmark]] of the recorded configuration."""

    label: str
    lat: Annotated[float, msgspec.Meta(ge=-90.0, le=90.0)]
    lon: Annotated[float, msgspec.Meta(ge=-360.0, le=360.0)]
    alt_amsl: PlausibleMetres
    sigma_m: PlausibleMetres


class UsedTracking(msgspec.Struct, frozen=True):
    """[tracking] of the recorded configuration."""

    motion: str = ""


class UsedConfig(msgspec.Struct, frozen=True):
    """What a report reads of the recorded configuration."""

    tracking: UsedTracking = UsedTracking()
    landmark: tuple[UsedLandmark, ...] = ()


def used_config(config: Mapping[str, Any]) -> UsedConfig:
    """The part that is read; the defaults where a header has no configuration of this package."""
    try:
        return msgspec.convert(config, UsedConfig)
    except msgspec.ValidationError:
        return UsedConfig()
