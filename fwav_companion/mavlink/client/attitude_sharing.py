"""Two messages tell the attitude: which of them flows fully, and which slowly or not at all."""

from __future__ import annotations

from collections.abc import Mapping

from fwav_companion.geometry.stamps import HostNs
from fwav_companion.mavlink.client.rate_stream import RateStream, StreamState

PLAIN, QUATERNION = "ATTITUDE", "ATTITUDE_QUATERNION"
BACKGROUND_ATTITUDE_HZ = 4.0
"""Of plain ATTITUDE once the quaternion flows: enough for a ground station's horizon."""


class AttitudeSharing:
    """Says of the two streams what to ask for; with one of them alone it says nothing."""

    def __init__(self, message: str, full_hz: float) -> None:
        """``message``: the one that is configured, or "auto": the quaternion where it can be had."""
        self._message = message
        self._full_hz = full_hz

    def begin(self, streams: Mapping[str, RateStream]) -> None:
        """Nothing is known yet: one of the two is tried first."""
        if self._prefers_quaternion(streams):
            streams[PLAIN].hold_back()
        elif self._message == PLAIN and QUATERNION in streams:
            streams[QUATERNION].hold_back()

    def fall_back(self, streams: Mapping[str, RateStream]) -> None:
        """Only groups of messages can be asked for: plain ATTITUDE is in one of them."""
        if PLAIN in streams and QUATERNION in streams:
            streams[QUATERNION].hold_back()

    def share(self, streams: Mapping[str, RateStream], now: HostNs) -> None:
        """Plain ATTITUDE slowly while the quaternion flows, fully where it cannot be had."""
        if not self._prefers_quaternion(streams):
            return
        quaternion, plain = streams[QUATERNION], streams[PLAIN]
        if (quaternion.meter.hz or 0.0) > 0.0:
            hz = min(BACKGROUND_ATTITUDE_HZ, self._full_hz)
        elif self._message == "auto" and _has_failed(quaternion):
            hz = self._full_hz
        else:
            return
        if plain.state is StreamState.HELD_BACK or plain.wanted_hz != hz:
            plain.want(hz, now)

    def _prefers_quaternion(self, streams: Mapping[str, RateStream]) -> bool:
        return PLAIN in streams and QUATERNION in streams and self._message != PLAIN


def _has_failed(stream: RateStream) -> bool:
    """It was denied, or not answered, or granted for a whole window in which nothing came."""
    if stream.state in {StreamState.DENIED, StreamState.UNANSWERED, StreamState.HELD_BACK}:
        return True
    return stream.state is StreamState.GRANTED and stream.meter.hz == 0.0
