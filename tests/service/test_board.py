"""The board as /proc and /sys describe it, from files made for the test."""

import ctypes
from pathlib import Path
from types import SimpleNamespace

import pytest

from fwav_companion.geometry.stamps import HostNs
from fwav_companion.service.board import TIMEX_BYTES, BoardWatch, board_name, wall_clock_is_synchronised
from fwav_companion.types.network_status import LinkReport

S = 1_000_000_000


@pytest.fixture
def kernel(tmp_path: Path) -> Path:
    (tmp_path / "meminfo").write_text("MemTotal:  437248 kB\nMemFree: 100 kB\nMemAvailable:  229376 kB\n")
    (tmp_path / "stat").write_text("cpu  9 9 9 9\ncpu0 100 0 100 800 0 0 0 0 0 0\ncpu1 0 0 0 1000 0 0 0 0 0 0\n")
    (tmp_path / "class/thermal/thermal_zone0").mkdir(parents=True)
    (tmp_path / "class/thermal/thermal_zone0/temp").write_text("48312\n")
    return tmp_path


def test_load_is_what_was_done_since_the_last_look(kernel: Path):
    watch = BoardWatch({"autopilot": True}, proc=kernel, sys=kernel)
    first = watch.report({"autopilot": LinkReport(bytes_in=1000)}, None, HostNs(S))
    assert first.cpu == ()
    assert first.links == ()
    (kernel / "stat").write_text("cpu0 150 0 150 850 50 0 0 0 0 0\ncpu1 0 0 0 1200 0 0 0 0 0 0\nintr 5\n")
    second = watch.report({"autopilot": LinkReport(bytes_in=1000 + 20480, bytes_out=2048)}, 5.0, HostNs(3 * S))
    assert second.cpu == pytest.approx((0.5, 0.0))
    assert (second.ram_total_mib, second.ram_used_mib) == (427, 203)
    assert second.core_celsius == pytest.approx(48.312)
    assert second.utc_minus_host_s == 5.0
    (load,) = second.links
    assert (load.serial, load.sent_kib_s, load.received_kib_s) == (True, 1.0, 10.0)


def test_a_board_without_readings_reports_nothing(tmp_path: Path):
    watch = BoardWatch({}, proc=tmp_path, sys=tmp_path)
    for second in (1, 2):
        report = watch.report({}, None, HostNs(second * S))
        assert (report.cpu, report.ram_total_mib, report.core_celsius, report.links) == ((), None, None, ())


def test_this_machine_is_reported_correctly():
    report = BoardWatch({}).report({}, None, HostNs(S))
    assert report.ram_total_mib is not None
    assert report.ram_used_mib is not None
    assert 0 < report.ram_used_mib < report.ram_total_mib


def test_a_boards_name_is_its_own_and_stays(tmp_path: Path):
    one, other = tmp_path / "one", tmp_path / "other"
    one.write_text("0123456789abcdef0123456789abcdef\n")
    other.write_text("1123456789abcdef0123456789abcdef\n")
    assert board_name(one) == board_name(one) != board_name(other)
    assert "0123456789" not in board_name(one)
    assert board_name(tmp_path / "absent") == board_name(tmp_path / "absent too")


@pytest.mark.parametrize(("state", "believed"), [(0, True), (1, True), (4, True), (5, False), (-1, False)])
def test_the_wall_clock_is_believed_where_the_kernel_calls_it_synchronised(monkeypatch, state: int, believed: bool):
    """TIME_OK, a leap second coming, one just over; TIME_ERROR, and a call that failed."""
    monkeypatch.setattr(ctypes, "CDLL", lambda _: SimpleNamespace(adjtimex=lambda _: state))
    assert wall_clock_is_synchronised() is believed


def test_this_kernel_answers():
    libc = ctypes.CDLL(None, use_errno=True)
    assert libc.adjtimex(ctypes.create_string_buffer(TIMEX_BYTES)) in range(6)
