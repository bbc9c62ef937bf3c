"""The .tlog reader against pymavlink's own writer format and reader, and against damage."""

import io
import random
import struct

import pytest
from hypothesis import given
from hypothesis import strategies as st
from pymavlink.dialects.v20 import ardupilotmega as dialect

from fwav_companion.errors import InputFileError
from fwav_companion.recording.tlog import SkippedBytes, TlogRecord, load_tlog, read_tlog, tlog_record

START_US = 1_790_000_000_000_000


def frames(count: int, seed: int = 1) -> list[bytes]:
    """Frames packed by pymavlink: MAVLink 1 and 2, signed and not."""
    draw = random.Random(seed)
    mav = dialect.MAVLink(io.BytesIO(), srcSystem=1, srcComponent=1)
    mav.signing.secret_key = bytes(32)
    packed = []
    for _ in range(count):
        mav.signing.sign_outgoing = draw.random() < 0.3
        message = dialect.MAVLink_attitude_message(draw.randrange(2**32), *(draw.uniform(-3, 3) for _ in range(6)))
        old = draw.random() < 0.3 and not mav.signing.sign_outgoing
        packed.append(bytes(message.pack(mav, force_mavlink1=old)))
    return packed


def records(data: bytes) -> list[TlogRecord]:
    return [item for item in read_tlog(data) if isinstance(item, TlogRecord)]


def test_what_was_written_is_read():
    packed = frames(200)
    data = b"".join(tlog_record(START_US + 1000 * i, frame) for i, frame in enumerate(packed))
    assert list(read_tlog(data)) == [TlogRecord(START_US + 1000 * i, frame) for i, frame in enumerate(packed)]


def test_pymavlink_reads_what_we_write(tmp_path):
    from pymavlink import mavutil

    path = tmp_path / "flight.tlog"
    packed = frames(20)
    path.write_bytes(b"".join(tlog_record(START_US + 1_000_000 * i, frame) for i, frame in enumerate(packed)))
    reader = mavutil.mavlink_connection(str(path), dialect="ardupilotmega")
    seen = []
    while (message := reader.recv_match(type="ATTITUDE")) is not None:
        seen.append((round(message._timestamp * 1e6), bytes(message.get_msgbuf())))
    reader.close()
    assert [stamp for stamp, _ in seen] == [START_US + 1_000_000 * i for i in range(20)]
    assert [frame for _, frame in seen] == packed


def test_a_damaged_stretch_is_skipped_and_reported():
    packed = frames(30)
    whole = [tlog_record(START_US + i, frame) for i, frame in enumerate(packed)]
    garbage = b"\x00garbage\xfd\x01" * 5
    data = b"".join(whole[:10]) + garbage + b"".join(whole[10:])
    items = list(read_tlog(data))
    skipped = [item for item in items if isinstance(item, SkippedBytes)]
    assert [record.frame for record in items if isinstance(record, TlogRecord)] == packed
    assert skipped == [SkippedBytes(len(b"".join(whole[:10])), len(garbage))]


@pytest.mark.parametrize("cut", range(1, 45))
def test_a_file_cut_by_a_power_failure_gives_all_but_the_last(cut):
    packed = frames(5, seed=4)
    data = b"".join(tlog_record(START_US + i, frame) for i, frame in enumerate(packed))
    cut = min(cut, len(packed[-1]) + 7)
    items = list(read_tlog(data[:-cut]))
    assert [item.frame for item in items if isinstance(item, TlogRecord)] == packed[:-1]
    assert isinstance(items[-1], SkippedBytes)


def test_a_board_whose_clock_starts_in_1970_records_readable_stamps():
    assert records(tlog_record(5, frames(1)[0]))[0].unix_us == 5


@given(st.binary(max_size=300))
def test_no_bytes_break_the_reader(data: bytes):
    covered = 0
    for item in read_tlog(data):
        covered += item.length if isinstance(item, SkippedBytes) else 8 + len(item.frame)
    assert covered == len(data)


def test_files_that_are_none_are_named(tmp_path):
    with pytest.raises(InputFileError, match=r"absent\.tlog: No such file"):
        load_tlog(tmp_path / "absent.tlog")
    (tmp_path / "text.tlog").write_bytes(b"this is no telemetry at all" * 10)
    with pytest.raises(InputFileError, match=r"text\.tlog: no MAVLink record in its 270 bytes"):
        load_tlog(tmp_path / "text.tlog")
    (tmp_path / "empty.tlog").write_bytes(b"")
    assert load_tlog(tmp_path / "empty.tlog") == b""


def test_stamps_beyond_2100_are_damage():
    data = struct.pack(">Q", 2**60) + frames(1)[0]
    assert records(data) == []
