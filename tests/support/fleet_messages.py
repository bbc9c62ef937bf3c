"""Messages of a fleet, as a vehicle sends them."""

from __future__ import annotations

from fwav_companion.fleet.payloads import LocalTrack, SharedTrack, TracksMessage, VehicleBias

NOW = 1_790_000_000.0
COV = (4.0, 1.0, 0.0, 2.0, 0.0, 1.0)
ROWS = ((1.0, 0.0, 0.0, -3.0), (0.0, 1.0, 0.0, 5.0), (0.0, 0.0, 1.0, 0.0))
BIAS = VehicleBias(sigma=(1.0, 1.0, 0.5, 0.03))


def shared(number: int = 1, **changes) -> SharedTrack:
    fields = {"track": number, "label": "person", "state": "confirmed", "lat": 48.0, "lon": 11.0}
    return SharedTrack(**{**fields, "cov": COV, "cov_shared": (0.0,) * 6, "bias_jacobian": ROWS, **changes})


def local(number: int = 1, **changes) -> LocalTrack:
    fields = {"track": number, "label": "person", "state": "confirmed", "north": -4.0, "east": 5.0, "down": 1.0}
    return LocalTrack(**{**fields, "cov": COV, **changes})


def tracks_message(*tracks: SharedTrack, **changes) -> TracksMessage:
    fields = {"vehicle": "1", "time_unix": NOW, "seq": 1, "session": "a", "bias": BIAS, "tracks": tracks}
    return TracksMessage(**{**fields, **changes})
