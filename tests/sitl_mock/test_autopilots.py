"""Autopilots of ``--autopilot``: what each sends, and what it does with requests."""

import argparse

import pytest
from pymavlink import mavutil

from sitl_mock.__main__ import main
from sitl_mock.arguments import options_from
from sitl_mock.autopilots import AUTOPILOTS
from sitl_mock.standing import sys_status


def flown(companion, name, seconds=6.0):
    return companion(**AUTOPILOTS[name][1], seconds=seconds).ask_rate(2.0, "ATTITUDE", 50.0)


def rate(run, name, from_s):
    system = run.flight.options.autopilot.system_id
    times = [(at - run.flight.start_host_ns) * 1e-9 for at in run.times_of(name, system)]
    return sum(at >= from_s for at in times) / (6.0 - from_s)


@pytest.mark.parametrize(("name", "hz"), [("inav", 10.0), ("betaflight", 10.0), ("mute", 4.0), ("ack-only", 50.0)])
def test_each_obeys_intervals_as_the_real_one_does(companion, name, hz):
    run = flown(companion, name).command(3.0, 510, 30).fly()
    assert rate(run, "ATTITUDE", 3.0) == pytest.approx(hz, rel=0.1)
    assert len(run.of("COMMAND_ACK")) == (2 if name == "ack-only" else 0)
    assert not run.of("MESSAGE_INTERVAL")
    assert bool(run.of("TIMESYNC")) is (name == "ack-only")


def test_inav_heeds_a_group_in_silence_up_to_fifty_hertz(companion):
    fields = {"req_stream_id": 10, "req_message_rate": 100, "start_stop": 1}
    run = flown(companion, "inav").at(2.5, "REQUEST_DATA_STREAM", target_system=1, target_component=1, **fields).fly()
    assert rate(run, "ATTITUDE", 3.0) == pytest.approx(50.0, rel=0.05)
    assert rate(run, "GLOBAL_POSITION_INT", 3.0) == pytest.approx(5.0, rel=0.15)


def test_betaflight_is_system_zero_component_200_in_mavlink_1_without_body_rates(companion):
    run = flown(companion, "betaflight").fly()
    senders = {(heard.system, heard.component) for _, heard in run.heard}
    assert senders == {(0, 200)}
    assert run.listener.damaged == 0
    assert {fields["autopilot"] for fields in run.of("HEARTBEAT", 0)} == {mavutil.mavlink.MAV_AUTOPILOT_GENERIC}
    assert {fields["pitchspeed"] for fields in run.of("ATTITUDE", 0)} == {0.0}
    assert run.flight.vehicle._radio._speaker.frame("SYS_STATUS", sys_status())[0] == 0xFE


def test_an_autopilot_that_does_not_exist_is_one_line_and_exit_2(tmp_path, capsys):
    assert main(["--record", str(tmp_path), "--autopilot", "inva"]) == 2
    said = capsys.readouterr().err
    assert said.count("\n") == 1
    assert "inav, betaflight, mute, ack-only" in said


def test_the_named_autopilot_replaces_the_scenarios_and_a_setting_replaces_both():
    chosen = argparse.Namespace(
        scenario="px4",
        autopilot="inav",
        seed=1,
        seconds=1.0,
        target=[],
        first_timesync_off=[],
        set=["autopilot.system_id=3"],
    )
    options = options_from(chosen, None)
    assert (options.autopilot.firmware, options.autopilot.system_id) == ("inav", 3)
