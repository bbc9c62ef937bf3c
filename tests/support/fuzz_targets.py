"""Entrances for bytes from strangers, one function each: any bytes are read, or refused by a named error.

A target returns normally, or the fuzzer has found a defect. What it checks beyond that is stated in its docstring.
"""

from __future__ import annotations

import hashlib
import json
import os
import struct
import tempfile
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from math import hypot
from pathlib import Path

from configured_links import AUTOPILOT, GROUND
from fastcrc.crc16 import mcrf4xx
from flying import CAMERA
from pymavlink.dialects.v20 import ardupilotmega as dialect

from fwav_companion.camera import parse_calibration
from fwav_companion.config import parse
from fwav_companion.errors import UserError
from fwav_companion.geometry.stamps import NS_PER_MS, NS_PER_S, HostNs
from fwav_companion.mavlink.wire.codec import decode
from fwav_companion.mavlink.wire.scanner import Scanner
from fwav_companion.mavlink.wire.signing import Signature, SigningClock, Verifier
from fwav_companion.pipeline.pipeline_factory import WANTED, make_pipeline
from fwav_companion.recording.lines import encode_line
from fwav_companion.replay.telemetry_files import load_telemetry
from fwav_companion.service.network import make_node
from fwav_companion.types import Frame
from fwav_companion.vision.wall_clock import WallClock
from fwav_companion.vision.wire import parse_frame

KEY = bytes(range(32))
CAMERA_AND_LANDING = """
[camera]
calibration = "camera.yaml"
[publish]
landing_target = true
landing_label = "pad"
"""
LINKS = AUTOPILOT + GROUND + CAMERA_AND_LANDING
SIGNED = LINKS + '[signing]\nkey_file = "signing.key"\n'
RADIO = {dialect.MAVLINK_MSG_ID_RADIO, dialect.MAVLINK_MSG_ID_RADIO_STATUS}
START = 1_000 * NS_PER_S
"""Host time at the start, nanoseconds."""
MESSAGES = sorted(
    (message.id, message.crc_extra, struct.calcsize(message.unpacker.format))
    for message in dialect.mavlink_map.values()
    if message.msgname in WANTED or "REQUEST" in message.msgname or "PARAM" in message.msgname
)


def framed(msgid: int, crc_extra: int, payload: bytes, *, sender: tuple[int, int], seq: int) -> bytes:
    """An unsigned MAVLink 2 frame with a right checksum."""
    header = bytes((len(payload), 0, 0, seq & 255, *sender)) + msgid.to_bytes(3, "little")
    return b"\xfd" + header + payload + mcrf4xx(header + payload + bytes((crc_extra,))).to_bytes(2, "little")


