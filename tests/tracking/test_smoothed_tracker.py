"""The tracker by the smoother: a whole flight, its pairs' joint gate, its input, and returns to an earlier state."""

from types import SimpleNamespace

import msgspec
import numpy as np
import pytest

from fwav_companion.config.estimation import UncertaintyConfig
from fwav_companion.estimation.errors import (
    BODY_SHARED,
    CAMERA_DELAY,
    GIMBAL_DELAY,
    GIMBAL_HEADING,
    HEADING,
    LEVER,
    MOUNT,
    POSITION_DELAY,
    READOUT,
    priors,
)
from fwav_companion.estimation.frame_prediction import FramePrediction, pair_distances
from fwav_companion.geometry.stamps import BootNs
from fwav_companion.recording.line_types import CalibrationLine, TargetLine
from fwav_companion.self_calibration import KeptCalibration
from fwav_companion.telemetry.hermite_series import HermiteSeries
from fwav_companion.tracking.smoothed.flight_errors import shared_priors
from fwav_companion.tracking.smoothed.flight_samples import sightings_of
from sitl_mock import Simulation
from tests.accuracy.flights import plan_of, recording_of, replayed
from tests.accuracy.scores import Tracks


@pytest.fixture(scope="module")
def flight(tmp_path_factory):
    """A figure eight with a camera that is 35 ms late and crooked, and both estimators' lines."""
    plan = plan_of("eight_late_and_crooked", 1)
    recording = recording_of(plan, tmp_path_factory.mktemp("flights"))
    return plan, recording, {name: list(replayed(plan, recording, name)) for name in ("plain", "third")}


def score(flight, name):
    plan, recording, lines = flight
    tracks = Tracks(Simulation(plan.options), plan.landmarks)
    for line in lines[name]:
        if isinstance(line, TargetLine | CalibrationLine):
            tracks.add(line)
    return tracks.score(recording.in_view, recording.first_seen_s, cpu_s=0.0, seed=1)


def test_smoother_places_the_target_far_better_than_the_filter_that_considers_the_priors(flight):
    plain, third = score(flight, "plain"), score(flight, "third")
    assert third.relative.rms_m < 0.2 * plain.relative.rms_m
    assert third.relative.rms_m < 0.05
    assert third.relative.square < 4.0


def test_smoother_begins_one_track_for_the_one_target(flight):
    third = score(flight, "third")
    assert (third.missed, third.ghosts) == (0, 0)


def test_calibration_lines_give_the_planted_delay_as_a_correction_of_the_configuration(flight):
    last = [line for line in flight[2]["third"] if isinstance(line, CalibrationLine)][-1]
    assert last.time_offset_s == pytest.approx(0.035, abs=4 * last.time_offset_sigma_s)
    assert last.time_offset_sigma_s < 0.005


def test_replay_by_the_smoother_gives_the_same_lines_again(flight):
    plan, recording, lines = flight
    assert list(replayed(plan, recording, "third")) == lines["third"]


def test_summary_has_the_target_by_the_whole_flight_within_its_claim(flight):
    plan, _, lines = flight
    summary = lines["third"][-1]
    live = [line for line in lines["third"] if isinstance(line, TargetLine) and line.state == "confirmed"][-1]
    (final,) = summary.final
    truth = Simulation(plan.options).world.place(Simulation(plan.options).scene[0].at(0.0))
    off = np.array([final.lat - truth.lat, (final.lon - truth.lon) * np.cos(np.radians(truth.lat))]) * 111_194.0
    assert off @ np.linalg.solve(np.array(final.cov)[:2, :2], off) < 18.0
    assert (final.track, final.label) == (live.track, live.label)
    assert (final.down, final.cov[2][2]) == (live.down, live.cov[2][2])
    assert lines["plain"][-1].final is None


def shifted_alike(displacements):
    """Targets in a row, each displaced; a shared error of 3 along the row, noise of 1; every detection with each."""
    count = len(displacements)
    detection, target = (a.ravel() for a in np.meshgrid(range(count), range(count), indexing="ij"))
    places = 4.0 * np.arange(count)
    residual = places[detection] + np.array(displacements)[detection] - places[target]
    m = len(detection)
    covariance = np.zeros((2 * m, 2 * m))
    covariance[:m, :m] = 9.0 + (detection[:, None] == detection)
    covariance[m:, m:] = detection[:, None] == detection
    residual = np.concatenate([residual, np.zeros(m)])
    covariance += 1e-6 * np.eye(2 * m)
    distance2, log_det = pair_distances(residual, covariance)
    return FramePrediction(detection, target, residual, covariance, distance2, log_det, np.ones(m, np.bool_))


def test_pair_that_a_shared_error_explains_is_nearer_than_its_neighbour_given_a_certain_pair():
    frame = shifted_alike([4.0, 4.0, 4.0])  # by one place: alone, each detection agrees with the next target
    known = np.flatnonzero((frame.detection == 0) & (frame.target == 0))
    own = np.flatnonzero((frame.detection == 1) & (frame.target == 1))
    wrong = np.flatnonzero((frame.detection == 1) & (frame.target == 2))
    assert frame.distance2[wrong] < frame.distance2[own]
    given = frame.given(known)
    assert given.distance2[own] < given.distance2[wrong]


