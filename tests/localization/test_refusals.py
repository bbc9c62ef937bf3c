"""Every missing answer is a named refusal, never a plausible number."""

from dataclasses import replace
from math import inf, nan

import msgspec
import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from true_flights import PRIORS, Scene

from fwav_companion.localization import FixedGround, HomeGround, Localizer, RangefinderGround
from fwav_companion.types import GroundFix, NoFix, RangeSample, Reason


def looking(sighting, direction):
    """The same sighting with another ray, given in NED."""
    ray = msgspec.structs.replace(sighting.ray, direction=direction)
    return msgspec.structs.replace(sighting, ray=ray, ned_from_camera=((1, 0, 0), (0, 1, 0), (0, 0, 1)))


def reason(answer):
    return answer.reason if isinstance(answer, NoFix) else answer


GROUNDS = {"home": HomeGround, "fixed": lambda: FixedGround(40.0), "rangefinder": lambda: RangefinderGround(0.05)}
every_ground = pytest.mark.parametrize("make_ground", GROUNDS.values(), ids=GROUNDS.keys())


@every_ground
@pytest.mark.parametrize("down", [0.0, -1e-9, -0.3, -1.0, 1e-9, nan])
def test_a_ray_that_does_not_descend_meets_no_ground(make_ground, down):
    localizer = Localizer(make_ground(), PRIORS, min_height_m=0.5)
    direction = (np.sqrt(max(0.0, 1.0 - down * down)) if down == down else 1.0, 0.0, down)
    assert reason(localizer.locate(looking(Scene().sighting(), direction))) is Reason.ABOVE_HORIZON


@every_ground
def test_just_below_the_horizon_is_too_shallow(make_ground):
    localizer = Localizer(make_ground(), PRIORS, min_height_m=0.5)
    assert reason(localizer.locate(looking(Scene().sighting(), (1.0, 0.0, 1e-4)))) is Reason.TOO_SHALLOW


def test_near_the_ground_no_fix():
    for height_m, expected in ((0.49, Reason.TOO_LOW), (-3.0, Reason.TOO_LOW), (0.51, None)):
        scene = Scene(pitch_deg=5.0, roll_deg=0.0, height_m=10.0, target=(0.5, 0.2))
        sighting = scene.sighting()
        low = msgspec.structs.replace(sighting, camera_ned=(*sighting.camera_ned[:2], -height_m))
        answer = Localizer(HomeGround(), PRIORS, min_height_m=0.5).locate(low)
        assert (reason(answer) if expected else isinstance(answer, GroundFix)) == (expected or True)


@pytest.mark.parametrize("relative", [True, False])
def test_the_home_surface_moves_where_the_autopilot_moves_home(relative):
    ground = HomeGround()
    localizer = Localizer(ground, PRIORS, min_height_m=0.5)
    before = localizer.locate(Scene(relative=relative).sighting()).position_ned
    localizer.home_moved(4.0)  # 4 m lower
    after = localizer.locate(Scene(relative=relative).sighting()).position_ned

    if relative:  # the height above home contains it already
        assert after == before
    else:
        vehicle = (100.0, -50.0)
        stretched = [v + (44.0 / 40.0) * (b - v) for v, b in zip(vehicle, before, strict=False)]
        assert after == pytest.approx((*stretched, 4.0), abs=1e-9)


def test_without_any_height_no_fix():
    blind = msgspec.structs.replace(Scene(relative=True).sighting(), camera_height_above_home_m=None)
    assert reason(Localizer(HomeGround(), PRIORS, min_height_m=0.5).locate(blind)) is Reason.NO_HEIGHT


def test_an_unreliable_height_is_refused():
    bad = msgspec.structs.replace(Scene(relative=True).sighting(), camera_height_above_home_m=nan)
    assert reason(Localizer(HomeGround(), PRIORS, min_height_m=0.5).locate(bad)) is Reason.TOO_LOW


