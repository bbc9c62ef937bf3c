"""Terrain as the ground: its height, its slope, what it is moved by, and what it refuses."""

from math import degrees

import msgspec
import numpy as np
import pytest
from made_up_terrain import LAT, LON, PLANE, STEP, tile
from true_flights import PRIORS, STEPS, Noise, Scene

from fwav_companion.geometry.earth import Geodetic, TangentPlane
from fwav_companion.localization import Datum, ElevationModel, Localizer, TerrainGround
from fwav_companion.types import Bias, GroundFix, HeightReference, NoFix, Reason, TakeOff, TakeOffSource

QUIET = {"bridging_sigma": 0.0, "time_noise_s": 0.0, "position_sigma_m": 0.0}
"""A sighting without independent errors."""


class TestGround:
    level = ElevationModel([tile(lambda *_: 500.0)])
    slope = ElevationModel([tile(lambda i, j: 500.0 + 0.2 * 30.87 * (60 - i) - 0.1 * 20.86 * (j - 60))])
    """Rises by 0.2 to the north, falls by 0.1 to the east."""

    def ground(self, model, datum=Datum.EGM96, undulation=None) -> TerrainGround:
        ground = TerrainGround(model, datum)
        self.notice = ground.on_origin(PLANE, TakeOff(PLANE.origin, TakeOffSource.HOME_POSITION), undulation)
        return ground

    def locate(self, ground, sighting):
        return Localizer(ground, PRIORS, min_height_m=0.5).locate(sighting)

    def test_on_level_ground_it_agrees_with_home(self):
        scene = Scene(vehicle=(0.0, 0.0))
        fix = self.locate(self.ground(self.level), scene.sighting())
        assert fix.ground == "terrain"
        assert fix.position_ned == pytest.approx(scene.truth(), abs=1e-3)
        jacobian = np.array(fix.bias_jacobian)
        north, east = scene.target
        assert jacobian[Bias.TERRAIN] == pytest.approx((-north / 40.0, -east / 40.0, -1.0), abs=1e-3)
        assert fix.level_sigma_m == 0.0
        assert fix.budget.terrain == pytest.approx(4.0 * np.hypot(north, east) / 40.0, rel=1e-3)

    @pytest.mark.parametrize("rises", [(0.0, 0.0), (4.0, 0.4)], ids=["flat", "standing"])
    def test_on_a_slope_every_column_agrees_with_differences(self, rises):
        """The ground moves as the model says; the target is where an unbiased ray meets it."""
        ground = self.ground(self.slope)
        scene = Scene(vehicle=(0.0, 0.0), target=(12.0, 25.0), rises=rises)
        fix = self.locate(ground, scene.sighting())
        rays = np.array(scene.sighting().ned_from_camera) @ scene.sighting().ray.direction
        # by hand: z = -(0.2 n - 0.1 e) along (0, 0, -40) + s ray, with the camera lowered by what the target rises
        above = 40.0 - rises[0]
        s = above / (rays[2] + 0.2 * rays[0] - 0.1 * rays[1])
        assert fix.position_ned == pytest.approx((s * rays[0], s * rays[1], -above + s * rays[2]), abs=0.05)
        for bias in Bias:
            if bias is Bias.TERRAIN:
                continue
            step = STEPS[bias] * np.eye(len(Bias))[bias] * 100.0
            ahead, behind = (self.locate(ground, scene.sighting(sign * step)).position_ned for sign in (1.0, -1.0))
            found = np.subtract(ahead, behind) / (2.0 * STEPS[bias] * 100.0)
            assert fix.bias_jacobian[bias] == pytest.approx(found, rel=2e-3, abs=2e-2), bias.name
        up, down = (self.locate(self.raised(self.slope, h), scene.sighting()).position_ned for h in (0.5, -0.5))
        assert fix.bias_jacobian[Bias.TERRAIN] == pytest.approx(np.subtract(up, down), rel=1e-3, abs=1e-3)

    def test_surface_has_the_height_and_the_slope_of_the_model_as_shifted(self):
        ground = self.ground(self.slope)
        surface = ground.reference().surface
        height, by_north, by_east = surface.at(10.0, -20.0)
        assert height == pytest.approx(0.2 * 10.0 + 0.1 * 20.0, abs=0.05)
        assert (by_north, by_east) == pytest.approx((0.2, -0.1), rel=2e-2)
        assert surface.at(1e5, 0.0) is None
        assert ground.reference() == ground.reference()
        assert self.raised(self.slope, 0.5).reference() != ground.reference()

    def test_reference_without_a_model_is_the_autopilots_report(self):
        assert TerrainGround(None, Datum.EGM96).reference().height is HeightReference.TERRAIN_REPORT
        assert TerrainGround(self.level, Datum.EGM96).reference().surface is None

    def test_on_a_slope_the_noise_of_a_pixel_moves_the_point_along_the_slope(self):
        """All three components, by differences of the simulation; no other fresh error is left."""
        alone = msgspec.structs.replace(PRIORS, attitude_noise=0.0, position_noise_m=0.0, height_noise_m=0.0)
        localizer = Localizer(self.ground(self.slope), alone, min_height_m=0.5)
        scene = Scene(vehicle=(0.0, 0.0), pixel_sigma=(3.0, 5.0), **QUIET)
        expected = np.zeros((3, 3))
        for axis, sigma in zip(np.eye(2), scene.pixel_sigma, strict=True):
            ahead, behind = (
                localizer.locate(scene.sighting(None, Noise(pixel=by * axis))).position_ned for by in (5.0, -5.0)
            )
            column = sigma * np.subtract(ahead, behind) / 10.0
            expected += np.outer(column, column)
        assert np.array(localizer.locate(scene.sighting()).noise_cov) == pytest.approx(expected, rel=1e-2, abs=1e-3)

    @pytest.mark.parametrize("source", ["files", "report"])
    def test_the_elevation_models_own_error_is_in_the_total_and_never_in_the_noise(self, source):
        """Only the model errs, by 4 m. A ground that is h too high moves the point toward the camera by h times the
        target's horizontal distance over the height, and up by h."""
        alone = msgspec.structs.replace(
            PRIORS,
            attitude_noise=0.0,
            position_noise_m=0.0,
            height_noise_m=0.0,
            bias_sigmas=tuple(4.0 if bias is Bias.TERRAIN else 0.0 for bias in Bias),
        )
        scene = Scene(vehicle=(0.0, 0.0), pixel_sigma=(0.0, 0.0), **QUIET)
        per_metre = np.array([-scene.target[0], -scene.target[1], -40.0]) / 40.0

        def fix_over(raised_m):
            sighting = scene.sighting()
            if source == "files":
                ground = self.raised(self.level, raised_m)
            else:
                ground = TerrainGround(None, Datum.EGM96)
                state = msgspec.structs.replace(sighting.state, terrain_height_m=40.0 - raised_m)
                sighting = msgspec.structs.replace(sighting, state=state)
            return Localizer(ground, alone, min_height_m=0.5).locate(sighting)

        fix = fix_over(0.0)
        expected = 16.0 * np.outer(per_metre, per_metre)
        assert np.array(fix.cov) == pytest.approx(expected, rel=2e-3)
        assert np.array(fix.relative_cov) == pytest.approx(expected, rel=2e-3)
        assert np.array(fix.noise_cov) == pytest.approx(np.zeros((3, 3)), abs=1e-12)
        assert np.subtract(fix_over(0.5).position_ned, fix.position_ned)[:2] == pytest.approx(
            0.5 * per_metre[:2], rel=1e-2
        )

    def test_the_total_over_terrain_is_the_sum_of_its_named_parts(self):
        """Every bias is one term: its column and its prior."""
        for ground in (self.ground(self.level), self.ground(self.slope)):
            fix = self.locate(ground, Scene(vehicle=(0.0, 0.0)).sighting())
            jacobian = np.array(fix.bias_jacobian)
            biases = jacobian.T @ np.diag(np.square(PRIORS.bias_sigmas)) @ jacobian
            assert np.array(fix.cov) == pytest.approx(np.array(fix.noise_cov) + biases, rel=1e-9)
            place = jacobian[[Bias.POSITION_NORTH, Bias.POSITION_EAST]]
            of_place = (1.0 + PRIORS.position_noise_m**2 + 0.05**2) * place.T @ place
            delay = PRIORS.sigma(Bias.POSITION_DELAY) * jacobian[Bias.POSITION_DELAY]
            without = np.array(fix.cov) - of_place - np.outer(delay, delay)
            assert np.array(fix.relative_cov) == pytest.approx(without, rel=1e-9, abs=1e-9)

    def raised(self, model, by_m) -> TerrainGround:
        ground = self.ground(model)
        ground._raised_m += by_m
        return ground

    def test_it_is_shifted_to_the_take_off_height_and_says_so(self):
        lower = ElevationModel([tile(lambda *_: 488.0)])
        ground = self.ground(lower)
        assert ground.shift.shift_m == pytest.approx(12.0)
        assert "+12.0 m" in self.notice
        assert "egm96" in self.notice
        scene = Scene(vehicle=(0.0, 0.0))
        fix = self.locate(ground, scene.sighting())
        assert fix.position_ned == pytest.approx(scene.truth(), abs=1e-3), "the height too"

    def test_a_service_that_starts_in_flight_shifts_by_the_ground_at_home_not_below_the_vehicle(self):
        """The world's origin is where the vehicle was first heard: on a slope the ground there is another height."""
        home = Geodetic.from_degrees(LAT - 30.0 * STEP, LON, 500.0 - 0.2 * 30.87 * 30.0)
        ground = TerrainGround(self.slope, Datum.EGM96)
        ground.on_origin(
            TangentPlane(Geodetic.from_degrees(LAT, LON, home.alt_amsl_m)),
            TakeOff(home, TakeOffSource.HOME_POSITION),
            None,
        )
        assert ground.shift.shift_m == pytest.approx(0.0, abs=1e-6)

    def test_a_model_of_another_datum_is_not_bent_to_fit(self):
        ground = self.ground(ElevationModel([tile(lambda *_: 547.0)]))  # ellipsoid heights taken for EGM96
        assert "+47.0 m" in self.notice
        answer = self.locate(ground, Scene(vehicle=(0.0, 0.0)).sighting())
        assert answer == NoFix(Reason.TERRAIN_UNFIT)

    def test_ellipsoid_heights_need_the_undulation_and_take_it_with_the_right_sign(self):
        """H = h - N: 547 m over the ellipsoid, 47 m of undulation, are 500 m over the sea."""
        model, scene = ElevationModel([tile(lambda *_: 547.0)]), Scene(vehicle=(0.0, 0.0))
        without = self.ground(model, Datum.ELLIPSOID)
        assert self.locate(without, scene.sighting()) == NoFix(Reason.NO_HEIGHT)
        ground = self.ground(model, Datum.ELLIPSOID, 47.0)
        assert ground.shift.shift_m == pytest.approx(0.0, abs=1e-6)
        assert self.locate(ground, scene.sighting()).position_ned == pytest.approx(scene.truth(), abs=1e-3)

    def test_a_take_off_outside_the_model_leaves_it_as_it_is(self):
        far = TerrainGround(self.level, Datum.EGM96)
        away = TangentPlane(Geodetic.from_degrees(10.0, 10.0, 100.0))
        notice = far.on_origin(away, TakeOff(away.origin, TakeOffSource.HOME_POSITION), None)
        assert "outside" in notice
        assert far.shift.shift_m == 0.0

    def test_refusals(self):
        ground, scene = self.ground(self.level), Scene(vehicle=(0.0, 0.0))
        assert self.locate(TerrainGround(self.level, Datum.EGM96), scene.sighting()) == NoFix(Reason.NO_POSITION)
        away = Scene(vehicle=(5000.0, 0.0)).sighting()
        assert self.locate(ground, away) == NoFix(Reason.BEYOND_TERRAIN)
        under = msgspec.structs.replace(scene.sighting(), camera_ned=(0.0, 0.0, 3.0))
        assert self.locate(ground, under) == NoFix(Reason.TOO_LOW)
        nowhere = Scene(relative=True).sighting()
        assert self.locate(ground, nowhere) == NoFix(Reason.NO_HEIGHT)

    @pytest.mark.parametrize(("north_m", "answered"), [(60.0, True), (88.0, False)])
    def test_a_ray_whose_error_reaches_beyond_the_model_is_refused_by_that_name(self, north_m, answered):
        """The model ends 92.6 m north: from 40 m above it, two sigma of a ray to 88 m are some 9 m."""
        ground = self.ground(ElevationModel([tile(lambda _i, _j: 500.0, rows=64, north=LAT + 3 * STEP)]))
        sighting = Scene(
            roll_deg=0.0, pitch_deg=65.0, yaw_deg=0.0, vehicle=(0.0, 0.0), target=(north_m, 0.0)
        ).sighting()
        answer = self.locate(ground, sighting)
        assert isinstance(answer, GroundFix) if answered else answer == NoFix(Reason.BEYOND_TERRAIN)

    def test_behind_a_crest_a_fix_is_refused(self):
        """The ray grazes a wall's top: a little lower it ends there, a little higher far behind."""
        wall_row = 60 - 4
        walled = self.ground(ElevationModel([tile(lambda i, _: 522.0 if i == wall_row else 500.0)]))
        target = (290.0, 0.0)
        sighting = Scene(
            roll_deg=0.0, pitch_deg=60.0, yaw_deg=0.0, vehicle=(0.0, 0.0), target=target, pixel_sigma=(1.0, 1.0)
        ).sighting()
        quiet = msgspec.structs.replace(PRIORS, bias_sigmas=tuple(0.1 * s for s in PRIORS.bias_sigmas))
        over_level = Localizer(self.ground(self.level), quiet, min_height_m=0.5).locate(sighting)
        over_wall = Localizer(walled, quiet, min_height_m=0.5).locate(sighting)
        assert not isinstance(over_level, NoFix)
        assert over_wall == NoFix(Reason.TWO_GROUNDS)

    @pytest.mark.parametrize("below_m", [0.0, 0.5, 100.0])
    def test_a_camera_in_or_below_the_model_sees_nothing(self, below_m):
        ground = self.ground(self.level)
        sighting = Scene(vehicle=(0.0, 0.0)).sighting()
        buried = msgspec.structs.replace(sighting, camera_ned=(0.0, 0.0, below_m))
        assert self.locate(ground, buried) == NoFix(Reason.TOO_LOW)

    def test_terrain_report_is_a_ground_where_there_are_no_files(self):
        scene = Scene(vehicle=(0.0, 0.0))
        for sighting in (scene.sighting(), Scene(relative=True).sighting()):
            reported = msgspec.structs.replace(
                sighting, state=msgspec.structs.replace(sighting.state, terrain_height_m=40.0)
            )
            fix = self.locate(TerrainGround(None, Datum.EGM96), reported)
            assert fix.ground == "terrain"
            assert fix.position_ned == pytest.approx((12.0, 25.0, 0.0), abs=1e-9)
            assert fix.budget.terrain > 1.0
            assert self.locate(TerrainGround(None, Datum.EGM96), sighting) == NoFix(Reason.NO_HEIGHT)

    def test_degrees_of_the_plane_are_those_of_the_model(self):
        assert degrees(PLANE.origin.lat) == pytest.approx(LAT)


