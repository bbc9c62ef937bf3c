"""The node as the service uses it: destinations of our messages, which senders are trusted, and an unchanged relay."""

from __future__ import annotations

import random
from collections.abc import Callable

import pytest
from mavlink_wire import Wire, dialect, parse, unknown_frame

from fwav_companion.errors import EncodeError
from fwav_companion.geometry.stamps import NS_PER_MS, NS_PER_S, HostNs
from fwav_companion.mavlink.router.coalescing import JOINED_BYTES
from fwav_companion.mavlink.router.node import QUIET_NS, LinkPolicy, Node, SigningPolicy
from fwav_companion.mavlink.wire.scanner import Scanner
from fwav_companion.types import Destination, Outgoing

KEY = bytes(range(32))
START = 40_000_000_000_000
LINKS = (
    LinkPolicy("autopilot", "autopilot"),
    LinkPolicy("spare", "autopilot"),
    LinkPolicy("ground", "gcs"),
    LinkPolicy("tablet", "gcs", max_rate_hz={"STATUSTEXT": 1}),
)
NOW = HostNs(10 * NS_PER_S)
HEARTBEAT = {"type": 18, "autopilot": 8, "base_mode": 0, "custom_mode": 0, "system_status": 4}


def heartbeat(to: Destination, component: int = 191, link: str = "") -> Outgoing:
    return Outgoing(name="HEARTBEAT", fields=HEARTBEAT, to=to, component=component, link=link)


def destinations(node: Node, to: Destination, now: HostNs = NOW, link: str = "") -> list[str]:
    return [name for name, _ in node.encode(heartbeat(to, link=link), now)]


@pytest.mark.parametrize("signing", [None, SigningPolicy(key=KEY, timestamp=START)], ids=["unsigned", "signed"])
def test_own_messages_count_in_a_links_budget_by_their_whole_length(signing: SigningPolicy | None) -> None:
    node = Node([LinkPolicy("ground", "gcs", max_bytes_per_s=1e6)], [], signing=signing)
    fields = {"time_boot_ms": 1, "name": "TGT_DIST", "value": 1.5}
    sent = 0
    for step in range(200):
        now = HostNs(NOW + step * 20 * NS_PER_MS)
        outgoing = Outgoing(name="NAMED_VALUE_FLOAT", fields=fields, to=Destination.GROUND_LINKS, component=191)
        sent += sum(len(data) for _, data in node.encode(outgoing, now))
    (link,) = node.statistics(now)
    assert link.thinning.sent_bytes_per_s == pytest.approx(50.0 * sent / 200, rel=0.01)


def test_destinations() -> None:
    node = Node(LINKS, [])
    assert destinations(node, Destination.EVERYONE) == ["autopilot", "spare", "ground", "tablet"]
    assert destinations(node, Destination.GROUND_LINKS) == ["ground", "tablet"]
    assert destinations(node, Destination.REPLY, link="tablet") == ["tablet"]


def test_the_autopilot_is_reached_where_its_system_was_heard() -> None:
    node = Node(LINKS, [])
    node.adopt(5)
    assert destinations(node, Destination.AUTOPILOT) == ["autopilot", "spare"]
    vehicle = Wire(5, 1)
    node.receive("ground", vehicle.heartbeat(), NOW)  # through a radio on the ground link: no way for commands
    assert destinations(node, Destination.AUTOPILOT) == ["autopilot", "spare"]
    node.receive("spare", vehicle.heartbeat(), NOW)
    assert destinations(node, Destination.AUTOPILOT) == ["spare"]


def test_the_ground_is_reached_through_the_autopilot_while_ground_links_are_silent() -> None:
    node = Node(LINKS, [])
    everyone = ["autopilot", "spare", "ground", "tablet"]
    node.receive("autopilot", Wire(255, 190).heartbeat(dialect.MAV_TYPE_GCS, 8), NOW)  # a radio on the autopilot
    node.receive("ground", Wire(1, 154).heartbeat(dialect.MAV_TYPE_GIMBAL, 8), NOW)
    assert destinations(node, Destination.GROUND) == everyone
    node.receive("tablet", Wire(254, 190).heartbeat(dialect.MAV_TYPE_GCS, 8), NOW)
    assert node.hears_ground_station(NOW)
    assert destinations(node, Destination.GROUND) == ["ground", "tablet"]
    assert destinations(node, Destination.GROUND, HostNs(NOW + 4 * NS_PER_S)) == ["ground", "tablet"]
    assert destinations(node, Destination.GROUND, HostNs(NOW + 6 * NS_PER_S)) == everyone


