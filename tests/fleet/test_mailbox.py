"""Messages of a fleet that wait: who gets a turn, and what is dropped."""

from __future__ import annotations

import pytest

from fwav_companion.fleet.mailbox import OVERHEAD_BYTES, Mailbox

KNOWN = {"1", "2", "3"}
SIZE = 1000 + OVERHEAD_BYTES


def filled(mail: Mailbox, vehicle: str, count: int) -> None:
    for number in range(count):
        mail.put(vehicle, "tracks", number.to_bytes(2, "big") * 500)


def served(mail: Mailbox, count: int) -> list[str]:
    return [message[0] for _ in range(count) if (message := mail.take()) is not None]


def test_messages_of_a_vehicle_are_served_in_their_order():
    mail = Mailbox(KNOWN.__contains__)
    assert not mail
    filled(mail, "1", 3)
    assert mail
    assert [mail.take()[2][:2] for _ in range(3)] == [b"\0\0", b"\0\1", b"\0\2"]
    assert mail.take() is None
    assert mail.total_bytes == 0


def test_a_vehicle_that_floods_delays_no_other_by_more_than_one_message():
    mail = Mailbox(KNOWN.__contains__)
    filled(mail, "1", 1000)
    filled(mail, "2", 2)
    assert served(mail, 5) == ["1", "2", "1", "2", "1"]


def test_what_is_too_much_is_dropped_from_the_one_that_holds_most():
    mail = Mailbox(KNOWN.__contains__, most_bytes=100 * SIZE)
    filled(mail, "1", 3)
    filled(mail, "2", 1000)
    assert mail.total_bytes <= 100 * SIZE
    assert mail.dropped >= 900
    assert served(mail, 6).count("1") == 3


@pytest.mark.parametrize("length", [8, 60_000])
def test_invented_names_share_one_turn_and_the_bounded_bytes(length: int):
    mail = Mailbox(KNOWN.__contains__, most_bytes=100 * SIZE)
    filled(mail, "1", 2)
    for number in range(5000):
        mail.put(f"{number:0{length}d}", "state", b"{}")
    assert mail.total_bytes <= 100 * SIZE
    assert "1" in served(mail, 2)
    assert "1" in served(mail, 2)
