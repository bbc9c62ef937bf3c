"""The capture of each row, against the formula written out."""

import pytest
from hypothesis import given
from hypothesis import strategies as st

from fwav_companion.pairing.timing import CameraTiming, RowClock, StampRule

MS = 1_000_000
STAMP = 1_000_000 * MS


def by_the_contract(stamp_s, offset_s, rule, exposure_s, readout_s, v, height):
    m = {"row0_mid": 0.0, "row0_start": exposure_s / 2, "row0_end": -exposure_s / 2}[rule]
    if readout_s < 0:
        return stamp_s - offset_s + m + abs(readout_s) * (1 - v / height)
    return stamp_s - offset_s + m + readout_s * v / height


@given(
    st.floats(-0.2, 0.2),
    st.sampled_from(list(StampRule)),
    st.floats(0.0, 0.03),
    st.floats(-0.05, 0.05),
    st.floats(-0.5, 479.5),
)
def test_the_formula(offset_s, rule, exposure_s, readout_s, v):
    clock = RowClock(CameraTiming(time_offset_s=offset_s, readout_s=readout_s, stamp_rule=rule))
    rows = clock.place(STAMP, exposure_s, 480)
    expected_ns = by_the_contract(0.0, offset_s, rule.value, exposure_s, readout_s, v, 480) * 1e9
    assert rows.capture_ns(v) - STAMP == pytest.approx(expected_ns, abs=3.0)
    assert rows.first_row_ns == rows.capture_ns(0.0)
    assert rows.capture_ns(v) <= rows.latest_ns + 60_000  # half a row beyond the edge


@given(st.floats(-0.05, 0.05), st.floats(0.0, 480.0))
def test_the_row_fraction_is_the_derivative_by_the_length_of_the_readout(readout_s, v):
    step = 1e-4

    def capture(length_s: float) -> float:
        signed = length_s if readout_s >= 0 else -length_s
        return RowClock(CameraTiming(readout_s=signed)).place(0, None, 480).capture_ns(v) * 1e-9

    slope = (capture(abs(readout_s) + step) - capture(abs(readout_s) + 0.0)) / step if readout_s else v / 480
    fraction = RowClock(CameraTiming(readout_s=readout_s)).place(0, None, 480).row_fraction(v)
    assert fraction == pytest.approx(slope, abs=1e-4)
    assert 0.0 <= fraction <= 1.0


@pytest.mark.parametrize(
    ("reported", "used"), [(None, 0.01), (0.004, 0.004), (float("nan"), 0.01), (-1.0, 0.01), (99.0, 0.01)]
)
def test_a_frames_own_exposure_goes_first_where_it_is_one(reported, used):
    clock = RowClock(CameraTiming(readout_s=0.0, stamp_rule=StampRule.ROW0_END, exposure_s=0.01))
    assert clock.place(STAMP, reported, 480).first_row_ns == STAMP - round(used * 0.5e9)


def test_an_unknown_readout_is_half_the_median_interval_and_uniform():
    clock = RowClock(CameraTiming())
    assert clock.readout_s == pytest.approx(1 / 60)
    stamp = 0
    for k in range(40):
        stamp += 50 * MS if k % 7 else 150 * MS  # frames are missing now and then
        clock.see(stamp)
        if k % 5 == 0:
            clock.see(stamp - 120 * MS)  # a late one shows no interval
    assert clock.readout_s == pytest.approx(0.025)
    assert clock.readout_sigma_s == pytest.approx(0.05 / 12**0.5)


@pytest.mark.parametrize("interval_s", [0.08, 0.9, 10.0])
def test_an_unknown_readout_is_never_assumed_longer_than_any_sensors(interval_s):
    clock = RowClock(CameraTiming())
    for k in range(40):
        clock.see(round(k * interval_s * 1e9))
    assert clock.readout_s == pytest.approx(0.0375)
    assert clock.readout_sigma_s == pytest.approx(0.075 / 12**0.5)
    assert clock.readout_scale == pytest.approx(0.075 * 30)


def test_a_known_readout_stays():
    clock = RowClock(CameraTiming(readout_s=0.01))
    for k in range(10):
        clock.see(k * 50 * MS)
    assert (clock.readout_s, clock.readout_sigma_s) == (0.01, 0.0)


def test_a_pause_is_no_interval():
    clock = RowClock(CameraTiming())
    for stamp_ms in (0, 40, 80, 9000, 9040, 900_000):
        clock.see(stamp_ms * MS)
    assert clock.interval_s == pytest.approx(0.04)
