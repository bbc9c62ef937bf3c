"""Places of a server's peers, with invented times: who gets one, who is refused, who yields."""

import pytest

from fwav_companion.links.places import MAX_PLACES, MAX_PLACES_OF_HOST, YIELDS_AFTER_S, Places


class Server:
    """A server whose peers are numbered, and which lists those that yielded."""

    def __init__(self, silent_s: float = YIELDS_AFTER_S) -> None:
        self.yielded: list[int] = []
        self.places = Places[int](self.yielded.append, silent_s=silent_s)
        self.hosts: dict[int, str] = {}

    def connect(self, host: str, now_s: float, count: int = 1) -> list[int]:
        """The newcomers that got a place."""
        taken = []
        for _ in range(count):
            peer = len(self.hosts)
            self.hosts[peer] = host
            taken += [peer] if self.places.take(peer, host, now_s) else []
        return taken

    def close(self, *hosts: str) -> None:
        for peer in [each for each, place in self.places.of.items() if place.host in hosts]:
            del self.places.of[peer]


@pytest.mark.parametrize("strangers", [2, 3, 5])
@pytest.mark.parametrize("pause_s", [1.0, 9.5])
def test_addresses_that_connect_again_and_again_leave_a_place_for_another(strangers: int, pause_s: float):
    """The station comes while all strangers are there, sends a heartbeat a second, and is never displaced."""
    server, again = Server(), [f"10.0.0.{k}" for k in range(strangers)]
    station: list[int] = []
    for k in range(20):
        now = k * pause_s
        server.close(*again)
        for host in again:
            server.connect(host, now, 20)
        assert len(server.places.of) <= MAX_PLACES
        station = station or server.connect("10.0.1.1", now + 0.1)
        for peer in station:
            server.places.of[peer].heard_s = now + 0.1
    (peer,) = station
    assert peer in server.places.of


def test_peer_that_is_there_and_heard_for_ten_seconds_yields_to_no_newcomer():
    server = Server()
    there = [peer for k in range(3) for peer in server.connect(f"10.0.0.{k}", 0.0, 20)]
    assert len(there) == MAX_PLACES
    for peer in there:
        server.places.of[peer].heard_s = YIELDS_AFTER_S
    assert server.connect("10.0.1.1", YIELDS_AFTER_S) == []
    assert list(server.places.of) == there


def test_newest_of_the_address_with_most_places_yields_to_an_address_that_has_none():
    server = Server()
    first = server.connect("10.0.0.1", 0.0, 20)
    assert len(first) == MAX_PLACES_OF_HOST
    server.connect("10.0.0.2", 1.0, 20)
    server.connect("10.0.0.3", 2.0)
    assert len(server.places.of) == MAX_PLACES
    assert server.connect("10.0.0.4", 3.0) != []
    assert server.yielded == first[-1:]
    assert server.connect("10.0.0.4", 3.0) == [], "an address that has a place takes none from another"


def test_addresses_with_one_place_each_yield_nothing():
    server = Server()
    for k in range(MAX_PLACES):
        server.connect(f"10.0.0.{k}", 0.0)
    assert server.connect("10.0.1.1", 1.0) == []
    assert server.connect("10.0.1.1", YIELDS_AFTER_S) != [], "the silent ones do"
    assert server.yielded == [0]
