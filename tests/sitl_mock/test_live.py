"""The mock as a separate process, over real links, for a short time each."""

import json
import os
import re
import select
import signal
import socket
import subprocess
import sys
import time
import tty
from contextlib import ExitStack

import pytest

from sitl_mock.__main__ import main
from sitl_mock.codec import Listener, Speaker
from sitl_mock.transports import open_transport


def started(*arguments):
    process = subprocess.Popen(
        [sys.executable, "-m", "sitl_mock", *arguments], stdout=subprocess.PIPE, stderr=subprocess.PIPE, text=True
    )
    line = process.stdout.readline()
    assert "ready" in line, line + process.stderr.read()
    return process, line


def finished(process):
    _, errors = process.communicate(timeout=20)
    assert errors == ""
    return process.returncode


@pytest.fixture
def bound():
    """Function that makes sockets bound to a free port; closes them after the test."""
    with ExitStack() as opened:

        def one():
            made = opened.enter_context(socket.socket(socket.AF_INET, socket.SOCK_DGRAM))
            made.bind(("127.0.0.1", 0))
            made.settimeout(10.0)
            return made

        yield one


def test_udp_out_with_detections_truth_and_answers(tmp_path, bound):
    link, pixels = bound(), bound()
    truth, table = tmp_path / "truth.jsonl", tmp_path / "truth.csv"
    process, _ = started(
        "--connect", f"udpout:127.0.0.1:{link.getsockname()[1]}",
        "--detections", f"127.0.0.1:{pixels.getsockname()[1]}",
        "--seconds", "2", "--seed", "3", "--scenario", "unbiased", "--truth", str(truth), "--truth-csv", str(table),
        "--set", "autopilot.arms_at_s=0.5",
    )  # fmt: skip
    listener, speaker, heard = Listener(), Speaker(1, 191), []
    asked_ns = 0
    while not any(h.name == "TIMESYNC" and h.fields["ts1"] == asked_ns for h in heard):
        data, peer = link.recvfrom(2048)
        if not asked_ns:
            asked_ns = time.monotonic_ns()
            link.sendto(speaker.frame("TIMESYNC", {"tc1": 0, "ts1": asked_ns}), peer)
            nonsense = dict.fromkeys(("angle_x", "angle_y", "distance", "size_x", "size_y"), 0.0)
            wrong = {"time_usec": 1, "target_num": 0, "frame": 8, **nonsense}
            link.sendto(speaker.frame("LANDING_TARGET", wrong), peer)
        heard.extend(listener.feed(data))
    frame = json.loads(pixels.recv(65536))
    assert abs(frame["time_monotonic"] - time.monotonic()) < 5.0
    assert finished(process) == 0
    lines = [json.loads(line) for line in truth.read_text().splitlines()]
    assert lines[0]["seed"] == 3
    assert lines[-1]["landing"]["refused"] == {"frame_not_supported": 1}
    assert lines[-1]["heard"]["TIMESYNC"] == 1
    assert table.read_text().startswith("label,lat,lon,alt_amsl,time_unix\ntarget,48.")
    assert {h.name for h in heard} & {"HEARTBEAT", "ATTITUDE", "GLOBAL_POSITION_INT"}


def test_sigterm_ends_it_well(bound):
    process, line = started("--connect", "udpin:127.0.0.1:0")
    port = int(re.search(r"udpin:127.0.0.1:(\d+)", line)[1])
    peer = bound()
    peer.sendto(Speaker(1, 191).frame("TIMESYNC", {"tc1": 0, "ts1": 5}), ("127.0.0.1", port))
    assert Listener().feed(peer.recv(2048))
    process.send_signal(signal.SIGTERM)
    assert finished(process) == 0


def test_a_pty_of_its_own():
    process, line = started("--connect", "pty", "--seconds", "1")
    path = re.search(r"serial:(\S+)", line)[1]
    fd = os.open(path, os.O_RDWR | os.O_NOCTTY)
    tty.setraw(fd)
    listener, heard = Listener(), []
    while not heard:
        assert select.select([fd], [], [], 10.0)[0]
        heard.extend(listener.feed(os.read(fd, 4096)))
    os.close(fd)
    assert finished(process) == 0


WRONG = (
    "--connect carrier:pigeon",
    "--scenario nope",
    "--seed x",
    "--seconds -3",
    "--seconds nan",
    "--target pad",
    "--record /dev/null/flight",
    "--set x",
    "--set camera=3",
    "--set targets=3",
    "--set camera.fps=x",
    "--set camera.fps=0",
    "--set camera.fsp=3",
    "--set camera.image_size=(0,0)",
    "--set camera.stamp=row1",
    "--set flight.height_m.x=3",
    "--set autopilot.loop_rate_hz=0",
    "--set downlink.loss=2",
    "--set truth_hz=-1",
    "--set truth_hz=1e300",
    "--set camera.fps=1e308",
    "--seconds 1e308",
    "--start-ns -5",
    "--target pad,nan,0",
    "--target pad,x,0",
    "--connect udpout:127.0.0.1:99999",
    "--connect udpin:192.0.2.1:14540",
    "--connect serial:/dev/null",
    "--detections 127.0.0.1:99999",
)


@pytest.mark.parametrize("words", WRONG)
def test_what_cannot_be_understood_is_one_line_and_exit_2(words, capsys):
    """This includes arguments that would otherwise end in a traceback, or in an endless flight."""
    try:
        status = main(words.split())
    except SystemExit as ended:
        status = ended.code
    said = capsys.readouterr().err
    assert (status, said.count("\n")) == (2, 1), said
    assert said.startswith("sitl-mock: ")
    option, _, value = words.partition(" ")
    assert value.partition("=")[0] in said or option in said


@pytest.mark.parametrize("words", ["flight.height_m=1e308", "camera.readout_s=1e300", "origin=(1e9,2e9,0)"])
def test_what_no_message_can_carry_is_one_line_and_exit_2(words, capsys, tmp_path):
    assert main(["--record", str(tmp_path), "--seconds", "1", "--set", words]) == 2
    said = capsys.readouterr().err
    assert said.startswith("sitl-mock: an option is beyond what can be flown, or said in MAVLink: ")
    assert said.count("\n") == 1


def test_help_lists_the_scenarios():
    done = subprocess.run([sys.executable, "-m", "sitl_mock", "--help"], capture_output=True, text=True, timeout=20)
    assert "late_camera" in done.stdout


def exchanged(one, other):
    """Sends bytes both ways; the listening side has to receive first."""
    other.send(b"hello")
    received = {}
    for side in (one, other, one, other):
        ready, _, _ = select.select(side.files(), [], [], 5.0 if not received else 0.2)
        for file in ready:
            received.setdefault(side.name, b"")
            received[side.name] += side.receive(file)
        if side is one:
            one.send(b"answer")
    return [received[side.name] for side in (one, other)]


@pytest.mark.parametrize("kind", ["udp", "tcp"])
def test_listening_and_calling_transports_meet(kind):
    listening = open_transport(f"{kind}in:127.0.0.1:0")
    calling = open_transport(f"{kind}out://127.0.0.1:{listening.name.rpartition(':')[2]}")
    calling.files()
    heard, answered = exchanged(listening, calling)
    assert heard == b"hello"
    assert answered.startswith(b"answer")
    calling.close()
    listening.close()


def test_a_serial_device_by_its_path():
    one = open_transport("pty")
    other = open_transport(one.name + ":921600")
    other.send(b"to the mock")
    assert select.select(one.files(), [], [], 5.0)[0]
    assert one.receive(one.files()[0]) == b"to the mock"
    other.close()
    one.close()
