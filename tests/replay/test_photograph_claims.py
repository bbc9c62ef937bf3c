"""`replay --poses`: what is claimed of a fix by the errors of its picture and those that all share."""

import numpy as np
import pytest
from commands import run_command
from posed_pictures import (
    FIXED,
    TARGET,
    TERRAIN,
    WITHOUT_BIASES,
    fixes_of,
    flat_model,
    lines_of,
    moved,
    photographs,
    written,
)


def nadir_words(folder, sigmas, *, config=FIXED, head=""):
    """One picture straight down over the target, north up."""
    angles = np.array([0.0, -np.pi / 2, 0.0])
    place = moved(TARGET, (0.0, 0.0, -60.0))
    words = written(folder, [((place, angles), (place, angles))], config=config, sigmas=sigmas)
    (folder / "poses.csv").write_text(head + (folder / "poses.csv").read_text())
    return words


def test_an_attitude_error_at_the_nadir_counts_about_both_tilt_axes(tmp_path):
    run_command(*nadir_words(tmp_path, ",0,0,0.5"), *WITHOUT_BIASES, folder=tmp_path)
    cov = np.array(fixes_of(tmp_path)[0]["cov"])
    tilt = 60.0 * np.radians(0.5)
    pixel = 60.0 / 3000.0
    assert np.sqrt(np.diag(cov)[:2]) == pytest.approx([np.hypot(tilt, pixel)] * 2, rel=1e-3)


def test_a_mount_error_at_the_nadir_counts_about_both_tilt_axes(tmp_path):
    words = nadir_words(tmp_path, ",0,0,0")
    run_command(*words, *WITHOUT_BIASES, "--set", "uncertainty.mount_bias_deg=0.5", folder=tmp_path)
    tilt = np.hypot(60.0 * np.radians(0.5), 60.0 / 3000.0)
    assert np.sqrt(np.diag(np.array(fixes_of(tmp_path)[0]["cov"]))[:2]) == pytest.approx([tilt] * 2, rel=1e-3)


def test_equal_row_sigmas_average_out_over_the_pictures(tmp_path):
    """They are each picture's own; as one bias shared by all (`# sigmas: total`) they do not."""
    spread = {}
    for head in ("", "# sigmas: total\n"):
        words = written(tmp_path, photographs(40), sigmas=",1.0,0.1,0.0")
        (tmp_path / "poses.csv").write_text(head + (tmp_path / "poses.csv").read_text())
        held = ("--set", "uncertainty.position_bias_time_s=1e6")  # a bias does not wander
        done = run_command(*words, *WITHOUT_BIASES, *held, folder=tmp_path)
        assert done.returncode == 0, done.stderr
        assert ("NOTE" in done.stderr or "each picture's own" in done.stderr) == (head == "")
        spread[head] = np.sqrt(lines_of(tmp_path)[-2]["cov"][0][0])
    assert spread[""] < 0.4  # 1 / sqrt(40), and a floor for what the tracker cannot know
    assert spread["# sigmas: total\n"] > 0.9


def test_the_claim_of_a_fix_is_that_of_its_row(tmp_path):
    sigmas = (0.8, 0.5, np.radians(0.7))
    config = FIXED.replace('"fixed"', '"terrain"').replace("height_m = 60.0", TERRAIN)
    pictures = list(photographs(60, sigmas=sigmas))
    words = written(tmp_path, pictures, config=config, sigmas=",0.8,0.5,0.7")
    flat_model(tmp_path)
    done = run_command(*words, *WITHOUT_BIASES, "--set", "uncertainty.terrain_m=0.01", folder=tmp_path)
    assert done.returncode == 0, done.stderr
    errors = lines_of(tmp_path)[-1]["errors"]["fixes"]["all"]
    assert errors["samples"] == 60
    assert 0.8 < errors["rms_m"] < 2.5
    assert 1.3 < errors["nees"] < 2.8  # 2 +- 3 * 2 / sqrt(60)


def test_a_row_with_a_worse_place_claims_less_and_the_others_stay(tmp_path):
    pictures = list(photographs(4))
    words = written(tmp_path, pictures, sigmas=",0.1,0.1,0.1")
    run_command(*words, folder=tmp_path)
    before = [line["fix"]["cov"] for line in lines_of(tmp_path) if line["type"] == "target" and line["fix"]]
    rows = (tmp_path / "poses.csv").read_text().splitlines()
    rows[2] = rows[2].replace(",0.1,0.1,0.1", ",5.0,0.1,0.1")
    (tmp_path / "poses.csv").write_text("\n".join(rows))
    run_command(*words, folder=tmp_path)
    after = [line["fix"]["cov"] for line in lines_of(tmp_path) if line["type"] == "target" and line["fix"]]
    assert np.trace(np.subtract(after[1], before[1])) == pytest.approx(2 * (5.0**2 - 0.1**2), rel=1e-6)
    assert np.allclose(after[0], before[0])
    assert np.allclose(after[2:], before[2:])


@pytest.mark.parametrize("stated", [False, True])
def test_biases_of_the_pictures_source_count_unless_the_configuration_states_them(tmp_path, stated):
    words = nadir_words(tmp_path, ",0,0,0")
    text = (tmp_path / "poses.csv").read_text().splitlines()
    (tmp_path / "poses.csv").write_text(f"{text[0]},position_bias_m,mount_bias_deg\n{text[1]},2.0,0.25\n")
    more = ("--set", "uncertainty.position_bias_m=0.5", "--set", "uncertainty.mount_bias_deg=auto") if stated else ()
    done = run_command(*words, *more, folder=tmp_path)
    assert done.returncode == 0, done.stderr
    tilt, pixel, place = 60.0 * np.radians(0.25), 60.0 / 3000.0, 0.5 if stated else 2.0
    cov = np.array(fixes_of(tmp_path)[0]["cov"])
    assert np.sqrt(np.diag(cov)[:2]) == pytest.approx([np.sqrt(tilt**2 + pixel**2 + place**2)] * 2, rel=2e-3)


def test_a_heading_error_of_all_pictures_is_reported_from_several_sides(tmp_path):
    """All poses are turned by 5 degrees about the vertical: the summary says so, with its sigma."""
    turned = []
    for (place, angles), (claimed, euler) in photographs(30):
        turned.append(((place, angles), (claimed, (euler[0], euler[1], euler[2] + np.radians(5.0)))))
    config = FIXED.replace('"fixed"', '"altitude"').replace("height_m = 60.0", f"alt_amsl = {TARGET[2]}")
    done = run_command(*written(tmp_path, turned, config=config, sigmas=",0.1,0.1,0.1"), folder=tmp_path)
    assert done.returncode == 0, done.stderr
    shared = {each["error"]: each for each in lines_of(tmp_path)[-1]["shared_errors"]}
    # written there: heading_bias_deg 2, mount_bias_deg 1; the rotation about the axis of a camera that looks down is
    # shared between both in the ratio of their variances
    assert "heading" in shared or "mount_z" in shared
    together = sum(shared[name]["value"] for name in ("heading", "mount_z") if name in shared)
    assert together == pytest.approx(5.0, abs=1.5)
    assert "shared by all pictures" in done.stdout
