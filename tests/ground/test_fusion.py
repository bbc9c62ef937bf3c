"""The fusion against fleets whose truth was chosen first."""

from __future__ import annotations

import time
from collections import Counter
from collections.abc import Generator
from types import GeneratorType

import numpy as np
import pytest
from draws import draws_of, first_of, slow_of
from simulated_fleet import START, STEP_S, FleetOptions, SimulatedFleet

from fwav_companion.ground.fusion.association import SHARE
from fwav_companion.ground.fusion.bias_solution import finished, intersection_weights, solution_slices
from fwav_companion.ground.fusion.fleet_fusion import FRESH_S, MAX_TRACKS, MOST_NEW_TRACKS, FleetFusion
from fwav_companion.ground.fusion.registration import registered
from fwav_companion.ground.fusion.reported_tracks import ReportedTrack

INSIDE_90 = 4.605
"""NIS with 2 degrees of freedom that holds 90 %."""
SETTLES_S = 30.0


class Outcome:
    """What a number of simulated fleets gave."""

    def __init__(self, options: FleetOptions, seeds: range, seconds: float = 35.0) -> None:
        self.once = self.visible = 0
        self.fused_m: list[float] = []
        self.single_m: list[float] = []
        self.inside: list[bool] = []
        self.left_out: list[set[str]] = []
        self.texts: list[list[str]] = []
        for seed in seeds:
            self._fly(options, seed, seconds)

    def _fly(self, options: FleetOptions, seed: int, seconds: float) -> None:
        fleet, fusion = SimulatedFleet(options, seed), FleetFusion()
        for _ in fleet.run(fusion, seconds):
            if fleet.seconds >= SETTLES_S:
                once, visible = fleet.once(fusion)
                self.once, self.visible = self.once + once, self.visible + visible
        right = options.vehicles - len(options.wrong)
        for target in fusion.targets:
            if len(target.members) < min(3, right):
                continue
            (vehicle, track), *_ = target.members.items()
            truth = fleet.truth[fleet.true_target(vehicle, track)]
            error = target.position - truth
            self.fused_m.append(float(np.hypot(*error)))
            self.inside.append(float(error @ np.linalg.solve(target.cov, error)) <= INSIDE_90)
            for name, number in target.members.items():
                single = fusion.vehicles[name].tracks[number].position
                self.single_m.append(float(np.hypot(*(single - truth))))
        self.left_out.append(set(fusion.left_out))
        self.texts.append([text for _, text, _ in fusion.take_report().texts])

    @property
    def ratio(self) -> float:
        """Median error, fused over single."""
        return float(np.median(self.fused_m) / np.median(self.single_m))


@pytest.mark.parametrize("seeds", first_of(range(12), range(100)))
def test_three_vehicles_make_one_picture_that_is_better_and_honest(seeds):
    """Independent biases: the fused median is near 1 / sqrt(3) of the single ones', and claims hold."""
    outcome = Outcome(FleetOptions(claimed_shared_m=0.0), seeds)
    assert outcome.once >= 0.99 * outcome.visible
    assert outcome.ratio <= 0.7
    # Targets of one fleet share biases: 12 fleets are 12 samples, 100 give 88 to 97 %.
    low, high = (0.88, 0.97) if len(seeds) >= 100 else (0.7, 1.0)
    assert low <= np.mean(outcome.inside) <= high


@pytest.mark.timeout(1800)
@pytest.mark.parametrize("seeds", slow_of(range(12), range(100), few=1))
def test_a_shared_error_is_not_averaged_away_in_the_claim(seeds):
    outcome = Outcome(FleetOptions(shared_sigma_m=1.0, claimed_shared_m=1.0), seeds)
    assert np.mean(outcome.inside) >= 0.85


@pytest.mark.timeout(1800)
@pytest.mark.parametrize("wrong_from_s", [0.0, 12.0])
@pytest.mark.parametrize("seeds", first_of(range(8), range(60), some=0))
def test_of_three_the_wrong_one_is_named_and_left_out(seeds, wrong_from_s):
    outcome = Outcome(FleetOptions(wrong=(1,), wrong_from_s=wrong_from_s), seeds)
    assert outcome.left_out == [{"2"}] * len(seeds)
    assert outcome.once >= 0.99 * outcome.visible
    assert all(any("left out" in text for text in texts) for texts in outcome.texts)


