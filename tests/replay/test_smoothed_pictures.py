"""`replay --poses` by the smoother, beside the filter: pictures with poses of their own."""

import msgspec
import numpy as np
import pytest
from posed_pictures import FIXED, TARGET, photographs, written

from fwav_companion.config import load
from fwav_companion.recording.line_types import TargetLine
from fwav_companion.recording.photograph_poses import parse_poses
from fwav_companion.recording.truth import parse_truth
from fwav_companion.replay import join_photographs, replay_photographs
from fwav_companion.service.configured_files import load_calibration

SIGMAS = (0.8, 0.5, np.radians(0.7))
ALTITUDE = FIXED.replace('"fixed"', '"altitude"').replace("height_m = 60.0", f"alt_amsl = {TARGET[2]}")


def replayed(folder, count, *, smooths, config=ALTITUDE, seed=1):
    """The lines of a replay of pictures whose poses are off by these sigmas."""
    written(folder, photographs(count, seed=seed, sigmas=SIGMAS), config=config, sigmas=",0.8,0.5,0.7")
    loaded = load(str(folder / "flight.toml"))
    poses = parse_poses((folder / "poses.csv").read_text(), "poses.csv", lambda _lat, _lon: 0.0)
    pictures = join_photographs(poses, (folder / "d.jsonl").read_bytes())
    truth = parse_truth((folder / "truth.csv").read_text(), "truth.csv")
    return list(replay_photographs(pictures, loaded, load_calibration(loaded), truth=truth, smooths=smooths))


def last_target(lines):
    return [line for line in lines if isinstance(line, TargetLine)][-1]


@pytest.mark.parametrize("seed", [1, 2, 3])
def test_forty_pictures_place_the_target_within_the_claim(tmp_path, seed):
    lines = replayed(tmp_path, 40, smooths=True, seed=seed)
    (errors,) = lines[-1].errors.targets
    assert errors.state == "found"
    assert not errors.outside95
    # the receiver's 1 m, which wanders over the five minutes; one picture's attitude alone is 0.7 m off on the ground
    assert 0.7 < np.sqrt(last_target(lines).cov[0][0]) < 1.2


def test_pictures_by_the_smoother_agree_with_the_filter(tmp_path):
    first, second = (last_target(replayed(tmp_path, 40, smooths=smooths)) for smooths in (False, True))
    assert msgspec.to_builtins(first).keys() == msgspec.to_builtins(second).keys()
    assert first.fix == second.fix
    off = np.array([first.north - second.north, first.east - second.east])
    claim = np.array(first.cov)[:2, :2] + np.array(second.cov)[:2, :2]
    assert off @ np.linalg.solve(claim, off) < 13.8
    assert np.trace(np.array(second.cov)[:2, :2]) < 1.1 * np.trace(np.array(first.cov)[:2, :2])


def test_one_picture_is_answered_with_the_claim_of_its_fix(tmp_path):
    (target,) = [line for line in replayed(tmp_path, 1, smooths=True, config=FIXED) if isinstance(line, TargetLine)]
    assert target.state == "tentative"
    assert (target.north, target.east) == pytest.approx((target.fix.north, target.fix.east), abs=1e-3)
    own = np.array(target.fix.cov)[:2, :2]
    assert np.array(target.cov)[:2, :2] == pytest.approx(own, rel=0.25, abs=0.1 * np.trace(own))
