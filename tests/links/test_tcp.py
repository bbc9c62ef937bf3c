"""TCP links over loopback, with plain sockets as peers."""

import asyncio
import contextlib
import socket
from collections.abc import Iterator

import pytest
from link_listening import Listener, run, started, until
from processes import free_port

from fwav_companion.links import places, tcp
from fwav_companion.links.places import MAX_PLACES_OF_HOST as PLACES
from fwav_companion.links.reconnect import make_link
from fwav_companion.links.url import parse_link_url


@pytest.fixture(name="server")
def _server() -> Iterator[socket.socket]:
    with listening() as sock:
        yield sock


def listening(port: int = 0) -> socket.socket:
    sock = socket.socket(socket.AF_INET, socket.SOCK_STREAM)
    sock.setsockopt(socket.SOL_SOCKET, socket.SO_REUSEADDR, 1)
    sock.bind(("127.0.0.1", port))
    sock.listen()
    sock.settimeout(20)
    return sock


async def accepted(server: socket.socket) -> socket.socket:
    sock, _ = await asyncio.to_thread(server.accept)
    sock.settimeout(20)
    return sock


async def received(sock: socket.socket, size: int) -> bytes:
    """The next ``size`` bytes, or fewer at the end of the stream."""

    def read() -> bytes:
        data = b""
        while len(data) < size and (more := sock.recv(size - len(data))):
            data += more
        return data

    return await asyncio.to_thread(read)


def test_a_client_both_ways(server: socket.socket):
    async def story() -> None:
        listener = Listener()
        with started(f"tcpout://127.0.0.1:{server.getsockname()[1]}", listener) as link, await accepted(server) as peer:
            await listener.until_up()
            link.send(b"out")
            assert await received(peer, 3) == b"out"
            peer.sendall(b"in")
            await listener.until(lambda: listener.data == b"in")
            assert link.status().bytes_out == 3

    run(story())


def test_a_server_that_goes_and_comes_back(server: socket.socket):
    async def story() -> None:
        listener, port = Listener(), server.getsockname()[1]
        with started(f"tcpout://127.0.0.1:{port}", listener) as link:
            (await accepted(server)).close()
            server.close()
            await listener.until_down()
            link.send(b"lost")
            with listening(port) as again, await accepted(again) as peer:
                await listener.until_up(times=2)
                link.send(b"back")
                assert await received(peer, 4) == b"back"
            assert listener.states[:3] == [(True, ""), (False, "closed by the peer"), (True, "")]
            assert link.status().dropped == 1

    run(story())


def test_a_server_that_is_not_there_yet_is_reported_once():
    async def story() -> None:
        listener, port = Listener(), free_port()
        with started(f"tcpout://127.0.0.1:{port}", listener):
            await listener.until_down()
            with listening(port) as late, await accepted(late):
                await listener.until_up()
            assert listener.states[:2] == [(False, "Connection refused"), (True, "")]

    run(story())


@contextlib.contextmanager
def silent_server() -> Iterator[int]:
    """The port of a server that answers no connect: Linux drops those that a full backlog has no room for."""
    with contextlib.ExitStack() as stack:
        full = stack.enter_context(socket.socket())
        full.bind(("127.0.0.1", 0))
        full.listen(0)
        for _ in range(4):
            waiting = stack.enter_context(socket.socket())
            waiting.setblocking(False)
            waiting.connect_ex(full.getsockname())
        yield full.getsockname()[1]


def test_a_server_that_answers_nothing_is_given_up(monkeypatch: pytest.MonkeyPatch):
    monkeypatch.setattr(tcp, "CONNECT_WAIT_S", 0.05)

    async def story() -> None:
        listener = Listener()
        with silent_server() as port, started(f"tcpout://127.0.0.1:{port}", listener):
            await listener.until_down()
            assert listener.states == [(False, "no answer within 0.05 s")]

    run(story())


@pytest.mark.parametrize("host", ["127.0.0.1", "::1"])
def test_a_server_with_two_clients(host: str):
    async def story() -> None:
        listener, port = Listener(), free_port()
        url = f"tcpin://[{host}]:{port}" if ":" in host else f"tcpin://{host}:{port}"
        with started(url, listener) as link:
            await listener.until_up()
            link.send(b"nobody is there")
            with socket.create_connection((host, port), 20) as one:
                with socket.create_connection((host, port), 20) as two:
                    one.sendall(b"one")
                    await listener.until(lambda: listener.data == b"one")
                    two.sendall(b"two")
                    await listener.until(lambda: listener.data == b"onetwo")
                    link.send(b"to all")
                    assert await received(one, 6) == b"to all"
                    assert await received(two, 6) == b"to all"
                await until(lambda: len(link.status().clients) == 1)
                link.send(b"to one")
                assert await received(one, 6) == b"to one"
            assert listener.states == [(True, "")]
            assert link.status().dropped == 0

    run(story())


