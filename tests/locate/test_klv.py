"""MISB ST 0601: packets that stanag4609 (an independent encoder) wrote, and a transport stream that PyAV muxed."""

from __future__ import annotations

import json
from fractions import Fraction
from pathlib import Path

import numpy as np
import pymap3d
import pytest
from scipy.spatial.transform import Rotation

from fwav_companion.cli.main import main
from fwav_companion.photographs.klv import TimeScale, centre_residual_m, decode_packets
from tests.support.maker_pictures import place_below, true_picture

pytest.importorskip("stanag4609")

import stanag4609


def packet(**more: float) -> bytes:
    values = {
        2: 1_700_000_000_000_000, 65: 19, 5: 123.0, 90: 4.0, 91: -3.0, 13: 47.123456, 14: -11.654321, 15: 512.0,
        16: 40.0, 18: 200.0, 19: -35.0, 20: 5.0, 104: 560.0,
    } | {int(name[1:]): value for name, value in more.items()}  # fmt: skip
    height = values[104]
    values[104] = None if height is None else stanag4609.IMAPFieldValue(height, 3)
    return stanag4609.encode_uas_local_set({tag: value for tag, value in values.items() if value is not None})


def test_packet_of_another_encoder_gives_its_values():
    (state,) = decode_packets(b"\x00\x01junk" + packet() + b"tail")
    assert (state.lat_deg, state.lon_deg) == pytest.approx((47.123456, -11.654321), abs=1e-7)
    assert state.amsl_m == pytest.approx(512.0, abs=0.16)
    assert state.ellipsoid_m == pytest.approx(560.0, abs=0.02)
    assert state.hfov_deg == pytest.approx(40.0, abs=0.002)
    truth = Rotation.from_euler("ZYX", [123.0, 4.0, -3.0], degrees=True) * Rotation.from_euler(
        "ZYX", [200.0, -35.0, 5.0], degrees=True
    )
    roll, pitch, yaw = state.angles_deg
    given = Rotation.from_euler("ZYX", [yaw, pitch, roll], degrees=True)
    assert np.degrees((truth.inv() * given).magnitude()) < 0.004  # the heading's step is 0.0055 degrees


def test_short_angles_count_where_the_full_ones_are_missing():
    (state,) = decode_packets(packet(_90=None, _91=None, _6=4.0, _7=-3.0))
    (full,) = decode_packets(packet())
    assert state.angles_deg == pytest.approx(full.angles_deg, abs=0.01)


def test_two_packets_in_one_piece_and_a_wrong_checksum_between_them():
    bad = bytearray(packet())
    bad[40] ^= 1
    assert len(list(decode_packets(packet() + bytes(bad) + packet()))) == 2


@pytest.mark.parametrize("seed", range(4))
def test_mutated_packets_raise_nothing(seed: int):
    rng = np.random.default_rng(seed)
    good = packet()
    for _ in range(200):
        data = bytearray(good)
        for at in rng.integers(0, len(data), int(rng.integers(1, 5))):
            data[at] = int(rng.integers(0, 256))
        cut = int(rng.integers(0, len(data) + 1))
        assert len(list(decode_packets(bytes(data[:cut]) + good))) >= 1


def test_centre_of_the_frame_shows_angles_in_another_convention():
    (state,) = decode_packets(packet())
    roll, pitch, yaw = state.angles_deg
    ahead = Rotation.from_euler("ZYX", [yaw, pitch, roll], degrees=True).apply([1.0, 0.0, 0.0])
    north, east, down = ahead * 300.0
    lat, lon, height = pymap3d.ned2geodetic(north, east, down, state.lat_deg, state.lon_deg, 512.0)
    (right,) = decode_packets(packet(_23=float(lat), _24=float(lon), _25=float(height)))
    assert centre_residual_m(right) < 0.5
    (wrong,) = decode_packets(packet(_23=float(lat), _24=float(lon), _25=float(height), _18=77.0))
    assert centre_residual_m(wrong) > 50.0


@pytest.mark.parametrize(
    ("leaps", "scale", "taken"),
    [(None, "auto", 0), (None, "utc", 0), (None, "misp", 37), (37, "auto", 37), (37, "utc", 0), (30, "misp", 30)],
)
def test_time_of_a_packet_is_utc_by_its_scale(leaps: int | None, scale: str, taken: int):
    (state,) = decode_packets(packet(_136=leaps))
    assert state.unix_time(TimeScale(scale)) == pytest.approx(1_700_000_000.0 - taken, abs=1e-6)


def write_stream(path: Path, packets: list[bytes]) -> None:
    """Three seconds of MPEG-2 video with a packet a frame at 10 Hz."""
    av = pytest.importorskip("av")
    with av.open(str(path), "w", format="mpegts") as out:
        video = out.add_stream("mpeg2video", rate=25)
        video.width, video.height, video.pix_fmt = 160, 96, "yuv420p"
        data = out.add_data_stream("klv")
        for number in range(75):
            frame = av.VideoFrame.from_ndarray(np.full((96, 160, 3), number, np.uint8), format="rgb24")
            frame.pts = number
            for coded in video.encode(frame):
                out.mux(coded)
        for coded in video.encode():
            out.mux(coded)
        for number, content in enumerate(packets):
            coded = av.Packet(content)
            coded.stream, coded.time_base = data, Fraction(1, 90000)
            coded.pts = coded.dts = 9000 * number
            out.mux(coded)


def test_locate_in_a_transport_stream_gives_the_place(tmp_path: Path, capsys: pytest.CaptureFixture[str]):
    truth = true_picture(np.random.default_rng(9), lat=47.0, lon=11.0, pitch=-60.0, yaw=30.0, roll=0.0, width=160,
                         height=96, focal_px=80 / np.tan(np.radians(20)))  # fmt: skip
    path = tmp_path / "flight.ts"
    write_stream(path, [packet(_5=0.0, _90=0.0, _91=0.0, _13=truth.lat, _14=truth.lon, _15=truth.alt_amsl, _104=None,
                               _18=30.0, _19=-60.0, _20=0.0)] * 30)  # fmt: skip
    lat, lon, _ = place_below(truth, 100.0, 60.0)
    command = ["locate", str(path), "--at", "1.5", "--pixel", "100,60", "--ground-alt", "400", "--json"]
    assert main(command) == 0
    (target,) = json.loads(capsys.readouterr().out.splitlines()[-1])["targets"]
    error = pymap3d.geodetic2ned(target["lat"], target["lon"], 0, lat, lon, 0)
    assert np.hypot(error[0], error[1]) < 0.5
    assert target["alt_datum"] == "egm96"


def test_transport_stream_without_metadata_is_one_line(tmp_path: Path, capsys: pytest.CaptureFixture[str]):
    write_stream(tmp_path / "bare.ts", [])
    assert main(["locate", str(tmp_path / "bare.ts"), "--at", "1.5", "--pixel", "100,60"]) == 2
    assert capsys.readouterr().err.count("\n") == 1
