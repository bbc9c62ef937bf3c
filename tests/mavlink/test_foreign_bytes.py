"""Bytes of other systems beside an exchange: the same in flight and in the replay of its recording."""

from __future__ import annotations

import struct

from fwav_companion.geometry.stamps import HostNs
from fwav_companion.mavlink.router.node import LinkPolicy, Node
from fwav_companion.pipeline.pipeline_factory import WANTED
from fwav_companion.replay.telemetry import read_telemetry
from sitl_mock.codec import Speaker

NOW = HostNs(10**12)
T0_US = 1_790_000_000_000_000
BEAT = {"type": 2, "autopilot": 3, "base_mode": 0, "custom_mode": 0, "system_status": 4, "mavlink_version": 3}
RTCM_BYTES = 12 + 182
"""Frame of GPS_RTCM_DATA whose data is full; no room of ours decodes it."""


def rtcm(station: Speaker) -> bytes:
    return station.frame("GPS_RTCM_DATA", {"flags": 0, "len": 180, "data": (1,) * 180})


def flight() -> list[tuple[str, bytes]]:
    """(link, frames of one read): an autopilot, its gimbal, and a station that corrects the position."""
    autopilot, gimbal, station = Speaker(1, 1), Speaker(1, 154), Speaker(255, 190)
    answer = autopilot.frame("TIMESYNC", {"tc1": 5 * 10**9, "ts1": 77})
    return [
        ("fc", autopilot.frame("HEARTBEAT", BEAT)),
        ("gcs", station.frame("HEARTBEAT", BEAT | {"type": 6, "autopilot": 8})),
        ("fc", gimbal.frame("HEARTBEAT", BEAT | {"type": 26, "autopilot": 8}) + answer),
        ("gcs", rtcm(station) + rtcm(station)),
        ("fc", autopilot.frame("TIMESYNC", {"tc1": 6 * 10**9, "ts1": 78})),
    ]


def counted_live() -> tuple[list[int], int, list[bytes]]:
    node = Node([LinkPolicy("fc", "autopilot"), LinkPolicy("gcs", "gcs")], WANTED)
    node.adopt(1, 1)
    counts, recorded = [], []
    for link, data in flight():
        received = node.receive(link, data, NOW)
        counts += [message.foreign_bytes for message in received.messages if message.name == "TIMESYNC"]
        recorded += [frame.data for frame in received.frames]
    return counts, node.foreign_bytes, recorded


def test_foreign_bytes_are_those_of_other_systems_before_each_timesync():
    counts, all_bytes, _ = counted_live()
    assert counts[1] - counts[0] == 2 * RTCM_BYTES
    assert all_bytes == counts[1], "neither the autopilot's frames nor those of its gimbal"


def test_replay_of_the_recording_counts_the_same():
    counts, _, recorded = counted_live()
    tlog = b"".join(struct.pack(">Q", T0_US + i) + frame for i, frame in enumerate(recorded))
    replayed = [message.foreign_bytes for _, message in read_telemetry(tlog).messages if message.name == "TIMESYNC"]
    assert replayed == counts
