"""Network streams by PyAV: RTSP, MPEG-TS over UDP, and RTP by an SDP file.

Each RTP packet has the server's time after the first RTCP report: PyAV's ``prft`` side data, 8 bytes of microseconds
since 1970 and 4 of flags, little-endian. A packet's time belongs to the frame with its pts, because decoders may
reorder frames. It is mostly the time of sending, and cameras without NTP count from any epoch: ``server_clock`` maps it
to this board's clock. Before the first report, and in MPEG-TS, the arrival is used.
"""

from __future__ import annotations

import logging
import struct
import time
from collections import OrderedDict
from collections.abc import Iterator
from typing import Any

from fwav_companion.vision.images import Picture, SourceLostError
from fwav_companion.vision.server_clock import ServerClock

_log = logging.getLogger(__name__)
TIMEOUT_S = 5.0
MOST_PENDING = 64
"""Most packets whose frame has not left the decoder; codecs hold back 16 at most (H.264, annex A)."""
OPTIONS = {"rtsp_transport": "tcp", "fflags": "nobuffer", "flags": "low_delay"}
"""FFmpeg options: complete frames rather than fast ones, and no buffering."""
SDP_OPTIONS = {"protocol_whitelist": "file,udp,rtp"}
PRODUCER_TIME = "prft"


class StreamSource:
    """One connection to a stream."""

    def __init__(self, url: str, *, utc: bool) -> None:
        """``utc``: the server's clock and this board's are UTC."""
        import av

        self._name, self._utc = url, utc
        self._clock = ServerClock()
        options = OPTIONS | (SDP_OPTIONS if url.endswith(".sdp") else {})
        try:
            self._container: Any = av.open(url, options=options, timeout=TIMEOUT_S)
            video = self._container.streams.video[0]
        except (av.error.FFmpegError, OSError, ValueError) as error:
            raise SourceLostError(f"{url}: {_reason(error)}") from None
        except IndexError:
            raise SourceLostError(f"{url}: the stream has no video") from None
        video.thread_type = "SLICE"  # threads by frames hold back as many frames
        self._times: OrderedDict[int | None, tuple[float | None, float]] = OrderedDict()
        self._errors: tuple[type[Exception], ...] = (av.error.FFmpegError, OSError)
        self._pictures = self._decoded(video)

    def read(self, timeout_s: float) -> Picture:  # noqa: ARG002  # FFmpeg has its own
        """The next frame."""
        try:
            return next(self._pictures)
        except StopIteration:
            raise SourceLostError(f"{self._name}: the stream ended") from None
        except self._errors as error:
            raise SourceLostError(f"{self._name}: {_reason(error)}") from None

    def close(self) -> None:
        """Disconnect."""
        self._container.close()

    def _decoded(self, video: Any) -> Iterator[Picture]:
        number = -1
        for packet in self._container.demux(video):
            arrival_s = time.monotonic()
            self._times[packet.pts] = (producer_time_s(packet), arrival_s)
            while len(self._times) > MOST_PENDING:
                self._times.popitem(last=False)
            for frame in self._frames(packet):
                number += 1
                server_s, arrived_s = self._times.pop(frame.pts, (None, arrival_s))
                stamp, clock = self._stamp(server_s, arrived_s)
                yield Picture(frame.to_ndarray(format="bgr24"), stamp, number, clock=clock)

    def _frames(self, packet: Any) -> list[Any]:
        """The frames that leave the decoder with a packet; none where it is damaged: the next key frame is whole."""
        try:
            return list(packet.decode())
        except self._errors:
            return []

    def _stamp(self, server_s: float | None, arrival_s: float) -> tuple[dict[str, float], str]:
        if server_s is None:
            return {"time_monotonic": arrival_s}, "arrival"
        if self._utc:
            return {"time_unix": server_s}, "utc"
        if self._clock.observe(server_s, arrival_s):
            _log.warning("%s: the server's clock was set; the mapping of its stamps begins again", self._name)
        return {"time_monotonic": self._clock.host_from_server(server_s)}, "server"


def producer_time_s(packet: Any) -> float | None:
    """The server's time of a packet, seconds; None where it has none."""
    if not packet.has_sidedata(PRODUCER_TIME):
        return None
    data = bytes(packet.get_sidedata(PRODUCER_TIME))
    return struct.unpack_from("<q", data)[0] / 1e6 if len(data) >= 8 else None


def _reason(error: Exception) -> str:
    text = getattr(error, "strerror", None) or str(error) or type(error).__name__
    return str(text).splitlines()[0]
