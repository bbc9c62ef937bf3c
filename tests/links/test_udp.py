"""UDP links over loopback, with plain sockets as peers."""

import asyncio
import errno
import socket
import tracemalloc
from collections.abc import Iterator

import pytest
from link_listening import Listener, run, started, until
from processes import free_port

from fwav_companion.links.base import LinkReceiver, Traffic
from fwav_companion.links.udp import BURST_S, UdpClient, UdpServer


@pytest.fixture(name="peer")
def _peer() -> Iterator[socket.socket]:
    with peer_socket() as sock:
        yield sock


def peer_socket() -> socket.socket:
    sock = socket.socket(socket.AF_INET, socket.SOCK_DGRAM)
    sock.bind(("127.0.0.1", 0))
    sock.settimeout(20)
    return sock


async def received(sock: socket.socket) -> bytes:
    """The next datagram, while the loop goes on."""
    return await asyncio.to_thread(sock.recv, 65536)


@pytest.mark.parametrize("host", ["127.0.0.1", "[::1]"])
def test_a_server_hears_and_answers_all_it_has_heard(host: str):
    async def story() -> None:
        listener, port = Listener(), free_port()
        family = socket.AF_INET6 if host == "[::1]" else socket.AF_INET
        with (
            started(f"udpin://{host}:{port}", listener) as link,
            socket.socket(family, socket.SOCK_DGRAM) as one,
            socket.socket(family, socket.SOCK_DGRAM) as two,
        ):
            await listener.until_up()
            link.send(b"nobody is there")
            for sock, data in ((one, b"from one"), (two, b"from two")):
                sock.settimeout(20)
                sock.sendto(data, (host.strip("[]"), port))
                await listener.until(lambda data=data: data in listener.data)
            link.send(b"to all")
            assert await received(one) == b"to all"
            assert await received(two) == b"to all"
            status = link.status()
            assert len(status.clients) == 2
            assert all(client.startswith(f"{host}:") for client in status.clients)
            assert (status.bytes_in, status.bytes_out, status.dropped) == (16, 12, 0)

    run(story())


def test_one_byte_subscribes_no_one(peer: socket.socket):
    async def story() -> None:
        listener, port = Listener(), free_port()
        listener.valid = lambda data: data == b"valid"
        with started(f"udpin://127.0.0.1:{port}", listener) as link, peer_socket() as station:
            await listener.until_up()
            peer.sendto(b"x", ("127.0.0.1", port))
            station.sendto(b"valid", ("127.0.0.1", port))
            await listener.until(lambda: len(listener.data) == 6)
            link.send(b"telemetry")
            assert await received(station) == b"telemetry"
            assert link.status().clients == [f"127.0.0.1:{station.getsockname()[1]}"]

    run(story())


def test_a_turn_is_bounded_and_nothing_is_lost(peer: socket.socket):
    async def story() -> None:
        listener, port = Listener(), free_port()
        with started(f"udpin://127.0.0.1:{port}", listener):
            await listener.until_up()
            sent = [bytes([i]) * 512 for i in range(32)]
            for data in sent:
                peer.sendto(data, ("127.0.0.1", port))
            await listener.until(lambda: len(listener.data) == 32 * 512)
            assert listener.data == b"".join(sent)
            assert max(map(len, listener.chunks)) <= 2048, "of the worst bytes, 8 ms"

    run(story())


def test_a_burst_is_drained_whole_and_in_order(peer: socket.socket):
    async def story() -> None:
        listener, port = Listener(), free_port()
        with started(f"udpin://127.0.0.1:{port}", listener):
            await listener.until_up()
            sent = [bytes([i]) * 50 for i in range(200)]
            for data in sent:
                peer.sendto(data, ("127.0.0.1", port))
            await listener.until(lambda: len(listener.data) == 200 * 50)
            assert listener.data == b"".join(sent)
            assert len(listener.chunks) <= 10, "joined, 64 a wake"

    run(story())


