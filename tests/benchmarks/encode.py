"""Encoding LANDING_TARGET, byte-identical, against pymavlink: from values to bytes, unsigned and signed.

``python -m tests.benchmarks.encode``
"""

from __future__ import annotations

import io

from pymavlink.dialects.v20 import ardupilotmega as dialect

from fwav_companion.geometry.stamps import HostNs
from fwav_companion.mavlink.wire.codec import Encoder, frame, pack
from fwav_companion.mavlink.wire.frames import FLAG_SIGNED
from fwav_companion.mavlink.wire.signing import Signer, SigningClock
from tests.benchmarks.figure import Figure, interleaved

COUNT = 5_000
KEY = bytes(range(32))
TIMESTAMP = 40_000_000_000_000
FIELDS = {
    "time_usec": 1_234_567_890_123,
    "target_num": 1,
    "frame": 12,
    "angle_x": 0.1,
    "angle_y": -0.2,
    "distance": 10.5,
    "size_x": 0.01,
    "size_y": 0.02,
    "x": 4.0,
    "y": -3.0,
    "z": 9.5,
    "q": (1.0, 0.0, 0.0, 0.0),
    "type": 2,
    "position_valid": 1,
}


def _pymavlink(*, signed: bool) -> dialect.MAVLink:
    mav = dialect.MAVLink(io.BytesIO(), srcSystem=1, srcComponent=191)
    if signed:
        mav.signing.secret_key = KEY
        mav.signing.timestamp = TIMESTAMP
        mav.signing.sign_outgoing = True
    return mav


def _theirs(*, signed: bool, count: int) -> bytes:
    mav = _pymavlink(signed=signed)
    data = b""
    for i in range(count):
        mav.seq = i % 256
        data = mav.landing_target_encode(**FIELDS).pack(mav)
    return data


def _ours(count: int) -> bytes:
    encoder = Encoder(1, 191)
    data = b""
    for _ in range(count):
        data = encoder.encode("LANDING_TARGET", FIELDS)
    return data


def _ours_signed(count: int) -> bytes:
    signer = Signer(KEY, 0, SigningClock(TIMESTAMP))
    data = b""
    for i in range(count):
        definition, payload = pack("LANDING_TARGET", FIELDS)
        data = signer.sign(frame(definition, payload, 1, 191, i % 256, FLAG_SIGNED), HostNs(0))
    return data


def measure() -> list[Figure]:
    if _ours(7) != _theirs(signed=False, count=7) or _ours_signed(7) != _theirs(signed=True, count=7):
        raise AssertionError("the bytes differ")
    ours_s, theirs_s, ours_signed_s, theirs_signed_s = interleaved(
        lambda: _ours(COUNT),
        lambda: _theirs(signed=False, count=COUNT),
        lambda: _ours_signed(COUNT),
        lambda: _theirs(signed=True, count=COUNT),
    )
    return [
        Figure("encode LANDING_TARGET, against pymavlink", theirs_s / ours_s, 2.5, True, _detail(ours_s, theirs_s)),
        Figure(
            "encode LANDING_TARGET signed, against pymavlink",
            theirs_signed_s / ours_signed_s,
            2.2,
            True,
            _detail(ours_signed_s, theirs_signed_s),
        ),
    ]


def _detail(ours_s: float, theirs_s: float) -> str:
    return f"ours {ours_s / COUNT * 1e6:.2f} us, pymavlink {theirs_s / COUNT * 1e6:.2f} us a message"


if __name__ == "__main__":
    for figure in measure():
        print(figure)