def test_the_status_of_an_elevation_model_before_and_after_its_shift():
    ground = TerrainGround(ElevationModel([tile(lambda *_: 500.0)]), Datum.EGM96)
    before = ground.status()
    assert (before.model, before.source, before.datum) == ("terrain", "files", "egm96")
    assert (before.shift_m, before.shift_sigma_m, before.shift_source) == (0.0, None, None)
    assert before.trouble == Reason.NO_POSITION.value
    ground.on_origin(
        PLANE, TakeOff(msgspec.structs.replace(PLANE.origin, alt_amsl_m=503.0), TakeOffSource.HOME_POSITION), None
    )
    after = ground.status()
    assert (after.shift_m, after.shift_sigma_m) == (pytest.approx(3.0, abs=0.01), 0.0)
    assert (after.shift_source, after.trouble) == (TakeOffSource.HOME_POSITION.value, None)
    far = TerrainGround(ElevationModel([tile(lambda *_: 500.0)]), Datum.EGM96)
    far.on_origin(
        PLANE, TakeOff(msgspec.structs.replace(PLANE.origin, alt_amsl_m=900.0), TakeOffSource.HOME_POSITION), None
    )
    assert far.status().trouble == Reason.TERRAIN_UNFIT.value
    assert TerrainGround(None, Datum.EGM96).status().source == "TERRAIN_REPORT"
    assert TerrainGround(None, Datum.EGM96).status().trouble is None
