"""Streams of a real server: GStreamer's, where it is installed (always in CI)."""

import os
import shutil
import subprocess
import sys
import threading
import time
from pathlib import Path

import av
import numpy as np
import pytest

from fwav_companion.vision.images import SourceLostError
from fwav_companion.vision.newest_picture import NewestPicture
from fwav_companion.vision.sources.stream import StreamSource

SYSTEM_PYTHON = "/usr/bin/python3"
PROBE = (
    "import gi; gi.require_version('Gst', '1.0'); gi.require_version('GstRtspServer', '1.0')\n"
    "from gi.repository import Gst, GstRtspServer\n"
    "Gst.init(None); assert Gst.ElementFactory.find('x264enc')"
)
FAKETIME = next(Path("/usr/lib").glob("*/faketime/libfaketime.so.1"), None)
BITS = 16


def has_gstreamer() -> bool:
    """CI sets GSTREAMER=required: its absence then fails the tests."""
    if os.environ.get("GSTREAMER") == "required":
        return True
    try:
        return subprocess.run([SYSTEM_PYTHON, "-c", PROBE], capture_output=True, timeout=60).returncode == 0
    except (OSError, subprocess.TimeoutExpired):
        return False


HAS_LAUNCH = os.environ.get("GSTREAMER") == "required" or shutil.which("gst-launch-1.0") is not None
needs_gstreamer = pytest.mark.skipif(not has_gstreamer(), reason="GStreamer's RTSP server is not installed")


class Server:
    """The server, and when it pushed each picture."""

    def __init__(self, stamps="send", clock=""):
        environment = dict(os.environ)
        if clock:
            environment |= {"LD_PRELOAD": str(FAKETIME), "FAKETIME": clock, "FAKETIME_DONT_FAKE_MONOTONIC": "1"}
        command = [SYSTEM_PYTHON, str(Path(__file__).parent / "rtsp_server.py"), "0", stamps]
        self.process = subprocess.Popen(command, stdout=subprocess.PIPE, text=True, env=environment)
        self.port = int(self.process.stdout.readline().split()[1])
        self.pushed = {}
        self.reader = threading.Thread(target=self._read, daemon=True)
        self.reader.start()

    def _read(self):
        for line in self.process.stdout:
            number, at_s = line.split()
            self.pushed[int(number)] = float(at_s)

    @property
    def url(self):
        return f"rtsp://127.0.0.1:{self.port}/main"

    def __enter__(self):
        return self

    def __exit__(self, *_):
        self.process.kill()
        self.process.wait()
        self.reader.join()
        self.process.stdout.close()


def number_in(picture):
    bars = picture.pixels[:, :, 0].reshape(240, BITS, 20).mean(axis=(0, 2))
    return sum(1 << bit for bit in range(BITS) if bars[bit] > 120)


def watched(source, seconds, work_s=0.0):
    """(picture, number, instant of delivery) for so long."""
    seen, until_s = [], time.monotonic() + seconds
    while time.monotonic() < until_s:
        picture = source.read(5.0)
        seen.append((picture, number_in(picture), time.monotonic()))
        time.sleep(work_s)
    return seen


@needs_gstreamer
@pytest.mark.slow
@pytest.mark.parametrize(
    ("stamps", "clock"),
    [
        ("send", ""),
        ("capture", ""),
        pytest.param(
            "capture", "+3h x1.00005", marks=pytest.mark.skipif(FAKETIME is None, reason="libfaketime is not installed")
        ),
    ],
)
def test_stamps_are_those_of_the_server_on_our_clock(stamps, clock):
    """A stamp less the push of the same picture is one constant, the latency, whatever the server's clock."""
    with Server(stamps, clock) as server:
        source = StreamSource(server.url, utc=False)
        seen = watched(source, 14.0)
        source.close()
        time.sleep(0.2)
        by_server = [(p, n) for p, n, _ in seen if p.clock == "server" and n in server.pushed]
        assert len(by_server) > 100, "its reports come every five seconds"
        errors = np.array([p.stamp["time_monotonic"] - server.pushed[n] for p, n in by_server])
        assert np.abs(np.median(errors)) < 0.15, "the latency"
        assert np.percentile(np.abs(errors - np.median(errors)), 90) < 0.03


