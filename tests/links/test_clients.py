"""A UDP server's peers, with invented times: who subscribes, who is refused, who yields."""

from mavlink_wire import Wire

from fwav_companion.links.places import MAX_PLACES, MAX_PLACES_OF_HOST, YIELDS_AFTER_S
from fwav_companion.links.udp_clients import CLIENT_SILENT_S, MAX_STRANGERS, Clients

STATION = ("10.0.0.1", 14550)


def test_bytes_alone_subscribe_no_one():
    clients = Clients()
    clients.whole_frames(STATION, b"x")
    assert list(clients) == []
    assert clients.on_valid(STATION, 0.0)
    assert list(clients) == [STATION]


def test_flood_of_ports_takes_no_place_of_another_address():
    clients = Clients()
    clients.on_valid(STATION, 0.0)
    for port in range(500):
        clients.whole_frames(("10.0.0.66", port), bytes(4))
        clients.on_valid(("10.0.0.66", port), 1.0 + 0.01 * port)
    assert STATION in clients
    assert sum(host == "10.0.0.66" for host, _ in clients) == MAX_PLACES_OF_HOST
    assert clients.refused == 500 - MAX_PLACES_OF_HOST


def test_nine_ports_of_one_address_leave_the_client_that_is_heard_in_its_place():
    clients, rivals = Clients(), [("10.0.0.1", 20_000 + k) for k in range(9)]
    served = []
    for second in range(60):
        for address in (*rivals, STATION) if second > 5 else (STATION,):
            clients.on_valid(address, second + (0.0 if address == STATION else 0.5))
        served.append(STATION in clients)
    assert all(served)
    assert [rival in clients for rival in rivals] == [True] * 7 + [False] * 2, "among newcomers the newest waits"


def test_silent_client_yields_to_a_newcomer_of_its_own_address_after_ten_seconds():
    clients = Clients()
    for port in range(MAX_PLACES_OF_HOST):
        clients.on_valid(("10.0.0.66", port), float(port == 3))
    late = ("10.0.0.66", 99)
    assert not clients.on_valid(late, YIELDS_AFTER_S - 0.1)
    assert clients.on_valid(late, YIELDS_AFTER_S + 0.1)
    assert ("10.0.0.66", 3) in clients
    assert len(list(clients)) == MAX_PLACES_OF_HOST


def test_last_place_is_kept_for_an_address_that_has_none():
    clients = Clients()
    for port in range(MAX_PLACES):
        clients.on_valid((f"10.0.0.{port % 2}", port), 0.0)
    assert len(list(clients)) == MAX_PLACES - 1
    assert clients.on_valid(("10.0.0.9", 14550), 0.0)


def test_when_all_places_are_taken_a_stranger_is_refused_until_silence_frees_one():
    clients = Clients()
    for number in range(MAX_PLACES):
        assert clients.on_valid((f"10.0.1.{number}", 1), float(number))
    assert not clients.on_valid(STATION, 20.0)
    assert clients.refused == 1
    clients.forget_silent(CLIENT_SILENT_S + 0.5)
    assert clients.on_valid(STATION, CLIENT_SILENT_S + 0.5)


def test_only_valid_frames_keep_a_place():
    clients = Clients()
    clients.on_valid(STATION, 0.0)
    clients.on_valid(("10.0.0.2", 1), 1.0)
    clients.whole_frames(STATION, b"noise")
    clients.forget_silent(CLIENT_SILENT_S + 0.5)
    assert list(clients) == [("10.0.0.2", 1)]
    clients.on_valid(STATION, CLIENT_SILENT_S + 1.0)
    assert list(clients) == [("10.0.0.2", 1), STATION]


def test_a_lone_client_is_passed_on_as_it_sends_and_several_in_whole_frames():
    begun = bytes([0xFE, 9, 0])
    clients = Clients()
    clients.on_valid(STATION, 0.0)
    assert clients.whole_frames(STATION, begun) == begun
    assert clients.whole_frames(("10.0.0.2", 1), begun) == b"", "a stranger's begun frame waits"
    assert clients.whole_frames(STATION, begun) == b""


def test_a_bridge_that_cuts_frames_anywhere_is_heard_whole():
    clients, frame = Clients(), Wire(1, 1).attitude()
    passed = b"".join(clients.whole_frames(STATION, frame[i : i + 5]) for i in range(0, len(frame), 5))
    assert passed == frame


def test_strangers_take_no_memory():
    clients = Clients()
    for port in range(5000):
        clients.whole_frames(("10.0.0.66", port), bytes([0xFD, 255, 0]))
    assert len(clients._strangers) <= MAX_STRANGERS
    assert list(clients) == []
