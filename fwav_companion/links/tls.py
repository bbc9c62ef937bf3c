"""TLS links: a client of one server, such as a TAK server. The server is always verified.

asyncio does the handshake. Chunks wait in a bounded queue of this link, not in asyncio's, which has no bound: a server
that accepts and never reads is reported, and costs a fixed amount of memory.
"""

from __future__ import annotations

import asyncio
import socket
import ssl
from collections import deque
from datetime import UTC, datetime
from typing import Final

from fwav_companion.addresses import resolve
from fwav_companion.errors import LinkError
from fwav_companion.fair_queues import Origin
from fwav_companion.links.base import Connection, LinkReceiver
from fwav_companion.links.tcp import CONNECT_WAIT_S, QUEUE_BYTES, connected
from fwav_companion.links.url import TlsUrl
from fwav_companion.types.network_status import LinkReport

HANDSHAKE_WAIT_S: Final = 10.0
"""Longest handshake: two round trips, over the slowest radio in use."""
STALLED_S: Final = 20.0
"""Time without room in the buffers after which a server that does not read is given up."""
BUFFER_BYTES: Final = 16_384
"""Bytes in asyncio's buffer at which chunks wait in the queue instead."""

EXPIRED, NOT_YET_VALID, OTHER_HOST, OTHER_ADDRESS = 10, 9, 62, 64
UNKNOWN_AUTHORITY: Final = frozenset({2, 18, 19, 20, 21})
"""OpenSSL's codes X509_V_ERR_..., as SSLCertVerificationError.verify_code has them."""

ALERTS: Final = (
    ("CERTIFICATE_REQUIRED", "the server demands a client certificate: set cot_client_cert"),
    ("CERTIFICATE_EXPIRED", "the server says that this unit's certificate expired: get a new one"),
    ("CERTIFICATE_REVOKED", "the server says that this unit's certificate was revoked: get a new one"),
    ("UNKNOWN_CA", "the server does not know the authority of this unit's certificate: get one from its operator"),
    ("BAD_CERTIFICATE", "the server refuses this unit's certificate: get one from its operator"),
    ("CERTIFICATE_UNKNOWN", "the server refuses this unit's certificate: get one from its operator"),
    ("HANDSHAKE_FAILURE", "the server refuses the handshake: it may demand a client certificate, cot_client_cert"),
    ("WRONG_VERSION_NUMBER", "the server does not speak TLS on this port: use tcpout://, or another port"),
)
"""Parts of OpenSSL's reasons, and what they mean here."""


class TlsClientOpener:
    """Connects to one server."""

    def __init__(self, url: TlsUrl, context: ssl.SSLContext, server_name: str) -> None:
        """``server_name``: the name expected in the server's certificate."""
        self._url = url
        self._context = context
        self._name = server_name or url.host

    async def open(self, receiver: LinkReceiver) -> Connection:
        """A verified stream to the first of the host's addresses that accepts. LinkError in words, or OSError."""
        failure: OSError | LinkError = LinkError("no address")
        for family, address in await resolve(self._url.host, self._url.port, socket.SOCK_STREAM):
            try:
                sock = await connected(family, address)
            except TimeoutError:
                failure = LinkError(f"no answer within {CONNECT_WAIT_S:g} s")
            except OSError as error:
                failure = error
            else:
                return await self._shake_hands(sock, receiver)
        raise failure

    def close(self) -> None:
        """Nothing is under way between two tries."""

    async def _shake_hands(self, sock: socket.socket, receiver: LinkReceiver) -> Connection:
        loop, stream = asyncio.get_running_loop(), TlsStream(receiver, self._name)
        try:
            await loop.create_connection(
                lambda: stream,
                sock=sock,
                ssl=self._context,
                server_hostname=self._name,
                ssl_handshake_timeout=HANDSHAKE_WAIT_S,
            )
        except ssl.SSLError as error:
            raise LinkError(fault_text(error, self._name)) from None
        except TimeoutError:
            raise LinkError(f"no TLS handshake within {HANDSHAKE_WAIT_S:g} s") from None
        except ConnectionError as error:
            if "handshake" in str(error):  # asyncio's text where the server is silent
                raise LinkError(f"no TLS handshake within {HANDSHAKE_WAIT_S:g} s") from None
            raise
        finally:
            if stream.transport is None:
                sock.close()
        return stream