def test_a_link_that_is_down_is_sent_nothing_and_skips_no_number() -> None:
    node = Node(LINKS, [])
    node.link_down("ground")
    assert destinations(node, Destination.GROUND_LINKS) == ["tablet"]
    assert destinations(node, Destination.REPLY, link="ground") == []
    node.link_up("ground")
    ((_, frame), _) = node.encode(heartbeat(Destination.GROUND_LINKS), NOW)
    assert frame[4] == 0


def test_each_component_counts_for_itself_on_each_link() -> None:
    node = Node(LINKS, [])
    sent: dict[tuple[str, int], list[int]] = {}
    rng = random.Random(1)
    for _ in range(1500):
        component = rng.choice((191, 100))
        to = rng.choice(list(Destination))
        for link, frame in node.encode(heartbeat(to, component, "spare"), NOW):
            sent.setdefault((link, component), []).append(frame[4])
    assert len(sent) == 8
    assert all(numbers == [i % 256 for i in range(len(numbers))] for numbers in sent.values())


def test_what_we_send_is_what_pymavlink_would() -> None:
    node = Node(LINKS, [])
    node.adopt(7)
    (_, frame), *_ = node.encode(heartbeat(Destination.EVERYONE), NOW)
    assert frame == Wire(7, 191).frame("HEARTBEAT", 18, 8, 0, 0, 4, 3)


def test_our_own_messages_are_thinned_too() -> None:
    node = Node(LINKS, [])
    outgoing = Outgoing(
        name="STATUSTEXT", fields={"severity": 4, "text": "x"}, to=Destination.GROUND_LINKS, component=191
    )
    sent = [name for i in range(500) for name, _ in node.encode(outgoing, HostNs(NOW + i * 20 * NS_PER_MS))]
    assert sent.count("ground") == 500
    assert sent.count("tablet") == pytest.approx(10, abs=1)


def test_our_own_errors_are_reported() -> None:
    node = Node(LINKS, [])
    with pytest.raises(EncodeError, match="is to go to link 'radio'; there are autopilot, spare, ground, tablet"):
        node.encode(heartbeat(Destination.REPLY, link="radio"), NOW)
    with pytest.raises(EncodeError, match="HEARTBEAT wants"):
        node.encode(Outgoing(name="HEARTBEAT", fields={}, to=Destination.EVERYONE, component=191), NOW)
    with pytest.raises(KeyError):
        Node(LINKS, ["ATTITUD"])


def test_only_what_is_wanted_is_decoded() -> None:
    node = Node(LINKS, ["ATTITUDE"])
    wire = Wire(1, 1)
    received = node.receive("autopilot", wire.heartbeat() + wire.attitude(77) + unknown_frame() + wire.heartbeat(), NOW)
    (message,) = received.messages
    assert (message.name, message.link, message.signed, message.fields.time_boot_ms) == (
        "ATTITUDE",
        "autopilot",
        False,
        77,
    )
    assert [raw.msgid for raw in received.frames] == [0, 30, 0xABCDEF, 0]


def test_an_unknown_frame_before_a_pause_is_forwarded_when_the_line_is_quiet() -> None:
    node = Node(LINKS, [])
    node.receive("autopilot", Wire(1, 1).heartbeat(), NOW)
    assert node.wake_at is None
    assert node.receive("autopilot", unknown_frame(), NOW).forwards == []
    assert node.wake_at == NOW + QUIET_NS
    received = node.on_wake(HostNs(NOW + QUIET_NS))
    assert received.forwards == [(name, unknown_frame()) for name in ("spare", "ground", "tablet")]
    assert [raw.data for raw in received.frames] == [unknown_frame()]
    assert node.wake_at is None


# Which messages are trusted.


class SignedWire(Wire):
    def __init__(self, system: int, component: int, key: bytes = KEY) -> None:
        super().__init__(system, component)
        self.mav.signing.secret_key = key
        self.mav.signing.link_id = 9
        self.mav.signing.timestamp = START
        self.mav.signing.sign_outgoing = True


