"""Signatures in both directions against pymavlink, and the limits of a forger."""

from __future__ import annotations

import io

import pytest
from mavlink_wire import Wire, dialect

from fwav_companion.geometry.stamps import NS_PER_S, HostNs
from fwav_companion.mavlink.wire.codec import frame, pack
from fwav_companion.mavlink.wire.frames import FLAG_SIGNED
from fwav_companion.mavlink.wire.scanner import Scanner
from fwav_companion.mavlink.wire.signing import (
    MAX_STREAMS,
    Signature,
    Signer,
    SigningClock,
    Verifier,
    starting_timestamp,
    timestamp_from_unix_ns,
)

KEY = bytes(range(32))
OTHER_KEY = bytes(32)
NOW = HostNs(5 * NS_PER_S)
MINUTE = 6_000_000
START = 40_000_000_000_000
"""A day in 2027."""


class SignedWire(Wire):
    def __init__(
        self, system: int = 1, component: int = 1, *, key: bytes = KEY, link_id: int = 3, timestamp: int = START
    ):
        super().__init__(system, component)
        self.mav.signing.secret_key = key
        self.mav.signing.link_id = link_id
        self.mav.signing.timestamp = timestamp
        self.mav.signing.sign_outgoing = True


def ours(timestamp: int = START) -> tuple[Signer, Verifier, SigningClock]:
    clock = SigningClock(timestamp)
    return Signer(KEY, 7, clock), Verifier(KEY, clock), clock


def signed_heartbeat(signer: Signer, seq: int = 0) -> bytes:
    fields = {"type": 18, "autopilot": 8, "base_mode": 0, "custom_mode": 0, "system_status": 4}
    definition, payload = pack("HEARTBEAT", fields)
    return signer.sign(frame(definition, payload, 1, 191, seq, FLAG_SIGNED), NOW)


def check(verifier: Verifier, data: bytes, now: HostNs = NOW) -> Signature:
    (raw,) = Scanner().feed(data)
    return verifier.verify(raw.data, raw.system, raw.component, now)


def pymavlink_reader(timestamp: int = START) -> dialect.MAVLink:
    reader = dialect.MAVLink(io.BytesIO())
    reader.robust_parsing = True
    reader.signing.secret_key = KEY
    reader.signing.timestamp = timestamp
    return reader


def accepted_by(reader: dialect.MAVLink, data: bytes) -> bool:
    (message,) = reader.parse_buffer(data)
    return message.get_type() != "BAD_DATA"


def test_signed_frames_are_byte_identical() -> None:
    theirs = SignedWire(1, 191, link_id=7)
    signer, _, _ = ours()
    for seq in range(5):
        assert signed_heartbeat(signer, seq) == theirs.frame("HEARTBEAT", 18, 8, 0, 0, 4, 3)


def test_pymavlink_accepts_ours_and_we_accept_pymavlinks() -> None:
    signer, verifier, _ = ours()
    reader, wire = pymavlink_reader(), SignedWire()
    for seq in range(20):
        assert accepted_by(reader, signed_heartbeat(signer, seq))
        assert check(verifier, wire.attitude()) is Signature.GENUINE


@pytest.mark.parametrize("index", [4, 5, 12, -14, -13, -12, -1])
def test_any_altered_byte_is_a_forgery(index) -> None:
    _, verifier, _ = ours()
    data = bytearray(SignedWire().heartbeat())
    data[index] ^= 0x10
    assert verifier.verify(bytes(data), 1, 1, NOW) is Signature.FORGED


def test_another_key_is_a_forgery() -> None:
    _, verifier, _ = ours()
    assert check(verifier, SignedWire(key=OTHER_KEY).heartbeat()) is Signature.FORGED


def test_a_replay_is_refused_and_so_is_an_older_frame() -> None:
    _, verifier, _ = ours()
    wire = SignedWire()
    first, second = wire.heartbeat(), wire.heartbeat()
    assert check(verifier, second) is Signature.GENUINE
    assert check(verifier, second) is Signature.REPLAYED
    assert check(verifier, first) is Signature.REPLAYED
    assert check(verifier, wire.heartbeat()) is Signature.GENUINE


def test_one_forged_frame_from_the_far_future_locks_pymavlink_out_and_not_us() -> None:
    _, verifier, clock = ours()
    reader = pymavlink_reader()
    wire = SignedWire()
    genuine = [wire.heartbeat() for _ in range(4)]
    forged = SignedWire(key=OTHER_KEY, timestamp=(1 << 48) - 2).heartbeat()

    assert accepted_by(reader, genuine[0])
    assert not accepted_by(reader, forged)
    assert not accepted_by(reader, genuine[1])  # pymavlink 2.4.50 took the forged timestamp before it saw the forgery

    assert check(verifier, genuine[0]) is Signature.GENUINE
    assert check(verifier, forged) is Signature.FORGED
    assert [check(verifier, data) for data in genuine[1:]] == [Signature.GENUINE] * 3
    assert clock.timestamp < START + MINUTE


def test_a_forged_first_frame_makes_no_stream() -> None:
    _, verifier, _ = ours()
    for component in range(1, 200):
        assert check(verifier, SignedWire(1, component, key=OTHER_KEY).heartbeat()) is Signature.FORGED
    assert check(verifier, SignedWire().heartbeat()) is Signature.GENUINE