class ReadsCounted(socket.socket):
    """Counts the reads."""

    reads = 0

    def recv_into(self, *arguments: object) -> int:
        self.reads += 1
        return super().recv_into(*arguments)


def test_a_datagram_that_comes_alone_is_read_once(peer: socket.socket):
    async def story() -> None:
        heard: list[bytes] = []
        with ReadsCounted(socket.AF_INET, socket.SOCK_DGRAM) as sock:
            sock.setblocking(False)
            sock.bind(("127.0.0.1", 0))
            client = UdpClient(sock, LinkReceiver(lambda data: not heard.append(data), heard.append, Traffic()))
            for count in range(1, 4):
                await asyncio.sleep(2.0 * BURST_S)
                peer.sendto(bytes([count]), sock.getsockname())
                await until(lambda count=count: len(heard) == count)
            client.close()
            assert heard == [b"\1", b"\2", b"\3"]
            assert sock.reads == 3

    run(story())


@pytest.mark.parametrize("kind", [UdpClient, UdpServer])
def test_a_read_allocates_what_came_and_not_the_largest_datagram(peer: socket.socket, kind: type):
    """In a flood the holes of larger allocations fragment the heap."""

    async def story() -> None:
        heard: list[bytes] = []
        with socket.socket(socket.AF_INET, socket.SOCK_DGRAM) as sock:
            sock.setblocking(False)
            sock.bind(("127.0.0.1", 0))
            link = kind(sock, LinkReceiver(lambda data: not heard.append(data), heard.append, Traffic()))
            for _ in range(20):
                peer.sendto(b"x" * 1000, sock.getsockname())
            tracemalloc.start()
            try:
                for _ in range(20):  # each reads one datagram at the least
                    link.poll()
                peak = tracemalloc.get_traced_memory()[1]
            finally:
                tracemalloc.stop()
            link.close()
        assert len(b"".join(heard)) == 20_000
        assert peak < 65_536

    run(story())


def test_a_server_on_a_taken_port_waits_for_it(peer: socket.socket):
    async def story() -> None:
        listener, port = Listener(), peer.getsockname()[1]
        with started(f"udpin://127.0.0.1:{port}", listener):
            await listener.until_down()
            assert listener.states == [(False, "Address already in use")]
            peer.close()
            await listener.until_up()

    run(story())


def test_an_address_that_no_interface_has_yet_is_a_link_that_is_down():
    async def story() -> None:
        listener = Listener()
        with started("udpin://192.0.2.1:14550", listener):  # TEST-NET-1: assigned to no host
            await listener.until_down()
            assert listener.states == [(False, "Cannot assign requested address")]

    run(story())


def test_a_client_speaks_first_and_hears_its_peer_alone(peer: socket.socket):
    async def story() -> None:
        listener = Listener()
        with started(f"udpout://127.0.0.1:{peer.getsockname()[1]}", listener) as link, peer_socket() as stranger:
            await listener.until_up()
            link.send(b"hello")
            data, address = await asyncio.to_thread(peer.recvfrom, 100)
            assert data == b"hello"
            stranger.sendto(b"stranger", address)
            peer.sendto(b"answer", address)
            await listener.until(lambda: bool(listener.data))
            assert listener.data == b"answer"

    run(story())


def test_a_peer_that_is_not_there_yet_costs_nothing_but_the_datagrams():
    async def story() -> None:
        listener, port = Listener(), free_port()
        with started(f"udpout://127.0.0.1:{port}", listener) as link:
            await listener.until_up()
            for _ in range(5):
                link.send(b"into the dark")
                await asyncio.sleep(0)
            with socket.socket(socket.AF_INET, socket.SOCK_DGRAM) as late:
                late.bind(("127.0.0.1", port))
                late.settimeout(20)
                link.send(b"the first that counts")
                assert await received(late) == b"the first that counts"
            assert listener.states == [(True, "")]
            assert link.status().dropped == 0

    run(story())