def signing_node(*accept_unsigned: str) -> Node:
    policy = SigningPolicy(key=KEY, timestamp=START, accept_unsigned=frozenset(accept_unsigned))
    return Node(
        LINKS, ["HEARTBEAT", "ATTITUDE", "COMMAND_LONG", "COMMAND_ACK", "RADIO_STATUS", "PARAM_SET"], signing=policy
    )


def names(node: Node, link: str, *frames: bytes) -> list[str]:
    return [message.name for message in node.receive(link, b"".join(frames), NOW).messages]


def test_with_a_key_unsigned_frames_are_not_read_but_go_to_the_ground() -> None:
    node = signing_node()
    frame = Wire(1, 1).attitude()
    received = node.receive("autopilot", frame, NOW)
    assert received.messages == []
    assert received.forwards == [("ground", frame), ("tablet", frame)]
    assert list(received.frames) == []
    assert node.statistics(NOW)[0].refused_unsigned == 1


def test_signed_frames_are_read_and_say_so() -> None:
    (message,) = signing_node().receive("autopilot", SignedWire(1, 1).attitude(), NOW).messages
    assert message.signed


def test_forged_frames_go_to_the_ground_and_replayed_ones_nowhere() -> None:
    node = signing_node()
    genuine = SignedWire(1, 1).attitude()
    forged = SignedWire(1, 1, key=bytes(32)).attitude(2)
    assert names(node, "autopilot", genuine) == ["ATTITUDE"]
    received = node.receive("autopilot", forged + genuine, NOW)
    assert received.messages == []
    assert received.forwards == [(name, forged) for name in ("ground", "tablet")]
    statistics = node.statistics(NOW)[0]
    assert (statistics.refused_signatures, statistics.late_copy) == (1, 1)


def test_unsigned_telemetry_is_read_where_the_configuration_says_so() -> None:
    node = signing_node("autopilot")
    wire = Wire(1, 1)
    assert names(node, "autopilot", wire.heartbeat(), wire.attitude()) == ["HEARTBEAT", "ATTITUDE"]
    assert names(node, "autopilot", wire.frame("COMMAND_ACK", 511, 0, 0, 0, 1, 191)) == ["COMMAND_ACK"]
    assert names(node, "ground", Wire(255, 190).heartbeat(6, 8)) == []


@pytest.mark.parametrize("target", [(1, 191), (1, 0), (0, 0)])
def test_what_asks_something_of_us_must_be_signed(target) -> None:
    node = signing_node("autopilot", "ground")
    ground = Wire(255, 190)
    parameter = ground.frame("PARAM_SET", *target, b"X", 1.0, 9)
    assert names(node, "ground", ground.command(*target), parameter) == []
    signed = SignedWire(255, 190)
    assert names(node, "ground", signed.command(*target)) == ["COMMAND_LONG"]


def test_a_radio_cannot_sign() -> None:
    assert names(signing_node(), "ground", Wire(51, 68).frame("RADIO_STATUS", 1, 2, 3, 4, 5, 6, 7)) == ["RADIO_STATUS"]


def test_an_unsigned_ground_station_does_not_silence_the_way_through_the_autopilot() -> None:
    node = signing_node()
    node.receive("ground", Wire(255, 190).heartbeat(6, 8), NOW)
    assert not node.hears_ground_station(NOW)
    node.receive("ground", SignedWire(255, 190).heartbeat(6, 8), NOW)
    assert node.hears_ground_station(NOW)


def test_with_a_key_all_of_ours_is_signed_under_a_link_id_for_each_link() -> None:
    node = signing_node()
    frames = node.encode(heartbeat(Destination.EVERYONE), NOW)
    assert [frame[2] for _, frame in frames] == [1] * 4
    assert [frame[-13] for _, frame in frames] == [0, 1, 2, 3]
    assert [message.get_type() for _, frame in frames for message in parse(frame)] == ["HEARTBEAT"] * 4
    assert node.signing_clock is not None
    assert node.signing_clock.timestamp == START + 4


# The relay changes no byte on any wire.

