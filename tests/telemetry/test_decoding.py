"""From messages to samples: arithmetic against scipy, and absurd values are refused."""

from math import inf, nan, pi
from types import SimpleNamespace

import pytest
from hypothesis import given
from hypothesis import strategies as st
from scipy.spatial.transform import Rotation
from telemetry_messages import DEFAULTS, Autopilot, message

from fwav_companion.geometry.stamps import BootNs, HostNs
from fwav_companion.telemetry import Telemetry, decoding
from fwav_companion.telemetry.decoding import Implausible
from fwav_companion.types import Unpaired


def fields(name: str, **changed: object) -> SimpleNamespace:
    return SimpleNamespace(**{**DEFAULTS[name], **changed})


@pytest.mark.parametrize("euler", [(0.1, 0.65, -2.0), (-3.0, -1.2, 3.1), (0.0, 0.0, 0.0)])
def test_both_attitude_messages_mean_the_same_rotation(euler):
    roll, pitch, yaw = euler
    x, y, z, w = Rotation.from_euler("ZYX", [yaw, pitch, roll]).as_quat()
    from_euler = decoding.attitude_from_euler(fields("ATTITUDE", roll=roll, pitch=pitch, yaw=yaw))
    from_quaternion = decoding.attitude_from_quaternion(fields("ATTITUDE_QUATERNION", q1=w, q2=x, q3=y, q4=z))
    one, other = from_euler.ned_from_body, from_quaternion.ned_from_body
    assert abs(sum(a * b for a, b in zip(one, other, strict=True))) == pytest.approx(1.0, abs=1e-12)


@pytest.mark.parametrize("bad", [nan, inf, -inf, 1e30])
@pytest.mark.parametrize("field", ["roll", "pitch", "yaw", "rollspeed", "pitchspeed", "yawspeed"])
def test_absurd_attitudes_are_none(field, bad):
    assert decoding.attitude_from_euler(fields("ATTITUDE", **{field: bad})) == Implausible()


@pytest.mark.parametrize("bad", [{"q1": 0.0}, {"q1": nan}, {"q2": inf}, {"q1": 2.0}, {"yawspeed": nan}])
def test_absurd_quaternions_are_none(bad):
    assert decoding.attitude_from_quaternion(fields("ATTITUDE_QUATERNION", **bad)) == Implausible()


def test_positions():
    reported = decoding.position(fields("GLOBAL_POSITION_INT", vx=150, vy=-20, vz=5, relative_alt=-1500))
    assert reported.place.lat_deg == pytest.approx(47.3977420, abs=1e-12)
    assert reported.place.alt_amsl_m == 500.0
    assert (reported.height_above_home_m, reported.velocity_ned) == (-1.5, (1.5, -0.2, 0.05))
    nowhere = decoding.position(fields("GLOBAL_POSITION_INT", lat=0, lon=0))
    assert nowhere.place is None
    assert nowhere.height_above_home_m == 10.0
    assert decoding.position(fields("GLOBAL_POSITION_INT", lat=2_000_000_000)) == Implausible()
    assert decoding.position(fields("GLOBAL_POSITION_INT", relative_alt=2**31 - 1)) == Implausible()


@pytest.mark.parametrize(
    ("changed", "expected"),
    [
        ({}, 47.0),
        ({"alt_ellipsoid": 0}, None),
        ({"fix_type": 2}, None),
        ({"alt_ellipsoid": 900_000}, None),
        ({"alt_ellipsoid": 470_000}, -30.0),
    ],
)
def test_undulation(changed, expected):
    assert decoding.undulation_m(fields("GPS_RAW_INT", **changed)) == expected


@pytest.mark.parametrize(
    ("changed", "beam"),
    [
        ({}, (0.0, 0.0, 1.0)),
        ({"orientation": 0}, None),
        ({"orientation": 24}, None),
        ({"orientation": 39}, None),
        ({"orientation": 100, "quaternion": (0.5**0.5, 0.0, -(0.5**0.5), 0.0)}, (0.0, 0.0, 1.0)),
        ({"orientation": 100, "quaternion": (nan, 0.0, 0.0, 0.0)}, None),
        ({"current_distance": 4000}, None),
        ({"current_distance": 20}, None),
        ({"signal_quality": 1}, None),
    ],
)
def test_rangefinders_that_look_down(changed, beam):
    sample = decoding.range_sample(fields("DISTANCE_SENSOR", **changed), BootNs(5))
    if beam is None:
        assert sample == Implausible()
    else:
        assert sample.distance_m == 10.0
        assert sample.beam_in_body == pytest.approx(beam, abs=1e-12)


def test_a_range_covariance_is_in_square_centimetres():
    assert decoding.range_sample(fields("DISTANCE_SENSOR", covariance=25), BootNs(5)).sigma_m == pytest.approx(0.05)
    assert decoding.range_sample(fields("DISTANCE_SENSOR"), BootNs(5)).sigma_m == 0.0


@pytest.mark.parametrize(("usec", "known"), [(0, False), (1_790_000_000_000_000, True), (315_964_800_000_000, False)])
def test_utc(usec, known):
    assert (decoding.unix_ns(fields("SYSTEM_TIME", time_unix_usec=usec)) is not None) is known


FLOATS = st.one_of(st.floats(width=32), st.floats(-10.0, 10.0, width=32))
INTEGERS = st.one_of(st.integers(-(2**31), 2**31 - 1), st.integers(-10, 300))


@given(st.data())
def test_no_message_content_stops_telemetry(data):
    telemetry = Telemetry()
    now = 0
    for _ in range(data.draw(st.integers(1, 12))):
        name = data.draw(st.sampled_from(sorted(DEFAULTS)))
        drawn = {
            key: data.draw(FLOATS) if isinstance(value, float) else data.draw(INTEGERS)
            for key, value in DEFAULTS[name].items()
            if isinstance(value, int | float)
        }
        drawn |= {
            key: tuple(data.draw(FLOATS) for _ in value)
            for key, value in DEFAULTS[name].items()
            if isinstance(value, tuple)
        }
        drawn |= {"time_boot_ms": data.draw(st.integers(0, 2**32 - 1))} if "time_boot_ms" not in drawn else {}
        now += data.draw(st.integers(0, 10**10))
        telemetry.on_message(message(name, **drawn), HostNs(now))
        state = telemetry.newest_state()
        if not isinstance(state, Unpaired):
            assert all(abs(c) <= 1.0 + 1e-9 for c in state.ned_from_body)
            assert 0.0 <= state.attitude_sigma < pi
    telemetry.status(HostNs(now))


def test_what_is_refused_is_counted():
    autopilot = Autopilot()
    autopilot.attitudes(0, 50)
    autopilot.send("ATTITUDE", 60, roll=nan)
    assert autopilot.telemetry.status(autopilot.host(100)).refused == {"ATTITUDE": 1}
