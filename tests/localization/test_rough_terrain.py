"""A fine surface model with trees and houses: fixes are answered, honest, and refused only where there are two answers.

The truth is chosen first: targets on the surface that the vehicle sees. Then errors are drawn from the priors.
"""

import msgspec
import numpy as np
import pytest
from draws import first_of
from made_up_terrain import LAT, LON, PLANE, tile
from rough_surface import FINE, QUIET, direction_of, ground_of, judged_rays, surface
from true_flights import PRIORS, Scene

from fwav_companion.localization import Datum, ElevationModel, FixedGround, HomeGround, Localizer, TerrainGround
from fwav_companion.pipeline.landmark_shift import LandmarkShift
from fwav_companion.types import (
    Bias,
    GroundFix,
    Landmark,
    LandmarkAltitude,
    LandmarkRecord,
    LandmarkState,
    NoFix,
    Reason,
    TakeOff,
    TakeOffSource,
)


def fixes(rng, heights, down_deg, flights):
    """(answer, error of the point in NED) of drawn flights over one surface."""
    answers = []
    while len(answers) < flights:
        away = 60.0 / np.tan(np.radians(down_deg))
        bearing = rng.uniform(0.0, 2.0 * np.pi)
        target = (away * np.cos(bearing), away * np.sin(bearing))
        vehicle = tuple(rng.uniform(-60.0, 60.0, 2))
        scene = Scene(
            roll_deg=0.0,
            pitch_deg=90.0 - down_deg,
            yaw_deg=np.degrees(bearing),
            height_m=60.0,
            target=target,
            vehicle=vehicle,
            pixel_sigma=(2.0, 2.0),
        )
        row = 200 - (vehicle[0] + target[0]) / 1.0294
        column = 200 + (vehicle[1] + target[1]) / 0.6958
        at_target = (
            ground_of(heights, 0.0)._model.height_m(LAT + (200 - row) * FINE, LON + (column - 200) * FINE) - 500.0
        )
        exact = Localizer(ground_of(heights, -at_target), QUIET, min_height_m=0.5)
        sees = exact.ground.meet(scene.sighting(), direction_of(scene))
        if isinstance(sees, NoFix) or abs(sees.distance_m - np.linalg.norm([*target, 60.0])) > 0.5:
            continue  # hidden behind a tree
        bias, noise = scene.draw(rng, QUIET)
        ground = ground_of(heights, -at_target + bias[Bias.TERRAIN])
        answer = Localizer(ground, QUIET, min_height_m=0.5).locate(scene.sighting(bias, noise))
        error = None if isinstance(answer, NoFix) else np.subtract(answer.position_ned, scene.truth())
        answers.append((answer, error))
    return answers


@pytest.mark.parametrize("down_deg", first_of(40.0, 50.0, 65.0))
def test_rays_onto_rough_ground_are_answered_and_honest(down_deg):
    rng = np.random.default_rng(round(down_deg))
    answers = fixes(rng, surface(rng), down_deg, 150)
    answered = [(answer, error) for answer, error in answers if isinstance(answer, GroundFix)]
    assert len(answered) > 0.75 * len(answers)
    assert {answer.reason for answer, _ in answers if isinstance(answer, NoFix)} <= {Reason.TWO_GROUNDS}
    squares = [error[:2] @ np.linalg.solve(np.array(answer.cov)[:2, :2], error[:2]) for answer, error in answered]
    inside90 = np.mean(np.array(squares) < 4.605)
    assert 0.82 < inside90 <= 0.99


@pytest.mark.slow
def test_edges_of_a_rough_surface_are_rarely_missed_and_rarely_refused_needlessly():
    """Of 120 rays 3 and 2; five rays instead of the whole walk along the ground missed 13, and refused 7 needlessly."""
    counts = [judged_rays(7, 60, down_deg) for down_deg in (30.0, 40.0)]
    assert sum(each["answered"] + each["refused"] for each in counts) == 120
    assert sum(each["missed"] for each in counts) <= 7
    assert sum(each["needless"] for each in counts) <= 5


def test_the_square_of_an_unconfirmed_shift_is_in_the_claim():
    """The same ray over the same model, shifted by 6 m: by HOME_POSITION, and by a vehicle that stands."""
    made = tile(lambda _i, _j: 494.0)
    scene = Scene(vehicle=(0.0, 0.0))
    fixes = {}
    for source in (TakeOffSource.HOME_POSITION, TakeOffSource.LANDING, TakeOffSource.STANDING):
        ground = TerrainGround(ElevationModel([made]), Datum.EGM96)
        text = ground.on_origin(PLANE, TakeOff(PLANE.origin, source), None)
        assert ("not confirmed" in text) is (source is TakeOffSource.STANDING)
        fixes[source] = Localizer(ground, PRIORS, min_height_m=0.5).locate(scene.sighting())
    sure, landed, unsure = fixes.values()
    assert landed.cov == sure.cov
    assert unsure.position_ned == sure.position_ned
    assert unsure.cov[2][2] - sure.cov[2][2] == pytest.approx(36.0, rel=1e-6)