Wire_ = Callable[[bytes, random.Random], list[bytes]]


def whole(data: bytes, rng: random.Random) -> list[bytes]:
    return [data]


def byte_by_byte(data: bytes, rng: random.Random) -> list[bytes]:
    return [data[i : i + 1] for i in range(len(data))]


def in_pieces(data: bytes, rng: random.Random) -> list[bytes]:
    pieces = []
    while data:
        size = rng.randint(1, 90)
        pieces.append(data[:size])
        data = data[size:]
    return pieces


def with_noise(data: bytes, rng: random.Random) -> list[bytes]:
    return [bytes(rng.choices(range(0xFD), k=rng.randint(0, 20))), data]


@pytest.mark.parametrize("wire", [whole, byte_by_byte, in_pieces, with_noise])
def test_every_frame_that_must_pass_passes_once_in_order_and_unchanged(wire: Wire_) -> None:
    """Two ground stations and a vehicle of two components on four links: five minutes of events in compressed time."""
    rng = random.Random(11)
    node = Node(LINKS, ["HEARTBEAT", "ATTITUDE"])
    node.adopt(1)
    speakers = {"autopilot": [Wire(1, 1), Wire(1, 154)], "ground": [Wire(255, 190)], "tablet": [Wire(254, 190)]}
    homes = {"autopilot": [1, 154], "ground": [], "tablet": []}
    expected: dict[str, list[bytes]] = {link.name: [] for link in LINKS}
    got: dict[str, list[bytes]] = {link.name: [] for link in LINKS}
    now = NOW

    def say(link: str, frame: bytes, targets: list[str]) -> None:
        for target in targets:
            expected[target].append(frame)
        for piece in wire(frame, rng):
            for name, data in node.receive(link, piece, now).forwards:
                got[name].append(data)

    for second in range(300):
        for link, wires in speakers.items():
            others = [policy.name for policy in LINKS if policy.name != link]
            for speaker in wires:
                now = HostNs(now + 200 * NS_PER_MS)
                kind = 6 if link != "autopilot" else 16
                say(link, speaker.heartbeat(kind), others)
                if link == "autopilot":
                    say(link, speaker.attitude(second), others)
                elif second > 0:
                    say(link, speaker.command(1, rng.choice(homes["autopilot"])), ["autopilot"])
                    say(link, speaker.command(1, 0), ["autopilot"])
                    say(link, speaker.command(1, 77), [])
                    say(link, speaker.frame("PARAM_REQUEST_LIST", 1, 1), ["autopilot"])
    assert got == expected


def test_a_lossy_wire_loses_its_own_frames_and_no_others() -> None:
    rng = random.Random(12)
    node = Node(LINKS, [])
    vehicle = Wire(1, 1)
    stream, wanted = [], []
    for i in range(5000):
        frame = vehicle.attitude(i)
        if rng.random() < 0.1:
            spoilt = bytearray(frame)
            spoilt[rng.randrange(len(frame))] ^= rng.randrange(1, 256)
            stream.append(bytes(spoilt))
        else:
            stream.append(frame)
            wanted.append(frame)
    data = b"".join(stream) + vehicle.heartbeat()
    got = b""
    for i in range(0, len(data), 256):
        received = node.receive("autopilot", data[i : i + 256], HostNs(NOW + i * 100_000))
        got += b"".join(frames for name, frames in received.forwards if name == "ground")
    rest = iter(Scanner().feed(got))
    assert all(any(frame == other.data for other in rest) for frame in wanted)
    assert node.statistics(HostNs(NOW + len(data) * 100_000))[0].bad_checksums > 200


def test_what_comes_together_goes_on_together_in_whole_frames_and_datagrams_that_are_not_too_long() -> None:
    node = Node(LINKS, [])
    vehicle = Wire(1, 1)
    frames = [vehicle.attitude(i) for i in range(100)]
    received = node.receive("autopilot", b"".join(frames), NOW)
    sent = [data for name, data in received.forwards if name == "ground"]
    assert b"".join(sent) == b"".join(frames)
    assert all(len(data) <= JOINED_BYTES and len(data) % len(frames[0]) == 0 for data in sent)
    assert len(sent) == 4
    assert node.receive("autopilot", frames[0][:3], NOW).forwards == []