class TestRangefinder:
    scene = Scene(pitch_deg=20.0, roll_deg=5.0, beam=(0.0, 0.0, 1.0))

    def locate(self, ground, sighting):
        return Localizer(ground, PRIORS, min_height_m=0.5).locate(sighting)

    def with_reading(self, **changes):
        sighting = self.scene.sighting()
        reading = msgspec.structs.replace(sighting.state.range, **changes)
        return msgspec.structs.replace(sighting, state=msgspec.structs.replace(sighting.state, range=reading))

    def test_it_gives_the_height_where_home_is_wrong(self):
        """The autopilot's height is 7 m too low; the rangefinder measures the true one."""
        sighting = self.with_reading()
        wrong = msgspec.structs.replace(sighting, camera_ned=(100.0, -50.0, -33.0))
        fix = self.locate(RangefinderGround(0.05), wrong)
        assert fix.position_ned[:2] == pytest.approx(self.scene.truth()[:2], abs=1e-9)
        assert fix.position_ned[2] == pytest.approx(7.0), "measured from the camera, so it shares the camera's error"

    def test_it_falls_back_to_home_and_says_why(self):
        ground = RangefinderGround(0.05)
        silent = replace(self.scene, beam=None)
        assert self.locate(ground, silent.sighting()).ground == "home"
        assert ground.fallback is Reason.NO_RANGE
        assert self.locate(ground, self.with_reading(boot_ns=400_000_000)).ground == "home"
        assert ground.fallback is Reason.NO_RANGE
        assert self.locate(ground, self.with_reading(beam_in_body=(1.0, 0.0, 0.0))).ground == "home"
        assert ground.fallback is Reason.RANGE_TILTED
        assert self.locate(ground, self.with_reading()).ground == "rangefinder"
        assert ground.fallback is None
        assert ground.fallbacks == {Reason.NO_RANGE: 2, Reason.RANGE_TILTED: 1}

    @pytest.mark.parametrize(("age_ms", "ground"), [(299, "rangefinder"), (-299, "rangefinder"), (301, "home")])
    def test_a_reading_counts_up_to_three_tenths_of_a_second_from_the_capture(self, age_ms, ground):
        still = replace(self.scene, rates=(0.0, 0.0, 0.0))
        reading = msgspec.structs.replace(still.sighting().state.range, boot_ns=-age_ms * 1_000_000)
        state = msgspec.structs.replace(still.sighting().state, range=reading)
        sighting = msgspec.structs.replace(still.sighting(), state=state)
        assert self.locate(RangefinderGround(0.05), sighting).ground == ground

    def test_a_good_reading_makes_a_better_fix_than_home(self):
        by_home = self.locate(HomeGround(), self.with_reading()).budget
        by_beam = self.locate(RangefinderGround(0.05), self.with_reading()).budget
        reported = self.locate(RangefinderGround(0.05), self.with_reading(sigma_m=1.0)).budget
        assert by_beam.height < by_home.height < reported.height
        assert by_beam.attitude < by_home.attitude, "the beam turns with the camera: the slant is measured"

    def test_an_older_reading_of_a_turning_vehicle_is_worth_less(self):
        now = self.locate(RangefinderGround(0.05), self.with_reading()).budget.height
        old = self.locate(RangefinderGround(0.05), self.with_reading(boot_ns=-200_000_000)).budget.height
        assert old > now

    def test_an_older_reading_of_a_turning_vehicle_is_worth_less_by_half_the_turn_across_the_beam(self):
        """The beam leans by 0.1 of its length; half of the turn since the reading moves its foot along the slope."""
        leaning = (0.1, 0.0, np.sqrt(1.0 - 0.01))
        level = replace(self.scene, pitch_deg=0.0, roll_deg=0.0, rates=(0.0, 0.0, 1.0), beam=leaning)
        sighting = level.sighting()
        reading = msgspec.structs.replace(sighting.state.range, boot_ns=-200_000_000, sigma_m=0.3)
        sighting = msgspec.structs.replace(sighting, state=msgspec.structs.replace(sighting.state, range=reading))
        met = RangefinderGround(0.05).meet(sighting, (0.0, 0.0, 1.0))
        by_turn = reading.distance_m * 0.1 * 0.5 * 1.0 * 0.2
        assert met.height_noise_m == pytest.approx(np.hypot(0.3 * leaning[2], by_turn))

    def test_without_a_velocity_the_height_is_that_of_the_reading(self):
        sighting = self.with_reading(boot_ns=-100_000_000)
        still = msgspec.structs.replace(
            sighting, state=msgspec.structs.replace(sighting.state, velocity_ned=(0.0, 0.0, 0.0))
        )
        unknown = msgspec.structs.replace(sighting, state=msgspec.structs.replace(sighting.state, velocity_ned=None))
        ground = RangefinderGround(0.05)
        assert self.locate(ground, unknown).position_ned == self.locate(ground, still).position_ned

    def test_the_reading_is_brought_to_the_capture_by_rates_and_velocity(self):
        """100 ms ago the vehicle was tilted otherwise and 0.05 m lower: reading and height follow."""
        scene = replace(self.scene, velocity=(3.0, 1.0, -0.5))
        then = scene._attitude(-0.1).apply([0.0, 0.0, 1.0])[2]
        reading = RangeSample(-100_000_000, (scene.height_m - 0.05) / then, (0.0, 0.0, 1.0), 0.0)
        sighting = scene.sighting()
        sighting = msgspec.structs.replace(sighting, state=msgspec.structs.replace(sighting.state, range=reading))
        assert self.locate(RangefinderGround(0.05), sighting).position_ned == pytest.approx(scene.truth(), abs=1e-9)