@pytest.mark.timeout(1800)
@pytest.mark.parametrize("seeds", first_of(range(8), range(60), some=0))
def test_of_two_a_disagreement_is_reported_and_neither_is_blamed(seeds):
    outcome = Outcome(FleetOptions(vehicles=2, wrong=(1,)), seeds, seconds=20.0)
    assert outcome.left_out == [set()] * len(seeds)
    assert all(sum("disagrees" in text for text in texts) == 1 for texts in outcome.texts)


@pytest.mark.timeout(1800)
@pytest.mark.parametrize("seeds", draws_of(range(2), range(10), range(30)))
def test_ten_vehicles_with_thirty_targets(seeds):
    outcome = Outcome(FleetOptions(vehicles=10, targets=30, extent_m=120.0), seeds)
    assert outcome.once >= 0.99 * outcome.visible
    assert outcome.ratio <= 0.7


@pytest.mark.slow
def test_a_hundred_vehicles_and_the_cost_of_a_fleet(capsys):
    """2 Hz: below half a core; the curve of CPU over the number of vehicles is printed."""
    shares = {}
    for vehicles in (10, 20, 50, 100):
        options = FleetOptions(vehicles=vehicles, targets=vehicles, extent_m=30.0 * vehicles**0.5)
        fleet, fusion = SimulatedFleet(options, 1), FleetFusion()
        spent = 0.0
        steps = fleet.run(fusion, SETTLES_S)
        original = fusion.step

        def timed(now: float, original=original) -> None:
            nonlocal spent
            before = time.process_time()
            original(now)
            spent += time.process_time() - before

        fusion.step = timed  # type: ignore[method-assign]
        for _ in steps:
            pass
        shares[vehicles] = spent / SETTLES_S
        once, visible = fleet.once(fusion)
        assert once >= 0.99 * visible
    with capsys.disabled():
        print("\nvehicles  share of a core, 10 targets each, 2 Hz")
        for vehicles, share in shares.items():
            print(f"{vehicles:8d}  {share:.3f}")
    assert shares[100] < 0.5
    assert shares[100] < 40.0 * shares[10]  # ten times as many: linear, and the solution of the biases


def track(number: int, position, *, vehicle: str = "1", **changes) -> ReportedTrack:
    fields = {"label": "person", "confirmed": True, "noise": 0.04 * np.eye(2), "shared": np.zeros((2, 2))}
    jacobian = np.array([[1.0, 0.0, 0.0], [0.0, 1.0, 0.0]])
    fields |= {"jacobian": jacobian, "at_unix": START, "seen_unix": START}
    return ReportedTrack(vehicle=vehicle, track=number, position=np.array(position), **{**fields, **changes})


SIGMAS = np.array([1.0, 1.0, 0.01])


def test_the_joint_solution_is_the_whole_system_s():
    """Against the same least squares written out with all unknowns, numpy's pseudo-inverse as the oracle."""
    draw = np.random.default_rng(3)
    vehicles, targets = np.array([0, 0, 0, 1, 1, 2, 2, 2]), np.array([0, 1, 2, 0, 1, 1, 2, 3])
    tracks = [track(at, draw.normal(0.0, 5.0, 2), jacobian=draw.normal(0.0, 1.0, (2, 3))) for at in range(8)]
    positions = np.array([each.position for each in tracks])
    sigmas = draw.uniform(0.5, 2.0, (3, 3))
    solution = finished(
        solution_slices(tracks, positions, vehicles=vehicles, targets=targets, sigmas=sigmas, target_count=4)
    )
    rows, right, weights = [], [], []
    for at, each in enumerate(tracks):
        row = np.zeros((2, 17))
        row[:, 2 * targets[at] : 2 * targets[at] + 2] = np.eye(2)
        row[:, 8 + 3 * vehicles[at] : 11 + 3 * vehicles[at]] = each.jacobian
        rows.append(row)
        right.append(positions[at])
        weights.append(np.linalg.inv(each.noise + 1e-4 * np.eye(2)))
    information = sum(row.T @ weight @ row for row, weight in zip(rows, weights, strict=True))
    information[8:, 8:] += np.diag(sigmas.ravel() ** -2.0)
    cov = np.linalg.inv(information)
    mean = cov @ sum(row.T @ weight @ z for row, weight, z in zip(rows, weights, right, strict=True))
    assert solution.targets.ravel() == pytest.approx(mean[:8], abs=1e-8)
    assert solution.biases.ravel() == pytest.approx(mean[8:], abs=1e-8)
    for at in range(4):
        assert solution.target_covs[at] == pytest.approx(cov[2 * at : 2 * at + 2, 2 * at : 2 * at + 2], abs=1e-8)