def test_a_new_stream_may_be_a_minute_behind_us_and_no_more() -> None:
    _, verifier, _ = ours()
    assert check(verifier, SignedWire(1, 1, timestamp=START - MINUTE).heartbeat()) is Signature.GENUINE
    assert check(verifier, SignedWire(1, 2, timestamp=START - MINUTE - 1).heartbeat()) is Signature.OUTDATED


def test_our_timestamp_is_the_greatest_genuine_one_and_grows_with_every_frame() -> None:
    signer, verifier, clock = ours()
    ahead = START + 5 * MINUTE
    check(verifier, SignedWire(timestamp=ahead).heartbeat())
    assert clock.timestamp == ahead
    stamps = [int.from_bytes(signed_heartbeat(signer)[-12:-6], "little") for _ in range(3)]
    assert stamps == [ahead, ahead + 1, ahead + 2]


def test_our_timestamp_grows_with_host_time() -> None:
    clock = SigningClock(START)
    clock.tick(NOW)
    assert clock.tick(HostNs(NOW + 60 * NS_PER_S)) == START + MINUTE
    for i in range(1, 100):  # less than a unit at a time adds up
        clock.tick(HostNs(NOW + 60 * NS_PER_S + i * 9_999))
    assert clock.timestamp == START + MINUTE + 98


def test_streams_are_distinguished_by_link_id_and_component() -> None:
    _, verifier, _ = ours()
    wires = [SignedWire(1, 1, link_id=1), SignedWire(1, 1, link_id=2), SignedWire(1, 2, link_id=1)]
    assert [check(verifier, wire.heartbeat()) for wire in wires] == [Signature.GENUINE] * 3


def test_at_most_so_many_streams_and_those_long_behind_make_room() -> None:
    _, verifier, _ = ours()
    for number in range(MAX_STREAMS):
        assert check(verifier, SignedWire(1 + number // 16, 1 + number % 16).heartbeat()) is Signature.GENUINE
    late = SignedWire(1, 100, timestamp=START + 10)
    assert check(verifier, late.heartbeat()) is Signature.TOO_MANY_STREAMS
    later = HostNs(NOW + 61 * NS_PER_S)
    newcomer = SignedWire(1, 101, timestamp=START + 61 * 100_000)
    assert check(verifier, newcomer.heartbeat(), later) is Signature.GENUINE
    assert check(verifier, SignedWire(1, 1, timestamp=START + 5).heartbeat(), later) is Signature.OUTDATED


def test_the_greatest_timestamp_is_no_crash() -> None:
    signer, verifier, clock = ours()
    assert check(verifier, SignedWire(timestamp=(1 << 48) - 1).heartbeat()) is Signature.GENUINE
    assert clock.timestamp == (1 << 48) - 1
    signed_heartbeat(signer)


def test_a_restart_goes_on_ahead_of_all_that_was_sent() -> None:
    unix_ns = 1_800_000_000 * NS_PER_S
    wall = (1_800_000_000 - 1_420_070_400) * 100_000
    for synchronised in (False, True):
        assert starting_timestamp(None, unix_ns, synchronised=synchronised) == wall == timestamp_from_unix_ns(unix_ns)
        assert starting_timestamp(2 * wall, unix_ns, synchronised=synchronised) == 2 * wall + 1
    assert starting_timestamp(wall // 2, unix_ns, synchronised=True) == wall
    assert starting_timestamp(wall // 2, unix_ns, synchronised=False) == wall // 2 + 1, (
        "the wall clock may be ahead of UTC"
    )
    assert timestamp_from_unix_ns(0) == 0


def test_a_timestamp_ahead_of_utc_waits_until_utc_has_caught_up() -> None:
    unix_ns = 1_800_000_000 * NS_PER_S
    clock = SigningClock(timestamp_from_unix_ns(unix_ns) + MINUTE)
    clock.follow(unix_ns, NOW)
    assert clock.ahead_s(NOW) == pytest.approx(60.0)
    stamps = [clock.next(HostNs(NOW + second * NS_PER_S)) for second in range(60)]
    assert stamps == [stamps[0] + number for number in range(60)], "greater than the last, and no more"
    later = HostNs(NOW + 90 * NS_PER_S)
    assert clock.tick(later) == timestamp_from_unix_ns(unix_ns + 90 * NS_PER_S)
    assert clock.ahead_s(later) == 0.0


def test_time_does_not_carry_the_timestamp_beyond_what_is_reserved() -> None:
    clock = SigningClock(START)
    clock.limit = START + 1000
    clock.tick(NOW)
    assert clock.next(HostNs(NOW + NS_PER_S)) == START + 1000
    assert clock.next(HostNs(NOW + NS_PER_S)) == START + 1001


def test_without_utc_time_goes_on_from_a_peers_timestamp() -> None:
    clock = SigningClock(START)
    clock.tick(NOW)
    clock.learn(START + 10 * MINUTE)
    clock.tick(NOW)
    assert clock.tick(HostNs(NOW + 60 * NS_PER_S)) == START + 11 * MINUTE