@needs_gstreamer
@pytest.mark.slow
def test_a_slow_detector_gets_the_newest_picture_and_not_the_queue():
    with Server() as server:
        source = NewestPicture(StreamSource(server.url, utc=False))
        seen = watched(source, 8.0, work_s=0.3)
        source.close()
        time.sleep(0.2)
        ages = [at_s - server.pushed[n] for _, n, at_s in seen[3:] if n in server.pushed]
        assert len(ages) > 10
        assert np.median(ages) < 0.3
        assert sum(picture.skipped for picture, _, _ in seen) > 5 * len(seen)


def test_a_transport_stream_by_udp_is_stamped_on_arrival(tmp_path):
    port = 41000 + os.getpid() % 20000
    code = (
        "import av, sys, time, numpy as np\n"
        f"out = av.open('udp://127.0.0.1:{port}?pkt_size=1316', 'w', format='mpegts')\n"
        "s = out.add_stream('mpeg2video', rate=25); s.width, s.height, s.pix_fmt, s.gop_size = 160, 120, 'yuv420p', 5\n"
        "for i in range(1500):\n"
        "    frame = av.VideoFrame.from_ndarray(np.full((120, 160, 3), i % 200, np.uint8), format='rgb24')\n"
        "    [out.mux(p) for p in s.encode(frame)]\n"
        "    time.sleep(0.04)\n"
    )
    sender = subprocess.Popen([sys.executable, "-c", code], stderr=subprocess.DEVNULL)
    try:
        source = StreamSource(f"udp://127.0.0.1:{port}", utc=False)
        pictures = [source.read(5.0) for _ in range(5)]
        assert pictures[0].pixels.shape == (120, 160, 3)
        assert {picture.clock for picture in pictures} == {"arrival"}
        assert abs(time.monotonic() - pictures[-1].stamp["time_monotonic"]) < 2.0
        source.close()
    finally:
        sender.kill()
        sender.wait()


SDP = "v=0\r\no=- 0 0 IN IP4 127.0.0.1\r\ns=a\r\nc=IN IP4 127.0.0.1\r\nt=0 0\r\n"
FFMPEG = (
    "import av, time, numpy as np\n"
    "out = av.open('rtp://127.0.0.1:{port}', 'w', format='rtp')\n"
    "s = out.add_stream('mpeg2video', rate=25)\n"
    "s.width, s.height, s.pix_fmt, s.gop_size = 160, 120, 'yuv420p', 5\n"
    "for i in range(1500):\n"
    "    frame = av.VideoFrame.from_ndarray(np.full((120, 160, 3), 100 + i % 100, np.uint8), format='rgb24')\n"
    "    [out.mux(p) for p in s.encode(frame)]\n"
    "    time.sleep(0.04)\n"
)
GSTREAMER = (
    "-q videotestsrc is-live=true ! video/x-raw,width=160,height=120,framerate=25/1 ! x264enc tune=zerolatency "
    "key-int-max=10 ! rtph264pay pt=96 config-interval=-1 ! udpsink host=127.0.0.1 port={port}"
)
H264 = "a=rtpmap:96 H264/90000\r\na=fmtp:96 packetization-mode=1\r\n"
SENDERS = {
    "FFmpeg": ("m=video {port} RTP/AVP 32\r\n", [sys.executable, "-c", FFMPEG]),
    "GStreamer": ("m=video {port} RTP/AVP 96\r\n" + H264, ["gst-launch-1.0", *GSTREAMER.split()]),
}