class Daemon:
    """The daemon without its shell: node and pipeline, on a clock that the bytes move."""

    def __init__(self, text: str = LINKS, key: bytes | None = None) -> None:
        config = parse(text, "flight.toml")
        calibration = parse_calibration(CAMERA, "camera.yaml")
        self.pipeline = make_pipeline(config, calibration, unix_offset_ns=0, live=True, written=True)
        self.node = make_node(config, key, 0)
        self.now = HostNs(START)
        self.sent = 0

    def receive(self, link: str, data: bytes) -> None:
        received = self.node.receive(link, data, self.now)
        for message in received.messages:
            self.pipeline.on_message(message, self.now)
        for outgoing in self.pipeline.on_rate_requests(received.rate_requests, self.node.demanded, self.now):
            self.node.encode(outgoing, self.now)
        self.flush()

    def advance(self, ms: int) -> None:
        self.now = HostNs(self.now + ms * NS_PER_MS)
        if self.node.wake_at is not None and self.node.wake_at <= self.now:
            self.node.on_wake(self.now)
        self.pipeline.advance(self.now)
        self.flush()

    def flush(self) -> None:
        """Encode everything that would leave: messages for the links, lines for the recording."""
        outputs = self.pipeline.take()
        identity = self.pipeline.identity
        self.node.adopt(identity.system, identity.autopilot_component, vehicle=identity.vehicle)
        self.node.share(self.pipeline.own_streams)
        for outgoing in outputs.messages:
            self.sent += len(self.node.encode(outgoing, self.now))
        for line in outputs.lines:
            json.loads(encode_line(line), parse_constant=_no_constant)

    def fly(self, ms: int = 1500) -> None:
        """Hear an autopilot that hovers 20 m above its home, since 5 s before the start."""
        for _ in range(ms // 20):
            boot_ms = 5000 + (self.now - START) // NS_PER_MS
            step = (boot_ms - 5000) // 20
            attitude = struct.pack("<I6f", boot_ms, 0.01, -0.02, 0.3, 0.0, 0.0, 0.0)
            data = framed(30, 39, attitude, sender=(1, 1), seq=3 * step)
            if step % 10 == 0:
                place = struct.pack("<IiiiihhhH", boot_ms, 480000000, 110000000, 520000, 20000, 0, 0, 0, 1000)
                data += framed(33, 104, place, sender=(1, 1), seq=3 * step + 1)
                heartbeat = struct.pack("<IBBBBB", 0, 2, 3, 81, 4, 3)
                data += framed(0, 50, heartbeat, sender=(1, 1), seq=3 * step + 2)
            self.receive("autopilot", data)
            self.advance(20)
        self.pipeline.status(self.now)


def scanner(data: bytes) -> None:
    """Every byte is in a frame, skipped or pending; unless bytes are shed, the chunks change nothing."""
    if not data:
        return
    size, data = 1 + data[0], data[1:]
    whole, divided = Scanner(), Scanner()
    frames = whole.feed(data)
    pieces = [frame for at in range(0, len(data), size) for frame in divided.feed(data[at : at + size])]
    if not whole.shed_bytes and not divided.shed_bytes:
        assert [frame.data for frame in frames] == [frame.data for frame in pieces]
    for frame in frames:
        assert frame.data in data
        if frame.known:
            decode(frame)
    frames += whole.settle()
    left = len(data) - sum(len(frame.data) for frame in frames) - whole.skipped_bytes
    assert 0 <= left <= 560, left


def commands(data: bytes) -> None:
    """Known messages with any payload, from any sender on any link, with any pause between them."""
    daemon = Daemon()
    daemon.fly(400)
    for seq, step in enumerate(_steps(data, most=60)):
        kind, who, pause, payload = step
        msgid, crc_extra, length = MESSAGES[kind % len(MESSAGES)]
        sender = ((1, 1), (1, 191), (255, 190), (1, 100), (2, 1), (1, 154), (0, 0), (42, 1))[who & 7]
        body = payload[:length].rstrip(b"\0") or b"\0"
        daemon.receive("ground" if who & 8 else "autopilot", framed(msgid, crc_extra, body, sender=sender, seq=seq))
        daemon.advance((0, 1, 20, 1000, 31_000)[pause % 5])
    daemon.pipeline.status(daemon.now)


def signing(data: bytes) -> None:
    """A signature is genuine if an independent one is equal and its time is newer than all before in its stream.

    Of raw bytes, which cannot know the key, nothing is read, and only a radio's report goes to the vehicle.
    """
    clock = SigningClock(10**12)
    verifier, newest = Verifier(KEY, clock), dict[tuple[int, int, int], int]()
    for kind, who, shift, payload in _steps(data, most=40):
        stream = (who & 3, 1, kind & 3)
        timestamp = max(0, 10**12 + (shift - 128) * 10_000 * (payload[:1] or b"\0")[0])
        frame = b"\xfd" + payload + bytes((stream[2],)) + timestamp.to_bytes(6, "little")
        own = hashlib.sha256(KEY + frame).digest()[:6]
        tampered = bool(kind & 128)
        verdict = verifier.verify(frame + (bytes(6) if tampered else own), *stream[:2], HostNs(START))
        assert (verdict is Signature.FORGED) == (tampered and own != bytes(6))
        if verdict is Signature.GENUINE:
            assert timestamp > newest.get(stream, -1)
            newest[stream] = timestamp
    daemon = Daemon(SIGNED, KEY)
    for link in ("autopilot", "ground"):
        received = daemon.node.receive(link, data, daemon.now)
        assert not received.messages
        to_vehicle = b"".join(forward for to, forward in received.forwards if to == "autopilot")
        passed = Scanner(datagrams=True).feed(to_vehicle)
        assert {frame.msgid for frame in passed} <= RADIO


def detections(data: bytes) -> None:
    """Any datagram is a frame or has a reason; what is made of it is finite, and the targets are strict JSON."""
    daemon = Daemon()
    daemon.fly()
    clock = WallClock(HostNs(START), START)
    for datagram in data.split(b"\n")[:8]:
        frame = parse_frame(datagram, daemon.now, clock)
        if isinstance(frame, Frame):
            assert len(frame.detections) <= 256
        daemon.pipeline.on_frame(frame, daemon.now)
        daemon.flush()
        daemon.advance(20)
    daemon.advance(1000)


def camera(data: bytes) -> None:
    """A camera file gives a lens whose rays have length 1, or one error that names the file."""
    with refused("camera.yaml") as refusal:
        calibration = parse_calibration(_text(data), "camera.yaml")
    if refusal:
        return
    width, height = calibration.image_size
    for u, v in ((0.0, 0.0), (width / 2, height / 2), (width - 1.0, height - 1.0)):
        ray = calibration.lens.camera_ray_from_pixel(u, v)
        if isinstance(ray, tuple):
            assert abs(hypot(*ray) - 1.0) < 1e-9


def configuration(data: bytes) -> None:
    """A configuration is read, and can be written as JSON; or it is one error of one line."""
    with refused("flight.toml"):
        json.dumps(parse(_text(data), "flight.toml").as_builtins())


def tlog(data: bytes) -> None:
    """A recording of raw frames: see :func:`_telemetry`."""
    _telemetry(data)


def dataflash(data: bytes) -> None:
    """An ArduPilot log, of which the first bytes are right."""
    _telemetry(b"\xa3\x95\x80" + data)


def ulog(data: bytes) -> None:
    """A PX4 log, of which the first bytes are right."""
    _telemetry(b"ULog\x01\x12\x35\x01" + data)


def _telemetry(data: bytes) -> None:
    """Messages come in order of time; skipped places are apart and inside the file."""
    path = Path(tempfile.gettempdir()) / f"fuzz-{os.getpid()}"
    path.write_bytes(data)
    try:
        with refused(path.name) as refusal:
            read = load_telemetry(path, frozenset({191}))
    finally:
        path.unlink()
    if refusal:
        return
    times = [unix_us for unix_us, _ in read.messages]
    assert times == sorted(times)
    ends = [0, *(skipped.offset + skipped.length for skipped in read.skipped)]
    assert all(end <= skipped.offset for end, skipped in zip(ends, read.skipped, strict=False))
    assert ends[-1] <= len(data)


@contextmanager
def refused(name: str) -> Iterator[list[str]]:
    """Refusals of a file: its content may be refused by an error that names it, and by no other."""
    refusals: list[str] = []
    try:
        yield refusals
    except UserError as error:
        refusals.append(str(error))
        if name not in str(error):
            raise


def _steps(data: bytes, *, most: int) -> Iterator[tuple[int, int, int, bytes]]:
    """The bytes as steps: three numbers, a length and that many bytes."""
    at = 0
    while at + 4 <= len(data) and most:
        length = data[at + 3]
        yield data[at], data[at + 1], data[at + 2], data[at + 4 : at + 4 + length]
        at += 4 + length
        most -= 1


def _text(data: bytes) -> str:
    return data.decode("utf-8", "replace")


def _no_constant(name: str) -> None:
    raise AssertionError(f"{name} in a line that is JSON")


TARGETS: dict[str, Callable[[bytes], None]] = {
    each.__name__: each
    for each in (scanner, commands, signing, detections, tlog, dataflash, ulog, camera, configuration)
}