def test_a_broadcast_is_heard_and_answered():
    async def story() -> None:
        listener = Listener()
        with socket.socket(socket.AF_INET, socket.SOCK_DGRAM) as everyone:
            everyone.bind(("0.0.0.0", 0))
            everyone.settimeout(20)
            with started(f"udpbcast://127.255.255.255:{everyone.getsockname()[1]}", listener) as link:
                await listener.until_up()
                link.send(b"who is there")
                data, address = await asyncio.to_thread(everyone.recvfrom, 100)
                assert data == b"who is there"
                everyone.sendto(b"me", address)
                await listener.until(lambda: listener.data == b"me")

    run(story())


def test_a_datagram_that_is_too_long_is_dropped_alone(peer: socket.socket):
    async def story() -> None:
        listener = Listener()
        with started(f"udpout://127.0.0.1:{peer.getsockname()[1]}", listener) as link:
            await listener.until_up()
            link.send(bytes(70_000))
            link.send(b"next")
            assert await received(peer) == b"next"
            assert link.status().dropped == 1
            assert listener.states == [(True, "")]

    run(story())


@pytest.mark.parametrize(
    ("number", "text", "said"),
    [
        (socket.EAI_NONAME, "Name or service not known", "no such host: ground.invalid"),
        (socket.EAI_NODATA, "No address associated with hostname", "no such host: ground.invalid"),
        (
            socket.EAI_AGAIN,
            "Temporary failure in name resolution",
            "ground.invalid cannot be looked up: Temporary failure in name resolution",
        ),
    ],
)
def test_a_name_that_is_not_known_is_a_link_that_is_down_and_says_so_in_words(
    monkeypatch: pytest.MonkeyPatch, number: int, text: str, said: str
):
    def look_up(*_args: object, **_kwargs: object) -> object:
        raise socket.gaierror(number, text)

    monkeypatch.setattr(socket, "getaddrinfo", look_up)

    async def story() -> None:
        listener = Listener()
        with started("udpout://ground.invalid:14550", listener) as link:
            await listener.until_down()
            assert listener.states == [(False, said)]
            assert link.status().why == said

    run(story())


class FailingSocket(socket.socket):
    """A socket whose every send fails."""

    number = 0

    def send(self, *_: object) -> int:
        raise OSError(self.number, "x")


@pytest.mark.parametrize(
    ("number", "ends"),
    [
        (errno.ENETUNREACH, True),
        (errno.ENETDOWN, True),
        (errno.EHOSTUNREACH, False),
        (errno.ENOBUFS, False),
        (errno.EPERM, False),
    ],
)
def test_which_errors_end_a_connection(number: int, ends: bool):
    async def story() -> None:
        lost: list[str] = []
        traffic = Traffic()
        with FailingSocket(socket.AF_INET, socket.SOCK_DGRAM) as sock:
            sock.number = number
            client = UdpClient(sock, LinkReceiver(lambda _data: None, lost.append, traffic))
            client.send(b"x")
            client.close()
        assert bool(lost) == ends
        assert traffic.dropped == 1

    run(story())


def test_frames_of_two_clients_that_send_in_pieces_are_not_mixed():
    frame = bytes([0xFE, 9, 0, 1, 1, 0]) + b"payload!!" + b"cc"

    async def story() -> None:
        listener, port = Listener(), free_port()
        with started(f"udpin://127.0.0.1:{port}", listener) as link, peer_socket() as one, peer_socket() as two:
            await listener.until_up()
            one.sendto(frame, ("127.0.0.1", port))
            two.sendto(frame, ("127.0.0.1", port))
            for i in range(len(frame)):
                for sock in (one, two):
                    sock.sendto(frame[i : i + 1], ("127.0.0.1", port))
            await listener.until(lambda: len(listener.data) == 4 * len(frame))
            assert listener.data == frame * 4
            await until(lambda: link.status().bytes_in == 4 * len(frame))

    run(story())
