"""The static filter against a batch weighted mean, and its claims against many flights with drawn biases."""

import numpy as np
import pytest
from handmade import a_fix, a_view, host_ns
from msgspec.structs import replace
from scipy.linalg import expm
from scipy.stats import chi2
from simulated_flight import Flight, priors
from simulated_world import World

from fwav_companion.tracking import TrackingOptions, make_tracker
from fwav_companion.tracking.filters.kalman import StaticKalman
from fwav_companion.tracking.filters.moving import MovingKalman
from fwav_companion.types import BIAS_COUNT, Bias

RATE = 2.0 / 60.0
"""Angular frequency of the position's wander, 1/s."""
NO_BIAS = priors(time_offset=0, heading=0, mount_x=0, mount_y=0, mount_z=0, height_noise_m=0.0)


def some_cov(rng):
    a = rng.standard_normal((2, 2)) * 0.2
    cov = np.zeros((3, 3))
    cov[:2, :2] = a @ a.T + 0.01 * np.eye(2)
    return cov


def test_it_is_the_batch_weighted_mean():
    rng = np.random.default_rng(5)
    covs = [some_cov(rng) for _ in range(60)]
    samples = [
        rng.multivariate_normal((4000.0, -3000.0, 0.0), cov) for cov in covs
    ]  # at this distance the azimuth does not change
    weights = [np.linalg.inv(cov[:2, :2]) for cov in covs]
    total = np.linalg.inv(sum(weights))
    mean = total @ sum(w @ x[:2] for w, x in zip(weights, samples, strict=True))

    belief_filter = StaticKalman(NO_BIAS)
    belief = belief_filter.initiate(a_fix(0.0, samples[0], covs[0]))
    for k in range(1, 60):
        belief = belief.predict(host_ns(k * 0.2)).update(a_fix(k * 0.2, samples[k], covs[k]))
    assert belief.position_ned[:2] == pytest.approx(mean, abs=1e-5)
    assert np.array(belief.cov)[:2, :2] == pytest.approx(total, rel=1e-3, abs=1e-6)