def test_what_is_shared_by_all_remains_and_noise_averages():
    """K tracks with the same shared part C and noise N: C + N / K."""
    shared = np.diag([0.25, 0.5])
    tracks = [track(1, (0.0, 0.0), vehicle=str(at), shared=shared, jacobian=np.zeros((2, 3))) for at in range(4)]
    solution = finished(
        solution_slices(
            tracks,
            np.zeros((4, 2)),
            vehicles=np.arange(4),
            targets=np.zeros(4, int),
            sigmas=np.ones((4, 3)),
            target_count=1,
        )
    )
    assert solution.target_covs[0] == pytest.approx(shared + (0.04 + 1e-4) / 4 * np.eye(2), abs=1e-9)
    weights = intersection_weights(np.array([np.eye(2), 3.0 * np.eye(2)]), np.array([0, 0]), 1)
    assert weights == pytest.approx([0.75, 0.25])


def test_a_shift_is_found_though_other_targets_are_nearer():
    draw = np.random.default_rng(5)
    places = draw.uniform(0.0, 60.0, (12, 2))
    shift = np.array([9.0, -4.0])
    found = registered(places[:8] + shift, ["x"] * 8, places, ["x"] * 12, tolerance_m=0.5)
    assert found is not None
    assert found.metres == pytest.approx(shift, abs=1e-9)
    assert sorted(found.pairs) == [(at, at) for at in range(8)]
    assert registered(places[:8] + shift, ["x"] * 8, places, ["y"] * 12, tolerance_m=0.5) is None


def test_labels_stay_apart_and_equal_numbers_mean_nothing():
    fusion = FleetFusion()
    fusion.on_tracks("1", [track(7, (0.0, 0.0))], SIGMAS, START)
    fusion.on_tracks("2", [track(7, (0.2, 0.0), vehicle="2", label="car"), track(8, (40.0, 0.0), vehicle="2")],
                     SIGMAS, START)  # fmt: skip
    fusion.step(START)
    assert len(fusion.targets) == 3


def test_one_vehicle_s_two_tracks_are_never_one_target():
    fusion = FleetFusion()
    fusion.on_tracks("1", [track(1, (0.0, 0.0)), track(2, (0.5, 0.0))], SIGMAS, START)
    for step in range(20):
        fusion.on_tracks("1", [track(1, (0.0, 0.0)), track(2, (0.5, 0.0))], SIGMAS, START + step * STEP_S)
        fusion.step(START + step * STEP_S)
    assert len(fusion.targets) == 2


def test_a_silent_vehicle_s_tracks_end_and_the_others_remain():
    fusion = FleetFusion()
    for step in range(40):
        now = START + step * STEP_S
        fusion.on_tracks("1", [track(1, (0.0, 0.0))], SIGMAS, now)
        if step < 10:
            fusion.on_tracks("2", [track(1, (0.3, 0.0), vehicle="2"), track(2, (90.0, 0.0), vehicle="2")], SIGMAS, now)
        fusion.step(now)
    (target,) = fusion.targets
    assert target.members == {"1": 1}
    assert 40 * STEP_S > FRESH_S


def test_a_moving_target_is_taken_to_the_present():
    moving = track(1, (0.0, 0.0), velocity=np.array([2.0, 0.0]), at_unix=START)
    assert moving.at(START + 0.5) == pytest.approx([1.0, 0.0])
    assert moving.at(START + 9.0) == pytest.approx([2.0, 0.0])  # a velocity is not valid longer than a second