def test_a_servers_clients_are_not_mixed_inside_a_frame_and_bounded():
    frame = bytes([0xFE, 9, 0, 1, 1, 0]) + b"payload!!" + b"cc"

    async def story() -> None:
        listener, port = Listener(), free_port()
        with started(f"tcpin://127.0.0.1:{port}", listener) as link:
            await listener.until_up()
            clients = [socket.create_connection(("127.0.0.1", port), 20) for _ in range(PLACES + 1)]
            await until(lambda: len(link.status().clients) == PLACES)
            assert await received(clients[-1], 1) == b"", "the one too many is sent away"
            for piece in (frame[:5], frame[5:]):
                for client in clients[:-1]:
                    client.sendall(piece)
            await listener.until(lambda: len(listener.data) == PLACES * len(frame))
            assert listener.data == frame * PLACES
            for client in clients:
                client.close()

    run(story())


def test_who_sends_nothing_valid_yields_first_and_who_is_refused_is_reported(monkeypatch: pytest.MonkeyPatch):
    frame = bytes([0xFE, 9, 0, 1, 1, 0]) + b"payload!!" + b"cc"

    async def story() -> None:
        listener, port, refused = Listener(), free_port(), []
        listener.valid = lambda data: data == frame
        url = parse_link_url(f"tcpin://127.0.0.1:{port}")
        link = make_link(
            "a", url, listener.on_bytes, listener.on_state, on_refused=lambda _, peer: refused.append(peer)
        )
        link.start()
        await listener.until_up()
        with contextlib.ExitStack() as stack:
            connect = lambda: stack.enter_context(socket.create_connection(("127.0.0.1", port), 20))  # noqa: E731
            silent = [connect() for _ in range(PLACES)]
            await until(lambda: len(link.status().clients) == PLACES)
            assert await received(connect(), 1) == b"", "every client may still send its first frame"
            assert link.status().refused == 1
            assert len(refused) == 1
            monkeypatch.setattr(places, "YIELDS_AFTER_S", 0.0)
            silent[0].sendall(frame)
            await listener.until(lambda: listener.data == frame)
            genuine = connect()
            assert await received(silent[1], 1) == b"", "the one that is silent for longest"
            link.send(b"to all")
            assert await received(genuine, 6) == b"to all"
            assert await received(silent[0], 6) == b"to all"
        link.close()

    run(story())


@pytest.mark.parametrize("strangers", [["127.0.0.1"], ["127.0.0.1", "127.0.0.3"]])
def test_strangers_of_two_addresses_leave_a_place_for_another_address(strangers: list[str]):
    async def story() -> None:
        listener, port = Listener(), free_port()
        with started(f"tcpin://127.0.0.1:{port}", listener) as link, contextlib.ExitStack() as stack:
            await listener.until_up()

            def connect(host: str) -> socket.socket:
                return stack.enter_context(socket.create_connection(("127.0.0.1", port), 20, source_address=(host, 0)))

            for host in strangers:
                for _ in range(PLACES + 1):
                    connect(host)
                    await asyncio.sleep(0)  # the server accepts
            await until(lambda: int(link.status().refused) >= len(strangers))
            taken = len(link.status().clients)
            station = connect("127.0.0.2")
            await until(lambda: len(link.status().clients) == taken + 1)
            link.send(b"to all")
            assert await received(station, 6) == b"to all"

    run(story())


def test_a_reader_that_stalls_loses_the_oldest_whole_chunks_and_no_more():
    """The peer reads nothing until everything was sent: what it gets then is whole chunks, the newest among them."""

    async def story() -> None:
        listener, port = Listener(), free_port()
        with started(f"tcpin://127.0.0.1:{port}", listener) as link:
            await listener.until_up()
            with socket.socket() as slow:
                slow.setsockopt(socket.SOL_SOCKET, socket.SO_RCVBUF, 4096)
                slow.settimeout(20)
                slow.connect(("127.0.0.1", port))
                await until(lambda: len(link.status().clients) == 1)
                count, size = 3000, 4096
                for i in range(count):
                    link.send(i.to_bytes(4, "big") * (size // 4))
                dropped = int(link.status().dropped)
                assert 0 < dropped < count
                data = await received(slow, (count - dropped) * size)
        chunks = [data[at : at + size] for at in range(0, len(data), size)]
        assert all(chunk == chunk[:4] * (size // 4) for chunk in chunks), "never cut"
        numbers = [int.from_bytes(chunk[:4], "big") for chunk in chunks]
        assert numbers == sorted(numbers)
        assert numbers[-16:] == list(range(count - 16, count)), "the newest"
        assert len(numbers) + dropped == count

    run(story())


def test_closed_while_a_connection_is_being_made_nothing_is_left():
    async def story() -> None:
        listener = Listener()
        with silent_server() as port:
            with started(f"tcpout://127.0.0.1:{port}", listener):
                await asyncio.sleep(0.01)
            await asyncio.sleep(0)
            await asyncio.sleep(0)
            assert asyncio.all_tasks() == {asyncio.current_task()}
            assert listener.states == []

    run(story())