wild = st.one_of(st.floats(allow_nan=True, allow_infinity=True), st.sampled_from([0.0, nan, inf, -inf, 1e300, 1e-300]))


@settings(derandomize=True, max_examples=300, deadline=None)
@given(
    make_ground=st.sampled_from(list(GROUNDS.values())),
    relative=st.booleans(),
    height=wild,
    velocity=st.none() | st.tuples(wild, wild, wild),
    rates=st.tuples(wild, wild, wild),
    sigma=wild,
)
def test_wild_telemetry_gives_a_refusal_or_finite_numbers_or_honest_doubt(
    make_ground, relative, height, velocity, rates, sigma
):
    sighting = Scene(relative=relative).sighting()
    state = msgspec.structs.replace(
        sighting.state, velocity_ned=velocity, rates=rates, attitude_sigma=sigma, height_above_home_m=height
    )
    camera = (0.0, 0.0, 0.0) if relative else (1.0, 2.0, -height)
    wild_sighting = msgspec.structs.replace(sighting, state=state, camera_height_above_home_m=height, camera_ned=camera)
    answer = Localizer(make_ground(), PRIORS, min_height_m=0.5).locate(wild_sighting)
    if isinstance(answer, GroundFix):
        assert np.isfinite(answer.position_ned).all()
        assert np.isfinite(answer.cov).all()


@settings(derandomize=True, max_examples=200, deadline=None)
@given(
    roll=st.floats(-80, 80),
    pitch=st.floats(-80, 80),
    yaw=st.floats(0, 360),
    north=st.floats(-300, 300),
    east=st.floats(-300, 300),
    height=st.floats(1, 200),
)
def test_whatever_is_seen_is_found_or_refused(roll, pitch, yaw, north, east, height):
    """Round trip: a target anywhere, a vehicle any way up. What comes back is the target."""
    scene = Scene(roll, pitch, yaw, height_m=height, target=(north, east))
    try:
        sighting = scene.sighting()
    except TypeError:  # outside the lens
        return
    answer = Localizer(HomeGround(), PRIORS, min_height_m=0.5).locate(sighting)
    if isinstance(answer, GroundFix):
        assert answer.position_ned == pytest.approx(scene.truth(), abs=1e-6)
        assert np.linalg.eigvalsh(np.array(answer.cov)).min() > 0.0
    else:
        assert answer.reason is Reason.TOO_SHALLOW
        assert np.hypot(north, east) > 1.5 * height
