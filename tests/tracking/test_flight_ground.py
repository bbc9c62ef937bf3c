"""Ground models and streams as the smoother's input: sources of heights, readings, gimbals, heights of targets."""

from math import cos, hypot, radians, sin
from types import SimpleNamespace

import numpy as np
import pytest

from fwav_companion.estimation.errors import SampleNoise, priors
from fwav_companion.estimation.estimator import Estimator
from fwav_companion.geometry.stamps import BootNs
from fwav_companion.localization import AltitudeGround, FixedGround, HomeGround, RangefinderGround
from fwav_companion.tracking.smoothed.flight_clock import FlightClock
from fwav_companion.tracking.smoothed.flight_ground import (
    GROUND_CHANGE_M,
    height_wander_m,
    level_at_home,
    surface_of,
    target_height,
)
from fwav_companion.tracking.smoothed.flight_samples import FlightSamples
from fwav_companion.types import (
    AttitudeSample,
    Bias,
    GroundReference,
    HeightReference,
    RangeSample,
    Reason,
    ReportedGimbal,
    VehicleState,
)

MS = 1_000_000
SIGMAS = SimpleNamespace(
    sigma=lambda bias: {Bias.ROLL: radians(0.5), Bias.TERRAIN: 2.0}.get(bias, 0.0), attitude_noise=radians(0.1),
    height_noise_m=0.3,
)  # fmt: skip
ROLL = radians(20.0)
BANKED = (cos(ROLL / 2), sin(ROLL / 2), 0.0, 0.0)
LEVER = (0.0, 0.0, 0.5)


class Telemetry:
    """A vehicle 12 m above the origin that climbs at 1 m/s, banked by 20 degrees."""

    def __init__(self, *, terrain_m=None, ranges=(), gimbal=None):
        self.terrain_m, self.ranges, self.gimbal = terrain_m, ranges, gimbal

    def attitudes_after(self, boot_ns):
        return [AttitudeSample(BootNs(t), BANKED, (0.0,) * 3) for t in range(0, 2000 * MS, 20 * MS) if t > boot_ns]

    def positions_after(self, boot_ns):
        return [(BootNs(t), False) for t in range(100 * MS, 1900 * MS, 100 * MS) if t > boot_ns]

    def ranges_after(self, boot_ns):
        return [each for each in self.ranges if each.boot_ns > boot_ns]

    def gimbal_at(self, boot_ns):
        return self.gimbal(boot_ns)

    def state_at(self, boot_ns):
        return VehicleState(
            boot_ns=boot_ns, ned_from_body=BANKED, rates=(0.0,) * 3, attitude_sigma=0.0, gap_s=0.0,
            position_ned=(3.0, -2.0, -12.0 - boot_ns * 1e-9), velocity_ned=(0.0, 0.0, -1.0), position_sigma_m=0.0,
            height_above_home_m=99.0, terrain_height_m=self.terrain_m,
        )  # fmt: skip


def fed(telemetry, reference, *, gimbal=False):
    shared = priors(gimbal=(0.05, 0.05) if gimbal else None)
    estimator = Estimator(shared, SampleNoise())
    samples = FlightSamples(telemetry, FlightClock(), LEVER, SIGMAS, has_gimbal=gimbal)
    samples.feed(estimator, reference)
    return samples, estimator


@pytest.mark.parametrize(
    ("reference", "height_m", "climb_m_s"),
    [
        (GroundReference(HeightReference.ALTITUDE), 13.0, 1.0),
        (GroundReference(HeightReference.RANGE), 13.0, 1.0),
        (GroundReference(HeightReference.CONSTANT, 7.0), 7.0 + 0.5 * cos(ROLL), 0.0),
        (GroundReference(HeightReference.TERRAIN_REPORT), 30.0, 1.0),
    ],
    ids=["altitude", "range", "constant", "terrain report"],
)
def test_height_of_the_path_comes_from_the_ground_models_source(reference, height_m, climb_m_s):
    _, estimator = fed(Telemetry(terrain_m=30.0), reference)
    position, velocity, _ = estimator.carrier.path.at(np.array([1.0]))
    assert position[:2, 0] == pytest.approx([3.0, -2.0 - 0.5 * sin(ROLL)], abs=0.02)
    assert position[2, 0] == pytest.approx(height_m - 0.5 * cos(ROLL), abs=0.1)
    assert velocity[2, 0] == pytest.approx(climb_m_s, abs=0.3)


def test_positions_without_a_report_of_the_terrain_are_left_out():
    _, estimator = fed(Telemetry(), GroundReference(HeightReference.TERRAIN_REPORT))
    assert not len(estimator.carrier.path.buffer)


def test_reading_is_the_depth_of_the_beams_foot_below_the_camera():
    beam = RangeSample(BootNs(1000 * MS), 10.0, (0.0, 0.0, 1.0), 0.05)
    samples, estimator = fed(Telemetry(ranges=(beam,)), GroundReference(HeightReference.RANGE))
    reading, foot = estimator.carrier.ranges.newest(-1.0, 9.0)
    assert reading.height_m == pytest.approx((10.0 - 0.5) * cos(ROLL))
    assert foot == pytest.approx([3.0, -2.0 - 10.0 * sin(ROLL)])
    tilt = hypot(radians(0.5), radians(0.1))
    assert reading.sigma_m == pytest.approx(hypot(0.05 * cos(ROLL), 10.0 * sin(ROLL) * tilt))
    assert samples.level_m == pytest.approx(13.0 - 10.0 * cos(ROLL))