@pytest.mark.parametrize("make", [StaticKalman, MovingKalman])
def test_sights_that_are_sure_across_do_not_draw_the_target_nearer(make):
    """Each noise is given along its own line of sight, which it has rotated: all those lines meet at the camera."""
    rng, count = np.random.default_rng(8), 2000
    along, across = 0.43, 0.08
    belief, distances = None, []
    for k in range(count):
        fix_ne = (5.0 + along * rng.standard_normal(), across * rng.standard_normal())
        line = np.array(fix_ne) / np.hypot(*fix_ne)
        cov = np.zeros((3, 3))
        cov[:2, :2] = along**2 * np.outer(line, line) + across**2 * (np.eye(2) - np.outer(line, line))
        fix = a_fix(k * 0.2, (*fix_ne, 0.0), cov)
        belief = make(NO_BIAS).initiate(fix) if belief is None else belief.predict(host_ns(k * 0.2)).update(fix)
        distances.append(belief.position_ned[0])
    assert np.mean(distances[count // 2 :]) == pytest.approx(5.0, abs=0.015)  # short by 0.05 and 0.022 without


def test_a_standing_bias_does_not_shrink_with_the_number_of_fixes():
    p = priors(time_offset=0, heading=0, mount_x=0, mount_y=0.02, mount_z=0)
    jacobian = np.zeros((3, BIAS_COUNT))
    jacobian[0, Bias.MOUNT_Y] = 12.0
    tracker = make_tracker(TrackingOptions(), p)
    for k in range(400):
        fix = a_fix(k * 0.2, (4.0, 3.0, 0.0), jacobian=jacobian, sigmas=p.bias_sigmas)
        (track,) = tracker.on_frame(a_view(k * 0.2, fix))
    assert 0.24**2 + 0.04 / 400 < track.cov[0][0] < 1.01 * 0.24**2  # and the error of the sensitivity, averaged
    assert track.cov[1][1] == pytest.approx(0.04 / 400, rel=1e-9)


def test_place_and_apparent_place_are_nearly_the_best_linear_estimates_of_a_smoothly_wandering_position():
    """By the covariances of all samples (Gauss-Markov theorem): of the place, and of place plus error at the end.

    The apparent place is filtered by a random walk that moves as far within a second, which costs some of it.
    """
    p = priors(time_offset=0, heading=0, mount_x=0, mount_y=0, mount_z=0, position_north=1.0, position_east=1.0)
    jacobian = np.zeros((3, BIAS_COUNT))
    jacobian[0, Bias.POSITION_NORTH] = jacobian[1, Bias.POSITION_EAST] = 1.0
    times = np.arange(300) * 0.5
    apart = np.abs(times[:, None] - times) / 30.0
    error = (1.0 + apart) * np.exp(-apart)
    inverse, ones = np.linalg.inv(error + 0.04 * np.eye(300)), np.ones(300)
    variance = 1.0 / (ones @ inverse @ ones)
    now = error[-1] @ inverse
    rest = 1.0 - now @ ones
    least = 1.0 - now @ error[-1] + rest**2 * variance
    rng, root = np.random.default_rng(3), np.linalg.cholesky(error + 1e-9 * np.eye(300))
    places, currents = [], []
    for _ in range(12):
        wander = root @ rng.standard_normal(300)
        tracker = make_tracker(TrackingOptions(), p)
        for t, north in zip(times, 4.0 + wander + rng.normal(0.0, 0.2, 300), strict=True):
            fix = a_fix(t, (north, 3.0, 0.0), jacobian=jacobian, sigmas=p.bias_sigmas)
            (track,) = tracker.on_frame(a_view(t, fix))
        places.append((track.position_ned[0] - 4.0) ** 2)
        currents.append((track.apparent_ned[0] - 4.0 - wander[-1]) ** 2)
    assert track.cov[0][0] == pytest.approx(variance, rel=0.03)
    assert least <= track.relative_cov[0][0] < 2.0 * least
    low, high = chi2.ppf([0.0005, 0.9995], 12) / 12
    assert low < np.mean(places) / track.cov[0][0] < high
    assert low < np.mean(currents) / track.relative_cov[0][0] < high


def test_telemetry_noise_averages_with_the_telemetry_not_with_the_frames():
    p = priors(time_offset=0, heading=0, mount_x=0, mount_y=0, mount_z=0, height_noise_m=0.3)
    jacobian = np.zeros((3, BIAS_COUNT))
    jacobian[0, Bias.HEIGHT] = 1.0
    noise = np.diag([1e-6 + 0.09, 1e-6, 0.0])
    tracker = make_tracker(TrackingOptions(), p)
    for k in range(600):
        fix = a_fix(k / 30, (4.0, 3.0, 0.0), noise, jacobian, p.bias_sigmas)
        (track,) = tracker.on_frame(a_view(k / 30, fix))
    assert track.cov[0][0] == pytest.approx(0.09 / 200, rel=0.02)


def test_noise_of_attitudes_averages_with_the_attitudes_where_frames_come_faster():
    """Four attitudes a second for twenty seconds are eighty, however many frames there are."""
    p = priors(time_offset=0, heading=0, mount_x=0, mount_y=0, mount_z=0, height_noise_m=0.0, attitude_noise=0.01)
    jacobian = np.zeros((3, BIAS_COUNT))
    jacobian[0, Bias.PITCH], jacobian[1, Bias.HEADING] = 10.0, 5.0
    noise = np.diag([1e-6 + 0.1**2, 1e-6 + 0.05**2, 0.0])
    tracker = make_tracker(TrackingOptions(), p)
    for k in range(600):
        fix = a_fix(k / 30, (4.0, 3.0, 0.0), noise, jacobian, p.bias_sigmas)
        state = replace(fix.sighting.state, spacing_s=0.25)
        (track,) = tracker.on_frame(a_view(k / 30, replace(fix, sighting=replace(fix.sighting, state=state))))
    assert track.cov[0][0] == pytest.approx(0.1**2 / 80, rel=0.02)
    assert track.cov[1][1] == pytest.approx(0.05**2 / 80, rel=0.02)


@pytest.mark.slow
def test_claims_hold_over_flights_with_biases_drawn_from_the_priors():
    """Linear by construction: directions, noise and biases of 400 flights, every one a sample."""
    p = priors(roll=0.01, pitch=0.01, time_offset=0.01, height=0.5, position_north=1.0, position_east=1.0)
    transition = expm(0.5 * np.array([[0.0, 1.0], [-(RATE**2), -2.0 * RATE]]))
    steady = np.diag([1.0, RATE**2])
    root = np.linalg.cholesky(steady - transition @ steady @ transition.T)
    sigmas, rng, squares, inside = np.array(p.bias_sigmas), np.random.default_rng(8), [], 0
    for _ in range(400):
        standing = rng.standard_normal(BIAS_COUNT) * sigmas
        belief, errors = None, np.diag([1.0, RATE]) @ rng.standard_normal((2, 2))
        for k in range(20):
            jacobian = rng.standard_normal((3, BIAS_COUNT)) * 8.0
            jacobian[2] = 0.0
            jacobian[:, Bias.POSITION_NORTH : Bias.POSITION_DELAY] = np.eye(3)
            if k:
                errors = transition @ errors + root @ rng.standard_normal((2, 2))
            standing[[9, 10]] = errors[0]
            cov = some_cov(rng)
            sample = rng.multivariate_normal((4.0, -3.0, 0.0), cov) + jacobian @ (standing * (sigmas > 0))
            fix = a_fix(k * 0.5, sample, cov, jacobian * (sigmas > 0), sigmas)
            before = None if belief is None else belief.predict(host_ns(k * 0.5))
            belief = StaticKalman(p).initiate(fix) if before is None else before.update(fix)
        error = np.array(belief.position_ned[:2]) - (4.0, -3.0)
        squares.append(error @ np.linalg.solve(np.array(belief.cov)[:2, :2], error))
        inside += squares[-1] < chi2.ppf(0.9, 2)
    low, high = chi2.ppf([0.0005, 0.9995], 2 * 400)
    assert low < sum(squares) < high
    assert 0.85 <= inside / 400 <= 0.95


def final_track(flight, **options):
    world, best = World(flight), None
    tracker = make_tracker(TrackingOptions(**options), flight.priors, world.state_at)
    for view in world.frames():
        for track in tracker.on_frame(view):
            if track.confirmed_host_ns is not None and (best is None or track.id == best.id):
                best = track
    return best


@pytest.mark.parametrize(("fps", "seconds", "known"), [(10, 4, True), (30, 10, False)])
def test_a_hover_is_estimated_as_well_as_noise_allows(fps, seconds, known):
    """Hover, 4 m forward and 3 m right of it, 10 m, no bias in truth: the optimum is the mean of what the camera saw.

    The gain that allows for biases, too, has to come near to it: over a hover they cannot be told apart.
    """
    errors, hover = [], {"shape": "hover", "height_m": 10.0, "targets": ((4.0, 3.0),)}
    for seed in range(12):
        flight = Flight(seed=seed, seconds=seconds, fps=fps, priors=NO_BIAS if known else priors(), **hover)
        errors.append(np.hypot(*np.subtract(final_track(flight).position_ned[:2], (4.0, 3.0))))
    fixes = [fix for view in World(flight).frames() for fix in view.fixes]
    optimum = np.sqrt(np.trace(np.linalg.inv(sum(np.linalg.inv(np.array(f.noise_cov)[:2, :2]) for f in fixes))))
    assert np.sqrt(np.mean(np.square(errors))) < 1.3 * optimum


def test_gross_detections_do_not_pull_it():
    clean, dirty = [], []
    for seed in range(6):
        flight = Flight(seed=seed, seconds=6, shape="hover", height_m=10.0, targets=((4.0, 3.0),), start=(0, 0, 0.3))
        for errors, gross in ((clean, 0.0), (dirty, 0.05)):
            flight.gross = gross
            errors.append(np.hypot(*np.subtract(final_track(flight).position_ned[:2], (4.0, 3.0))))
    assert np.sqrt(np.mean(np.square(dirty))) < np.sqrt(np.mean(np.square(clean))) + 0.01


def test_the_targets_of_one_frame_are_placed_in_different_frames():
    """Ten targets at twenty frames a second: at most two of them have their place updated in one frame."""
    kalman = StaticKalman(priors(position_north=1.0, position_east=1.0))

    def seen(t, k):
        fix = a_fix(t, (3.0 * k, 0.0, 0.0))
        return replace(fix, sighting=replace(fix.sighting, index=k))

    targets = [kalman.initiate(seen(0.0, k)) for k in range(10)]
    placed = []
    for t in np.arange(1, 100) / 20.0:
        before = targets
        targets = [target.update(seen(float(t), k)) for k, target in enumerate(targets)]
        if t > 2.0:
            pairs = zip(before, targets, strict=True)
            placed.append(sum(new.placed_ns != old.placed_ns for old, new in pairs))
    assert max(placed) <= 2
    assert sum(placed) >= 20


def test_fixes_at_the_ends_of_a_quick_swing_do_not_count_as_exact():
    """There a delay has no effect to first order. At 14 Hz and 17 degrees it moves them by 1 m to second order."""
    sigma_s, squares = 0.01, []
    for seed, late_s in enumerate((0.015, -0.012)):
        biases = np.zeros(BIAS_COUNT)
        biases[Bias.TIME_OFFSET] = late_s
        flight = Flight(
            seconds=12.0, fps=15.0, shape="hover", height_m=10.0, flapping_hz=14.2, flapping_deg=17.0, pitch_deg=0.0,
            attitude_hz=100.0, targets=((1.0, -1.5),), seed=seed, biases=biases, priors=priors(time_offset=sigma_s),
        )  # fmt: skip
        track = final_track(flight)
        error = np.subtract(track.position_ned[:2], (1.0, -1.5))
        squares.append(error @ np.linalg.solve(np.array(track.cov)[:2, :2], error))
    assert max(squares) < chi2.ppf(0.999, 2), squares