def test_the_tracks_of_one_vehicle_are_bounded():
    fusion = FleetFusion()
    fusion.on_tracks("1", [track(at, (30.0 * at, 0.0)) for at in range(1000)], SIGMAS, START)
    assert len(fusion.vehicles["1"].tracks) == MAX_TRACKS


def crowd(vehicles: int, targets: int, fusion: FleetFusion, now: float) -> None:
    """Every vehicle reports the same persons, all within half a metre."""
    draw = np.random.default_rng(8)
    places = draw.uniform(-0.25, 0.25, (targets, 2))
    for name in map(str, range(vehicles)):
        noise = draw.normal(0.0, 0.1, (targets, 2))
        fusion.on_tracks(name, [track(k, places[k] + noise[k], vehicle=name) for k in range(targets)], SIGMAS, now)


def test_step_in_slices_gives_what_a_whole_step_gives():
    whole, sliced = FleetFusion(), FleetFusion()
    for step in range(3):
        now = START + step * STEP_S
        for fusion in (whole, sliced):
            crowd(4, 12, fusion, now)
        whole.step(now)
        pauses = sum(1 for _ in sliced.slices(now))
        assert pauses >= 4, "one for each vehicle at least"
    assert [each.members for each in sliced.targets] == [each.members for each in whole.targets]
    assert len(whole.targets) == 12, "twelve tracks of one vehicle are twelve persons"


def test_report_that_comes_within_a_step_counts_after_it():
    fusion = FleetFusion()
    crowd(2, 3, fusion, START)
    slices = fusion.slices(START)
    next(slices)
    fusion.on_tracks("0", [], SIGMAS, START)
    for _ in slices:
        pass
    assert len(fusion.targets) == 3
    assert fusion.vehicles["0"].tracks == {}
    fusion.step(START + STEP_S)
    assert all("0" not in each.members for each in fusion.targets)


def test_overload_leaves_the_oldest_reports_for_a_later_step_and_says_so_once():
    fusion, vehicles, targets = FleetFusion(), 20, 64
    now = START
    crowd(vehicles, targets, fusion, now)
    for at, vehicle in enumerate(fusion.vehicles.values()):
        vehicle.heard_unix = now - 0.01 * at
    fusion.step(now)
    ((name, text, warning),) = fusion.take_report().texts
    members = {member for target in fusion.targets for member in target.members}
    assert members == {str(at) for at in range(MOST_NEW_TRACKS // targets)}, "the newest reports"
    assert name not in members
    assert warning
    assert text.startswith("the fusion is overloaded: 256 tracks of 4 vehicles wait")
    fusion.step(now + STEP_S)
    assert {member for target in fusion.targets for member in target.members} == set(map(str, range(vehicles)))
    assert fusion.take_report().texts == []


def test_a_step_pauses_after_each_share_of_a_crowded_fleet():
    """Forty vehicles with 64 coincident tracks: each stage of a step that grows with the tracks is divided."""
    fleet, draw = FleetFusion(), np.random.default_rng(4)
    places = draw.uniform(-20.0, 20.0, (64, 2))
    for k in range(3):
        now = START + k * STEP_S
        for vehicle in range(40):
            tracks = [track(at, place, vehicle=f"v{vehicle}") for at, place in enumerate(places)]
            fleet.on_tracks(f"v{vehicle}", tracks, np.array([1.0, 1.0, 0.01]), now)
        stages: Counter[str] = Counter()
        slices = fleet.slices(now)
        for _ in slices:
            stages[stage_of(slices)] += 1
    assert stages["release"] == 2 * MOST_NEW_TRACKS // SHARE, "two steps have associated as many as they may"
    assert stages["solution_slices"] >= 10
    assert stages["_associate"] == 40


def stage_of(slices: Generator[None]) -> str:
    """Name of the innermost generator that paused."""
    while isinstance(slices.gi_yieldfrom, GeneratorType):
        slices = slices.gi_yieldfrom
    return slices.gi_code.co_name
