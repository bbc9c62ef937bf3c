"""The JSON of a status file, as `check` reads it. Another version may lack any part, or have null in its place."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any, Final

import msgspec

from fwav_companion.types.status import RunStatus

ADOPTION_S: Final = 5.0
"""Seconds of listening until an autopilot is adopted: one heartbeat, three seconds of choosing, one second to spare."""
MEASURED_S: Final = 5.0
"""Seconds after adoption until rates, clock and position can be judged: a window of 2 s, begun within a second."""
UNJUDGED: Final = (("calibration",), ("publishing",), ("sight", "ground"))
"""Paths of parts that `check` does not judge: in another version they may have any form."""


def run_status(decoded: Any) -> RunStatus | None:
    """Return the decoded JSON of a status file as a RunStatus; None where a judged part is of another type."""
    known = _without_nulls(decoded)
    for path in UNJUDGED:
        known = _without(known, path)
    try:
        return msgspec.convert(known, RunStatus)
    except msgspec.ValidationError:
        return None


def _without(value: Any, path: tuple[str, ...]) -> Any:
    if not isinstance(value, Mapping) or path[0] not in value:
        return value
    rest = {key: each for key, each in value.items() if key != path[0]}
    return rest if len(path) == 1 else {**rest, path[0]: _without(value[path[0]], path[1:])}


def _without_nulls(value: Any) -> Any:
    if isinstance(value, Mapping):
        return {key: _without_nulls(each) for key, each in value.items() if each is not None}
    if isinstance(value, list):
        return [_without_nulls(each) for each in value if each is not None]
    return value