def test_reading_of_a_beam_that_points_aside_is_not_used():
    beam = RangeSample(BootNs(1000 * MS), 10.0, (0.0, 1.0, 0.0), 0.05)
    samples, estimator = fed(Telemetry(ranges=(beam,)), GroundReference(HeightReference.RANGE))
    assert not len(estimator.carrier.ranges)
    assert samples.level_m is None


def test_readings_are_not_used_with_another_ground():
    beam = RangeSample(BootNs(1000 * MS), 10.0, (0.0, 0.0, 1.0), 0.05)
    assert not len(fed(Telemetry(ranges=(beam,)), level_at_home())[1].carrier.ranges)


def turned(yaw):
    return (cos(yaw / 2), 0.0, 0.0, sin(yaw / 2))


def test_gimbal_is_followed_up_to_its_newest_report_and_not_across_a_gap():
    def gimbal(boot_ns):
        if boot_ns > 1500 * MS:
            return Reason.STALE_GIMBAL
        return Reason.NO_GIMBAL if 500 * MS < boot_ns < 900 * MS else ReportedGimbal(turned(0.1), False, 0.0)

    _, estimator = fed(Telemetry(gimbal=gimbal), level_at_home(), gimbal=True)
    carrier = estimator.carrier
    assert carrier.gimbal.newest == pytest.approx(1.5, abs=0.02)
    assert not carrier.yaw_from_north
    assert len(carrier.gimbal) == pytest.approx(1500 / 20 - 400 / 20, abs=3)


def test_yaw_that_begins_to_count_from_north_is_converted_to_the_heading():
    def gimbal(boot_ns):
        return ReportedGimbal(turned(0.3), boot_ns >= 1000 * MS, 0.0)

    _, estimator = fed(Telemetry(gimbal=gimbal), level_at_home(), gimbal=True)
    q = estimator.carrier.gimbal.quaternions(np.array([0.5, 1.5]))  # the vehicle's heading is north
    assert q[:, 0] == pytest.approx(q[:, 1], abs=1e-9)


def test_surface_is_at_the_models_level_or_at_zero_where_heights_count_from_the_ground():
    place = np.zeros((2, 1))
    for model, level_m in ((HomeGround(), 0.0), (FixedGround(7.0), 0.0), (RangefinderGround(0.3), 0.0)):
        assert surface_of(model.reference()).height(place)[0][0] == level_m
    home = HomeGround()
    home.home_moved(4.0)
    assert surface_of(home.reference()).height(place)[0][0] == -4.0
    altitude = AltitudeGround(410.0)
    altitude.on_origin(SimpleNamespace(origin=SimpleNamespace(alt_amsl_m=400.0)), None, None)
    assert surface_of(altitude.reference()).height(place)[0][0] == 10.0


class Hill:
    def at(self, north_m, east_m):
        return None if north_m > 50.0 else (0.1 * north_m, 0.1, 0.0)


def test_elevation_model_has_height_and_slope_and_is_level_outside():
    ground = surface_of(GroundReference(HeightReference.ALTITUDE, surface=Hill()))
    height, slope = ground.height(np.array([[20.0, 60.0], [0.0, 0.0]]))
    assert height.tolist() == pytest.approx([2.0, 0.0])
    assert slope.tolist() == [[0.1, 0.0], [0.0, 0.0]]


def test_height_wanders_where_it_does_not_follow_the_vehicle_or_the_ground():
    wander = [height_wander_m(GroundReference(each), SIGMAS) for each in HeightReference]
    assert wander == [0.0, GROUND_CHANGE_M, 0.3, 0.0]


def fix(terrain=(0.0, 0.0, 0.0), height=(0.8, 0.6, 0.0), anchor=(0.0, 0.0)):
    columns = [(0.0, 0.0, 0.0)] * len(Bias)
    columns[Bias.TERRAIN], columns[Bias.HEIGHT] = terrain, height
    sighting = SimpleNamespace(anchor_height_m=anchor[0], anchor_sigma_m=anchor[1])
    return SimpleNamespace(bias_jacobian=tuple(columns), sighting=sighting)


@pytest.mark.parametrize(
    ("of", "expected"),
    [
        (fix(anchor=(1.7, 0.1)), (1.7, 0.1)),
        (fix(terrain=(-0.8, -0.6, 1.0)), (0.0, 2.0)),
        (fix(terrain=(-2.4, -1.8, 3.0), anchor=(1.7, 0.5)), (1.7, hypot(0.5, 6.0))),
        (fix(terrain=(0.0, 0.0, 1.5), height=(0.0, 0.0, 0.0)), (0.0, 2.0)),
    ],
    ids=["flat", "map", "doubted map", "straight down"],
)
def test_height_of_a_target_has_the_doubt_of_its_own_height_and_of_the_ground(of, expected):
    assert target_height(of, SIGMAS) == pytest.approx(expected)
