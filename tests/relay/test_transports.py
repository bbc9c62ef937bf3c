"""The daemon as a relay between every kind of link, over good and bad wires: byte for byte."""

import random
from collections.abc import Callable, Iterator
from pathlib import Path

import pytest
from mavlink_wire import Wire, unknown_frame
from processes import Process, process
from wire_peers import Peer, peer_of

KINDS = ("udpin", "udpout", "tcpin", "tcpout", "serial")
PAIRS = [(kind, "udpout") for kind in KINDS] + [("udpin", kind) for kind in (*KINDS, "udpbcast") if kind != "udpout"]
STATION = (255, 190)


def from_vehicle(rng: random.Random) -> list[bytes]:
    """Frames of a vehicle: known and unknown, signed, both versions, long and short, to all and to the station."""
    plain, old, signed = Wire(1, 1), Wire(1, 2, version=1), Wire(1, 3)
    signed.mav.signing.secret_key = bytes(32)
    signed.mav.signing.sign_outgoing = True
    frames = [old.heartbeat(), plain.heartbeat(), signed.heartbeat()]
    for index in range(20):
        frames += [
            plain.attitude(index),
            signed.attitude(index),
            old.attitude(index),
            unknown_frame(payload=rng.randbytes(index), seq=index),
            plain.frame("COMMAND_ACK", 400, index, 0, 0, *STATION),
            plain.frame("FILE_TRANSFER_PROTOCOL", 0, *STATION, rng.randbytes(251)),
        ]
    return [*frames, plain.heartbeat()]


def from_station(rng: random.Random) -> list[bytes]:
    """Frames of a station: to all, to the autopilot by name, and to the vehicle as a whole."""
    wire = Wire(*STATION)
    frames = [wire.heartbeat(6, 8)]
    for index in range(20):
        frames += [
            wire.command(1, 1, command=index),
            wire.frame("PARAM_REQUEST_READ", 1, 0, b"PLND_LAG", index),
            unknown_frame(payload=rng.randbytes(index), seq=index, system=STATION[0]),
            wire.frame("FILE_TRANSFER_PROTOCOL", 0, 1, 1, rng.randbytes(251)),
        ]
    return [*frames, wire.heartbeat(6, 8)]


Send = Callable[[Peer, Peer, list[bytes], random.Random], list[bytes]]
"""Sends frames from the first peer while the second listens; returns the frames that arrive complete."""


def frame_by_frame(near: Peer, far: Peer, frames: list[bytes], _: random.Random) -> list[bytes]:
    for frame in frames:
        near.send(frame)
        far.listen(0.0005)  # a UDP socket's buffer is too small to queue frames
    return frames


def is_unknown(frame: bytes) -> bool:
    return frame[0] == 0xFD and frame[7:10] == b"\xef\xcd\xab"


def byte_by_byte(near: Peer, far: Peer, frames: list[bytes], _: random.Random) -> list[bytes]:
    """The first few frames and the last, byte by byte: a datagram a byte is slow.

    One frame is in transit at a time: the socket of a daemon that waits for the processor holds 277 datagrams. A frame
    of an unknown id leaves when the next begins.
    """
    few = [*frames[:8], frames[-1]]
    for before, frame in enumerate(few):
        far.wait_for(before - (before > 0 and is_unknown(few[before - 1])))
        for index, byte in enumerate(frame):
            near.send(bytes((byte,)))
            if index % 32 == 0:
                far.listen(0.001)
    return few


def in_pieces_with_pauses(near: Peer, far: Peer, frames: list[bytes], rng: random.Random) -> list[bytes]:
    data = b"".join(frames)
    while data:
        size = rng.choice((1, 7, 100, 1000))
        near.send(data[:size])
        data = data[size:]
        far.listen(0.002)
    return frames


def with_losses_and_errors(near: Peer, far: Peer, frames: list[bytes], rng: random.Random) -> list[bytes]:
    """Every fourth frame is lost, cut short or changed. Errors in unknown ids cannot be detected, so there are none.

    The last frames stay intact: after one that was cut short, others wait until its full length of bytes has arrived.
    """
    known = [frame for frame in frames if not is_unknown(frame)]
    whole = []
    for index, frame in enumerate(known):
        fate = index // 4 % 3 if index % 4 == 2 and index < len(known) - 8 else None
        if fate == 0:
            continue
        if fate == 1:
            frame = frame[: rng.randrange(1, len(frame))]
        elif fate == 2:
            at = rng.randrange(len(frame) - 2 if frame[0] == 0xFE else 8)
            frame = frame[:at] + bytes((frame[at] ^ 0x10,)) + frame[at + 1 :]
        else:
            whole.append(frame)
        near.send(frame)
        far.listen(0.0005)
    return whole


WIRES: dict[str, Send] = {
    "frame by frame": frame_by_frame,
    "byte by byte": byte_by_byte,
    "in pieces, with pauses": in_pieces_with_pauses,
    "with losses and errors": with_losses_and_errors,
}


@pytest.fixture(params=PAIRS, ids=lambda pair: f"{pair[0]} to {pair[1]}")
def relay(request, tmp_path: Path) -> Iterator[tuple[Process, Peer, Peer]]:
    """The daemon and the far ends of its two links. Nothing is thinned or held back: frames come here faster than on
    any serial line.
    """
    vehicle, station = (peer_of(kind) for kind in request.param)
    unthinned = "forward_rate_requests = true\nmax_bytes_per_s = 1e8"
    (tmp_path / "relay.toml").write_text(
        f'[vehicle]\nsystem_id = 1\n[[link]]\nname = "a"\nurl = "{vehicle.url}"\nrole = "autopilot"\n{unthinned}\n'
        f'[[link]]\nname = "g"\nurl = "{station.url}"\nrole = "gcs"\n{unthinned}\n'
        f'[detections]\nurl = ""\n[status]\nfile = "{tmp_path}/status.json"\n'
    )
    with process("fwav_companion", "run", "--config", "relay.toml", folder=tmp_path) as service:
        for name in "ag":
            service.wait_for(f"link {name} is up")
        for peer in (vehicle, station):
            peer.meet()
        yield service, vehicle, station
    for peer in (vehicle, station):
        peer.close()


@pytest.mark.timeout(120)
def test_what_comes_in_goes_out_byte_for_byte(relay: tuple[Process, Peer, Peer]):
    service, vehicle, station = relay
    hello(vehicle, station)
    for name, send in WIRES.items():
        for near, far, frames in ((vehicle, station, from_vehicle), (station, vehicle, from_station)):
            rng = random.Random(name)
            arrived = send(near, far, frames(rng), rng)
            assert far.collect(len(arrived)) == arrived, name
    assert service.stop() == 0
    assert "fault" not in service.said


def hello(vehicle: Peer, station: Peer) -> None:
    """Each side sends once, so that frames addressed to it have a destination."""
    first = [Wire(1, 1).heartbeat(), Wire(*STATION).heartbeat(6, 8)]
    vehicle.send(first[0])
    assert station.collect(1) == first[:1]
    station.send(first[1])
    assert vehicle.collect(1) == first[1:]
