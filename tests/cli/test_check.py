"""`check` as a user runs it: alone, while a `run` is active, on a port in use, on a line at the wrong baud rate."""

import os
import pty
import random
import signal
import socket
import threading

import pytest
from draws import first_of
from processes import STARTING_S, process

from fwav_companion.cli.main import main


def codes(report):
    return [finding["code"] for finding in report["findings"]]


def levels(report):
    return {finding["code"]: finding["level"] for finding in report["findings"]}


def test_alone_with_a_healthy_vehicle(site):
    with site.mock("--scenario", "unbiased"):
        status, said, report = site.check("--seconds", "11.0")
    assert (status, codes(report), report["ok"]) == (0, [], True), said
    assert "all is well" in said
    assert "ATTITUDE_QUATERNION" in said
    assert not (site.folder / "status.json").exists()


def test_beside_a_run_it_reads_the_status_and_opens_nothing(site):
    with site.service() as service, site.mock("--scenario", "unbiased"):
        service.wait_for("origin ")
        threading.Event().wait(6.0)  # until the requested rates are measured
        status, said, report = site.check("--seconds", "600.0")
        assert service.stop() == 0
    assert report["how"].startswith("by the status")
    assert (status, codes(report)) == (0, []), said


def test_too_short_a_time_judges_nothing(site):
    """The mock is started first: the measurement depends on the listening time alone."""
    with site.mock("--scenario", "unbiased") as mock:
        mock.wait_for("ready")
        status, said, report = site.check("--seconds", "4")
    assert (status, levels(report)) == (0, {"too_short": "NOTE"}), said


@pytest.mark.slow
def test_settings_that_spoil_every_fix_and_the_landing_are_errors(site):
    """A mount turned by 90 deg, and an autopilot that takes no LANDING_TARGET and never sees the label."""
    site.replace("yaw_deg = 0.0", "yaw_deg = 90.0")
    site.replace("landing_target = false", "landing_target = true")
    site.replace('landing_label = ""', 'landing_label = "pad"')
    settings = ("autopilot.precland_enabled=false", "autopilot.precland_yaw_align_cdeg=9000")
    with site.mock("--scenario", "unbiased", *(word for text in settings for word in ("--set", text))):
        status, said, report = site.check("--seconds", "20")
    expected = dict.fromkeys(("fixes_disagree", "landing_disabled", "landing_turned"), "ERROR")
    expected |= {"landing_label": "WARNING"}
    assert (status, levels(report)) == (1, expected), said
    (disabled,) = [finding for finding in report["findings"] if finding["code"] == "landing_disabled"]
    assert set(disabled) == {"code", "level", "where", "problem", "fix", "consequences"}
    assert "ERROR    [publish] landing_target: " + disabled["problem"] in said
    assert "yaw_deg = 0:" in said


def test_an_autopilot_that_dies_beside_a_run_is_one_finding(site):
    with site.service() as service, site.mock("--scenario", "unbiased") as mock:
        service.wait_for("origin ")
        assert mock.stop() == 0
        for _ in range(round(STARTING_S / 0.1)):
            if site.status()["autopilot_lost"]:
                break
            threading.Event().wait(0.1)
        status, said, report = site.check()
        assert service.stop() == 0
    errors = [finding for finding in report["findings"] if finding["code"] != "stale_detections"]
    assert (status, [finding["code"] for finding in errors]) == (1, ["autopilot_lost"]), said
    assert errors[0]["consequences"]
    assert "follows: " + errors[0]["consequences"][0]["where"] in said


def test_a_port_in_use_is_named_with_its_holder(site):
    with socket.socket(socket.AF_INET, socket.SOCK_DGRAM) as holder:
        holder.bind(("127.0.0.1", site.autopilot_port))
        status, said, report = site.check("--seconds", "1")
    assert status == 1
    (taken,) = [finding for finding in report["findings"] if finding["code"] == "port_taken"]
    assert f"(pid {os.getpid()})" in taken["problem"]
    assert taken["problem"] in said


def test_a_serial_line_at_the_wrong_baud_rate_is_named(site):
    ours, theirs = pty.openpty()
    site.replace(f"udpin://127.0.0.1:{site.autopilot_port}", f"serial://{os.ttyname(theirs)}:57600")
    noise, over = random.Random(2), threading.Event()

    def speak():
        while not over.wait(0.02):
            os.write(ours, noise.randbytes(100))

    speaker = threading.Thread(target=speak)
    speaker.start()
    try:
        status, said, report = site.check("--seconds", "2.0")
    finally:
        over.set()
        speaker.join()
        os.close(ours)
        os.close(theirs)
    assert status == 1
    assert codes(report)[0] == "garbage"
    assert "baud" in said


def test_a_wrong_configuration_is_one_line_and_exit_2(tmp_path, capsys):
    (tmp_path / "f.toml").write_text("[tracking]\nfiltre = 1\n")
    assert main(["check", "--config", str(tmp_path / "f.toml")]) == 2
    assert capsys.readouterr().err.count("\n") == 1


@pytest.mark.parametrize("words", [(), ("--shake", "--tag-size", "0.16")], ids=["", "shake"])
@pytest.mark.parametrize("number", first_of(signal.SIGTERM, signal.SIGHUP, signal.SIGINT))
def test_ended_from_outside_it_leaves_nothing_behind(site, tmp_path, words, number):
    socket_file, temporary = site.folder / "detections", tmp_path / "temporary"
    temporary.mkdir()
    site.replace(f"udpin://127.0.0.1:{site.detections_port}", f"unix://{socket_file}")
    before = {path.name for path in site.folder.iterdir()}
    command = ("fwav_companion", "check", "--config", "fwav-companion.toml", *words)
    with process(*command, folder=site.folder, TMPDIR=str(temporary)) as check:
        for _ in range(round(STARTING_S / 0.02)):
            if socket_file.exists():
                break
            threading.Event().wait(0.02)
        assert socket_file.exists()
        assert not any(temporary.iterdir()), "a board may be mounted read-only"
        assert check.stop(number) == 130
    assert {path.name for path in site.folder.iterdir()} == before
    assert "Traceback" not in check.said