@pytest.mark.parametrize(
    "name",
    [
        "FFmpeg",
        pytest.param(
            "GStreamer",
            marks=[
                pytest.mark.slow,
                pytest.mark.skipif(not HAS_LAUNCH, reason="gst-launch-1.0 is not installed"),
            ],
        ),
    ],
)
def test_rtp_is_received_by_its_sdp_file(tmp_path, name):
    media, command = SENDERS[name]
    port = 2 * (20500 + os.getpid() % 5000)
    (tmp_path / "camera.sdp").write_text(SDP + media.format(port=port))
    sender = subprocess.Popen([word.replace("{port}", str(port)) for word in command], stderr=subprocess.DEVNULL)
    try:
        source = StreamSource(str(tmp_path / "camera.sdp"), utc=False)
        pictures = [source.read(5.0) for _ in range(10)]
        source.close()
    finally:
        sender.kill()
        sender.wait()
    assert {picture.pixels.shape for picture in pictures} == {(120, 160, 3)}
    assert all(picture.pixels.std() < 2.0 or name == "GStreamer" for picture in pictures)
    assert [picture.number for picture in pictures] == list(range(10))
    assert abs(time.monotonic() - pictures[-1].stamp["time_monotonic"]) < 2.0


def test_a_stream_that_changes_its_size_in_flight_goes_on(tmp_path):
    """The encoder of a camera is set to another resolution: pictures before and after are whole."""
    port = 41000 + (os.getpid() + 7919) % 20000
    code = (
        "import av, sys, time, numpy as np\n"
        "from fractions import Fraction\n"
        f"out = av.open('udp://127.0.0.1:{port}?pkt_size=1316', 'w', format='mpegts')\n"
        "s = out.add_stream('mpeg2video', rate=25); s.width, s.height, s.pix_fmt = 160, 120, 'yuv420p'\n"
        "clock = 0\n"
        "for size in ((160, 120), (320, 240)) * 30:\n"
        "    c = av.CodecContext.create('mpeg2video', 'w')\n"
        "    c.width, c.height, c.pix_fmt, c.framerate, c.gop_size, c.max_b_frames = *size, 'yuv420p', 25, 5, 0\n"
        "    c.time_base = Fraction(1, 25)\n"
        "    for i in range(25):\n"
        "        f = av.VideoFrame.from_ndarray(np.full((size[1], size[0], 3), 120, np.uint8), format='rgb24')\n"
        "        f.pts, clock = clock, clock + 1\n"
        "        for p in c.encode(f):\n"
        "            p.stream = s; out.mux(p)\n"
        "        time.sleep(0.04)\n"
    )
    sender = subprocess.Popen([sys.executable, "-c", code], stderr=subprocess.DEVNULL)
    try:
        source = StreamSource(f"udp://127.0.0.1:{port}", utc=False)
        shapes, until_s = [], time.monotonic() + 30.0
        while len(set(shapes)) < 2 and time.monotonic() < until_s:
            shapes.append(source.read(5.0).pixels.shape)
        source.close()
    finally:
        sender.kill()
        sender.wait()
    assert set(shapes) == {(120, 160, 3), (240, 320, 3)}


@pytest.mark.parametrize(
    ("name", "content", "reported"),
    [("a.sdp", "v=0\r\nnot a description", "a.sdp: "), ("a.sdp", None, "a.sdp: No such file")],
)
def test_what_is_no_stream_is_lost_in_one_line(tmp_path, name, content, reported):
    if content is not None:
        (tmp_path / name).write_text(content)
    with pytest.raises(SourceLostError, match=rf"^[^\n]*{reported}[^\n]*$"):
        StreamSource(str(tmp_path / name), utc=False)


def test_no_server_is_lost_in_one_line():
    with pytest.raises(SourceLostError, match=r"^rtsp://127\.0\.0\.1:1/x\?a=b&c: Connection refused$"):
        StreamSource("rtsp://127.0.0.1:1/x?a=b&c", utc=False)


def test_this_pyav_has_what_the_stamps_need():
    assert av.packet.Packet.get_sidedata
