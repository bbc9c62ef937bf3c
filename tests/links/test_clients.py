"""A UDP server's memory of its clients, with invented times."""

from fwav_companion.links.udp import CLIENT_SILENT_S, MAX_CLIENTS, Clients


def test_the_longest_silent_makes_room():
    clients = Clients()
    for port in range(MAX_CLIENTS):
        clients.whole_frames(("10.0.0.1", port), b"x", now_s=float(port))
    clients.whole_frames(("10.0.0.1", 0), b"x", now_s=100.0)
    clients.whole_frames(("10.0.0.2", 99), b"x", now_s=101.0)
    assert len(list(clients)) == MAX_CLIENTS
    assert ("10.0.0.1", 0) in clients
    assert ("10.0.0.1", 1) not in clients
    assert ("10.0.0.2", 99) in clients


def test_silent_clients_are_forgotten_and_learned_again():
    clients = Clients()
    clients.whole_frames("a", b"x", now_s=0.0)
    clients.whole_frames("b", b"x", now_s=1.0)
    clients.forget_silent(CLIENT_SILENT_S)
    assert list(clients) == ["a", "b"]
    clients.forget_silent(CLIENT_SILENT_S + 0.5)
    assert list(clients) == ["b"]
    clients.whole_frames("a", b"x", now_s=CLIENT_SILENT_S + 1.0)
    assert list(clients) == ["b", "a"]


def test_a_lone_client_is_passed_on_as_it_sends_and_several_in_whole_frames():
    begun = bytes([0xFE, 9, 0])
    clients = Clients()
    assert clients.whole_frames("a", begun, now_s=0.0) == begun
    assert clients.whole_frames("b", begun, now_s=0.0) == b""
    assert clients.whole_frames("a", begun, now_s=0.0) == b""