class TlsStream(asyncio.Protocol):
    """One connected stream to a server."""

    def __init__(self, receiver: LinkReceiver, server_name: str) -> None:
        self._receiver = receiver
        self._name = server_name
        self._waiting: deque[bytes] = deque()
        self._waiting_bytes = 0
        self._full = False
        self._give_up: asyncio.TimerHandle | None = None
        self._closed = False
        self.transport: asyncio.Transport | None = None
        """The transport; None before the handshake ended."""

    def connection_made(self, transport: asyncio.BaseTransport) -> None:
        """Begin, after the handshake."""
        assert isinstance(transport, asyncio.Transport)  # noqa: S101  # asyncio gives a stream's protocol no other
        transport.set_write_buffer_limits(high=BUFFER_BYTES)
        self.transport = transport

    def data_received(self, data: bytes) -> None:
        """Pass on received bytes: a server's own events must be drained, else it stops to read."""
        self._receiver.on_bytes(data)

    def connection_lost(self, exc: Exception | None) -> None:
        """Report the loss."""
        self._stop_waiting()
        if self._closed:
            return
        if isinstance(exc, ssl.SSLError):
            self._receiver.on_lost(fault_text(exc, self._name))
        else:
            self._receiver.on_lost((isinstance(exc, OSError) and exc.strerror) or "closed by the peer")

    def pause_writing(self) -> None:
        """Queue from here on, and give the server some time to read."""
        self._full = True
        self._give_up = asyncio.get_running_loop().call_later(STALLED_S, self._stalled)

    def resume_writing(self) -> None:
        """Write what waits."""
        self._full = False
        self._stop_waiting()
        while self._waiting and not self._full:
            data = self._waiting.popleft()
            self._waiting_bytes -= len(data)
            self._write(data)

    def send(self, data: bytes, *, origin: Origin | None = None) -> None:  # noqa: ARG002  # all is the service's own
        """Write a whole chunk now, or queue it; a full queue drops its oldest."""
        if not self._full:
            self._write(data)
            return
        self._waiting.append(data)
        self._waiting_bytes += len(data)
        while self._waiting_bytes > QUEUE_BYTES:
            self._waiting_bytes -= len(self._waiting.popleft())
            self._receiver.traffic.dropped += 1

    def poll(self) -> None:
        """Do nothing: asyncio reads."""

    def close(self) -> None:
        """Release the connection at once."""
        self._closed = True
        self._stop_waiting()
        if self.transport is not None:
            self.transport.abort()

    def status(self) -> LinkReport:
        """No further entries."""
        return LinkReport()

    def _write(self, data: bytes) -> None:
        if self.transport is not None and not self.transport.is_closing():
            self.transport.write(data)
            self._receiver.traffic.bytes_out += len(data)

    def _stalled(self) -> None:
        self._receiver.on_lost(f"the server accepts the connection but has read nothing for {STALLED_S:g} s")

    def _stop_waiting(self) -> None:
        if self._give_up is not None:
            self._give_up.cancel()
            self._give_up = None


def fault_text(error: ssl.SSLError, server_name: str) -> str:
    """One line: what is wrong with which certificate, and what to do."""
    if isinstance(error, ssl.SSLCertVerificationError):
        code = error.verify_code
        if code == EXPIRED:
            return f"the server's certificate expired (this board's date: {today()}): its operator must renew it"
        if code == NOT_YET_VALID:
            return f"the server's certificate is not yet valid: this board's date is {today()}; set its clock"
        if code in UNKNOWN_AUTHORITY:
            return "the server's certificate is not signed by the authority of cot_ca: set the server's own"
        if code in (OTHER_HOST, OTHER_ADDRESS):
            return f'the server\'s certificate is not for "{server_name}": set cot_server_name to the name that it has'
        return f"the server's certificate is refused: {error.verify_message}"
    reason = (error.reason or str(error)).upper().replace(" ", "_")
    return next((text for part, text in ALERTS if part in reason), f"TLS: {error.reason or error}")


def today() -> str:
    """Date of this board, UTC."""
    return datetime.now(UTC).strftime("%Y-%m-%d")
