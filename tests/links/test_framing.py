"""The cutter: nothing is lost, added or reordered, and no frame is ever cut. Frames are pymavlink's own."""

import random

import pytest
from pymavlink.dialects.v10 import ardupilotmega as v1
from pymavlink.dialects.v20 import ardupilotmega as v2

from fwav_companion.links.streams import FrameCutter


def frames() -> list[bytes]:
    """MAVLink 1 and 2, short and long, signed too."""
    made = []
    for dialect, signed in ((v1, False), (v2, False), (v2, True)):
        mav = dialect.MAVLink(None, srcSystem=1, srcComponent=1)
        if signed:
            mav.signing.secret_key = b"k" * 32
            mav.signing.sign_outgoing = True
        for text in (b"", b"short", b"x" * 50):
            made.append(mav.statustext_encode(6, text).pack(mav))
            made.append(mav.heartbeat_encode(16, 3, 81, 0, 4).pack(mav))
    return [bytes(frame) for frame in made]


@pytest.mark.parametrize("seed", range(5))
def test_two_clients_in_pieces_are_never_mixed_inside_a_frame(seed: int):
    rng = random.Random(seed)
    streams = {name: rng.sample(frames(), k=18) for name in "ab"}
    waiting = {name: b"".join(stream) for name, stream in streams.items()}
    cutters = {name: FrameCutter() for name in streams}
    merged = b""
    while any(waiting.values()):
        name = rng.choice([name for name, rest in waiting.items() if rest])
        step = rng.randint(1, 40)
        merged += cutters[name].cut(waiting[name][:step])
        waiting[name] = waiting[name][step:]

    parser = v2.MAVLink(None)
    parser.robust_parsing = True
    got = [bytes(message.get_msgbuf()) for message in parser.parse_buffer(merged)]
    assert sorted(got) == sorted(streams["a"] + streams["b"])


@pytest.mark.parametrize("size", [1, 2, 3, 7, 1000])
def test_noise_passes_as_it_came(size: int):
    noise = random.Random(size).randbytes(5000)
    cutter = FrameCutter()
    out = b"".join(cutter.cut(noise[at : at + size]) for at in range(0, len(noise), size))
    assert noise.startswith(out)
    assert len(noise) - len(out) < 281, "at most one frame is held back"


def test_a_whole_frame_passes_at_once():
    for frame in frames():
        assert FrameCutter().cut(frame) == frame
        cutter = FrameCutter()
        assert cutter.cut(frame[:-1]) == b""
        assert cutter.cut(frame[-1:]) == frame