def test_a_landmark_shifts_a_model_whose_shift_is_not_confirmed():
    """Level ground at 494 m by the model, at 500 m by the landmark; the vehicle reports its altitude 1.5 m too high."""
    place = PLANE.origin
    ground = TerrainGround(ElevationModel([tile(lambda _i, _j: 494.0)]), Datum.EGM96)
    ground.on_origin(PLANE, TakeOff(place, TakeOffSource.ASSUMED), None)
    locate = Localizer(ground, PRIORS, min_height_m=0.5).locate
    before = locate(Scene(vehicle=(0.0, 0.0)).sighting())
    assert ground.shown(place, 1.5, 4.0) == "", "hardly better than the 5 m of the model's own heights"
    assert "landmark" in ground.shown(place, 1.5, 0.3)
    assert (ground.shift.shift_m, ground.shift.source) == (pytest.approx(7.5), TakeOffSource.LANDMARK)
    after = locate(Scene(vehicle=(0.0, 0.0)).sighting())
    assert after.position_ned[2] == pytest.approx(-1.5, abs=0.01)
    assert before.cov[2][2] - after.cov[2][2] == pytest.approx(5.0**2 - 0.3**2, rel=1e-4)
    assert ground.shown(place, 1.4, 0.25) == "", "hardly better"
    assert ground.shown(place, 40.0, 0.1) == "", "beyond any shift of a model"


def test_a_landmark_that_is_left_out_takes_its_shifts_back():
    """Two shifts by a landmark that is 6 m too high; then the model lies, and claims, as before both."""
    ground = TerrainGround(ElevationModel([tile(lambda _i, _j: 494.0)]), Datum.EGM96)
    ground.on_origin(PLANE, TakeOff(PLANE.origin, TakeOffSource.ASSUMED), None)
    locate = Localizer(ground, PRIORS, min_height_m=0.5).locate
    before = locate(Scene(vehicle=(0.0, 0.0)).sighting())
    landmark = Landmark("mark", PLANE.origin, 0.05)
    shift = LandmarkShift([landmark])

    def applied(sigma_m, state):
        return shift.applied(ground, LandmarkAltitude(0, 0.0, sigma_m), [LandmarkRecord("mark", state, used=9)])

    assert applied(2.0, LandmarkState.USED)
    assert applied(0.5, LandmarkState.USED)
    assert ground.shift.shift_m == pytest.approx(6.0)
    assert "left out" in applied(0.5, LandmarkState.LEFT_OUT)
    assert ground.shift.source is TakeOffSource.ASSUMED
    after = locate(Scene(vehicle=(0.0, 0.0)).sighting())
    assert after.position_ned == pytest.approx(before.position_ned)
    assert after.cov == before.cov
    assert ground.taken_back() == "", "once"


def test_a_landmark_changes_nothing_where_the_shift_is_confirmed_or_the_model_has_no_height():
    confirmed = TerrainGround(ElevationModel([tile(lambda _i, _j: 494.0)]), Datum.EGM96)
    confirmed.on_origin(PLANE, TakeOff(PLANE.origin, TakeOffSource.HOME_POSITION), None)
    assert confirmed.shown(PLANE.origin, 0.0, 0.1) == ""
    void = TerrainGround(ElevationModel([tile(lambda _i, _j: float("nan"))]), Datum.EGM96)
    void.on_origin(PLANE, TakeOff(PLANE.origin, TakeOffSource.ASSUMED), None)
    assert void.shown(PLANE.origin, 0.0, 0.1) == ""
    assert void.shift.source is TakeOffSource.ASSUMED


def test_without_a_take_off_the_model_keeps_its_heights_and_the_claim_says_so():
    """A tree top under a vehicle that is first heard 60 m up does not bend the model."""
    ground = TerrainGround(ElevationModel([tile(lambda _i, _j: 524.0)]), Datum.EGM96)
    text = ground.on_origin(PLANE, TakeOff(PLANE.origin, TakeOffSource.ASSUMED), None)
    assert "not known" in text
    assert ground.shift.shift_m == 0.0
    fix = Localizer(ground, PRIORS, min_height_m=0.5).locate(Scene(vehicle=(0.0, 0.0), height_m=60.0).sighting())
    assert fix.position_ned[2] == pytest.approx(-24.0, abs=0.01)
    assert fix.cov[2][2] > 4.0**2 + 4.9**2


@pytest.mark.parametrize("ground", [HomeGround(), FixedGround(40.0)])
def test_uneven_level_ground_is_in_the_claim_where_it_is_set(ground):
    """45 deg down: a ground that is 2 m higher or lower moves the point by as much along the ground."""
    scene = Scene(roll_deg=0.0, pitch_deg=45.0, yaw_deg=0.0, target=(40.0, 0.0), vehicle=(0.0, 0.0))
    even, uneven = (
        Localizer(
            ground,
            msgspec.structs.replace(
                PRIORS,
                bias_sigmas=tuple(
                    sigma_m if bias is Bias.TERRAIN else sigma
                    for bias, sigma in zip(Bias, PRIORS.bias_sigmas, strict=True)
                ),
            ),
            min_height_m=0.5,
        ).locate(scene.sighting())
        for sigma_m in (0.0, 2.0)
    )
    assert uneven.position_ned == even.position_ned
    assert uneven.cov[0][0] - even.cov[0][0] == pytest.approx(4.0, rel=1e-3)
    assert uneven.cov[2][2] - even.cov[2][2] == pytest.approx(4.0, rel=1e-3)
    assert uneven.budget.terrain == pytest.approx(2.0, rel=1e-3)
