"""Divides the rate between the two attitude messages: one is sent at the full rate, the other slowly or not at all."""

from __future__ import annotations

from collections.abc import Mapping

from fwav_companion.geometry.stamps import HostNs
from fwav_companion.mavlink.client.rate_stream import RateStream, StreamState

PLAIN, QUATERNION = "ATTITUDE", "ATTITUDE_QUATERNION"
BACKGROUND_ATTITUDE_HZ = 4.0
"""Rate of plain ATTITUDE while the quaternion arrives: enough for a ground station's horizon."""


class AttitudeSharing:
    """Sets the wanted rates of the two attitude streams; it does nothing if only one of them is wanted."""

    def __init__(self, message: str, full_hz: float) -> None:
        """Start with the configured rate. ``message``: the configured message, or "auto": the quaternion if
        available.
        """
        self._message = message
        self._full_hz = full_hz

    def begin(self, streams: Mapping[str, RateStream]) -> None:
        """Start over with an unknown autopilot: one of the two is tried first."""
        if self._prefers_quaternion(streams):
            streams[PLAIN].hold_back()
        elif self._message == PLAIN and QUATERNION in streams:
            streams[QUATERNION].hold_back()

    def fall_back(self, streams: Mapping[str, RateStream]) -> None:
        """Use plain ATTITUDE alone, because only groups of messages can be requested, and one of them contains it."""
        if PLAIN in streams and QUATERNION in streams:
            streams[QUATERNION].hold_back()

    def share(self, streams: Mapping[str, RateStream], now: HostNs) -> None:
        """Request plain ATTITUDE slowly while the quaternion arrives, and at the full rate if it is not available."""
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
    """Return whether the stream was denied or not answered, or was granted for a full window without any arrival."""
    if stream.state in {StreamState.DENIED, StreamState.UNANSWERED, StreamState.HELD_BACK}:
        return True
    return stream.state is StreamState.GRANTED and stream.meter.hz == 0.0