def test_given_covariance_is_the_conditional_one():
    frame = shifted_alike([1.0, -1.0])
    given = frame.given(np.array([0]))
    s, rows = frame.covariance, [0, 4]
    inverse = np.linalg.inv(
        s[np.ix_([3, 7, *rows], [3, 7, *rows])]
    )  # of pair 3 and pair 0; oracle: the precision's block
    assert given.covariance[np.ix_([3, 7], [3, 7])] == pytest.approx(np.linalg.inv(inverse[:2, :2]), abs=1e-9)


def test_tangents_standardise_a_pixel_error_of_one_sigma():
    ray, by_u, by_v = np.array([0.0, 0.0, 1.0]), np.array([0.002, 0.0003, 0.0]), np.array([-0.0002, 0.003, 0.0])
    sighting = SimpleNamespace(
        boot_ns=BootNs(2_000_000_000), row_fraction=0.25, body_from_camera=((0, -1, 0), (1, 0, 0), (0, 0, 1)),
        state=SimpleNamespace(gimbal=None),
        ray=SimpleNamespace(direction=tuple(ray), d_du=tuple(by_u), d_dv=tuple(by_v)), pixel_sigma=(4.0, 2.0),
    )  # fmt: skip
    found = sightings_of(7, [SimpleNamespace(sighting=sighting)])
    turned = np.array(sighting.body_from_camera) @ (4.0 * by_u - 2.0 * by_v)
    assert found.tangents[..., 0] @ turned == pytest.approx([1.0, -1.0])
    assert (found.t[0], found.row[0], found.frame[0]) == (2.0, 0.25, 7)


UNCERTAIN = SimpleNamespace(sigma=lambda bias: 1.0, gimbal=None)


def kept(**more):
    return KeptCalibration(
        time_offset_s=0.02, time_offset_sigma_s=0.003, mount=(0.1, 0.0, -0.2), mount_sigma=(0.01,) * 3, **more
    )


def test_kept_mount_is_the_opposite_of_an_error_and_widened():
    found = shared_priors(UNCERTAIN, kept())
    assert found.mean[CAMERA_DELAY] == 0.02
    assert found.mean[MOUNT] == pytest.approx([-0.1, 0.0, 0.2])
    assert found.sigma[CAMERA_DELAY] == pytest.approx(np.hypot(0.003, 0.002))
    assert found.sigma[MOUNT] == pytest.approx(np.hypot(0.01, np.radians(0.2)), rel=0.01)
    assert len(priors()) == len(found) == BODY_SHARED


def test_parameter_that_an_earlier_version_did_not_keep_has_its_prior():
    found = shared_priors(UNCERTAIN, kept())
    assert found.sigma[[READOUT, POSITION_DELAY, *range(LEVER.start, LEVER.stop)]].tolist() == [1.0] * 5
    newer = kept(position_delay_s=0.1, position_delay_sigma_s=0.01, lever_m=(0.1, 0.0, 0.0), lever_sigma_m=(0.02,) * 3)
    found = shared_priors(UNCERTAIN, newer)
    assert found.mean[POSITION_DELAY] == 0.1
    assert found.mean[LEVER].tolist() == [0.1, 0.0, 0.0]
    assert found.sigma[LEVER].tolist() == [0.02] * 3


def test_kept_calibration_of_an_earlier_version_is_read():
    text = b'{"time_offset_s":0.02,"time_offset_sigma_s":0.003,"mount":[0.1,0.0,-0.2],"mount_sigma":[0.01,0.01,0.01]}'
    assert msgspec.json.decode(text, type=KeptCalibration) == kept()
    assert kept().is_sound


@pytest.mark.parametrize(
    "more", [{"position_delay_s": 0.1}, {"lever_m": (0.0,) * 3, "lever_sigma_m": (0.0,) * 3},
             {"position_delay_s": float("nan"), "position_delay_sigma_s": 0.1}]
)  # fmt: skip
def test_kept_calibration_with_half_a_value_is_not_sound(more):
    assert not kept(**more).is_sound


def test_gimbal_has_two_more_parameters_that_are_counted_once():
    table = UncertaintyConfig(heading_bias_deg=2.0, time_offset_sigma_s=0.01)
    fixed = shared_priors(table.priors(readout_known=True, surveyed=False), None)
    found = shared_priors(table.priors(readout_known=True, surveyed=False, gimbal_yaw_deg=3.0), None)
    assert found.sigma[[GIMBAL_HEADING, GIMBAL_DELAY]] == pytest.approx([np.radians(3.0), 0.05])
    assert found.sigma[[HEADING, CAMERA_DELAY]] == pytest.approx([np.radians(2.0), 0.01])
    assert fixed.sigma[[HEADING, CAMERA_DELAY]] == pytest.approx([np.radians(2.0), 0.01])


def test_positions_after_a_jump_begin_a_new_piece():
    series = HermiteSeries()
    for k in range(4):
        series.insert(BootNs(k * 100_000_000), (float(k),), (0.0,))
    series.split_at(BootNs(200_000_000))
    later = series.times_after(BootNs(0))
    assert [(t // 100_000_000, series.begins_piece(t)) for t in later] == [(1, False), (2, True), (3, False)]
