"""`check --shake` as a user runs it: the mock in one shell, the command in another, over UDP on loopback."""

import json
import os
import socket
import time

import pytest
from frozen import hold, keys

from fwav_companion.cli.main import main

SHAKE = ("--shake", "--tag-size", "0.16")


@pytest.mark.slow
def test_a_new_user_finds_a_late_camera_and_its_crooked_mount(site):
    with site.mock("--scenario", "shake_late_and_crooked", seconds=90.0) as mock:
        mock.wait_for("sitl-mock ready")
        status, said, reported = site.check(*SHAKE, timeout_s=90)
    assert (status, reported["ok"], reported["mistakes"], reported["not_shown"]) == (0, True, [], []), said
    hold("shake", keys([reported], "shake"))
    assert reported["delay"]["time_offset_s"] == pytest.approx(0.035, abs=0.003)
    assert reported["mount"]["correction_deg"][:2] == pytest.approx([0.5, 1.0], abs=0.3)
    assert reported["mount"]["correction_deg"][2] == pytest.approx(2.0, abs=4.0 * reported["mount"]["sigma_deg"][2])
    assert "shake it in roll, pitch and a little yaw" in said
    assert "[camera.mount]" in said
    assert not (site.folder / "status.json").exists()


@pytest.mark.slow
def test_a_detector_that_sends_no_corners_is_named(site):
    with site.mock("--scenario", "unbiased") as mock:
        mock.wait_for("sitl-mock ready")
        status, said, reported = site.check(*SHAKE, "--seconds", "10")
    assert status == 1
    assert "no tag with its four corners" in reported["why"], said
    assert said.count("\n") < 12


def test_beside_a_run_it_says_what_to_do(site, capsys):
    here = {
        "time_monotonic": time.monotonic(),
        "pid": os.getpid(),
        "config_path": str(site.folder / "fwav-companion.toml"),
    }
    (site.folder / "status.json").write_text(json.dumps(here))
    words = ["check", "--config", str(site.folder / "fwav-companion.toml"), *SHAKE]
    assert main(words) == 1
    assert f"a `run` (pid {os.getpid()}) has the links" in capsys.readouterr().out


def test_a_port_in_use_is_named(site, capsys):
    with socket.socket(socket.AF_INET, socket.SOCK_DGRAM) as holder:
        holder.bind(("127.0.0.1", site.autopilot_port))
        words = ["check", "--config", str(site.folder / "fwav-companion.toml"), *SHAKE]
        assert main([*words, "--seconds", "1"]) == 1
    said = capsys.readouterr().out
    assert "in use" in said
    assert "does another program use it?" in said


@pytest.mark.parametrize(
    "words", [["--shake"], ["--tag-size", "0.16"], ["--shake", "--tag-size", "160"], ["--shake", "--tag-size", "x"]]
)
def test_wrong_usage_is_one_line_and_exit_2(site, words, capsys):
    capsys.readouterr()
    assert main(["check", "--config", str(site.folder / "fwav-companion.toml"), *words]) == 2
    assert capsys.readouterr().err.count("\n") == 1


def test_a_camera_on_a_gimbal_is_refused(site, capsys):
    site.replace("gimbal_device_id = 0", "gimbal_device_id = 154")
    site.replace("pitch_deg = -90.0", "pitch_deg = 0.0")
    capsys.readouterr()
    words = ["check", "--config", str(site.folder / "fwav-companion.toml"), *SHAKE]
    assert main(words) == 2
    assert "a gimbal undoes the shaking" in capsys.readouterr().err


def test_the_help_shows_it(capsys):
    with pytest.raises(SystemExit):
        main(["check", "--help"])
    assert "--shake --tag-size 0.16" in capsys.readouterr().out
