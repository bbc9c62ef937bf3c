"""Answers of the mock: TIMESYNC, rates, messages, parameters, commands."""

from random import Random

import numpy as np
import pytest

from sitl_mock.codec import MESSAGES


def acks(run):
    return [(ack["command"], ack["result"]) for ack in run.of("COMMAND_ACK")]


def test_timesync_is_answered_with_the_boot_clock_and_ts1_as_it_was(companion):
    run = companion("perfect", **{"uplink.delay_s": 0.004, "downlink.delay_s": 0.002})
    sent = run.flight.start_host_ns + 2_000_000_000
    run.at(2.0, "TIMESYNC", tc1=0, ts1=sent + 123).fly()
    (answer,) = (f for f in run.of("TIMESYNC") if f["tc1"] != 0)
    assert answer["ts1"] == sent + 123
    assert answer["tc1"] % 1000 == 0
    assert abs(answer["tc1"] - run.flight.clock.boot_ns(sent + 4_000_000)) < 1000


def test_round_trips_bound_the_clock_under_jitter(companion):
    run = companion("jitter_10ms", seconds=10.0)
    sent = {}
    for i in range(80):
        at = 1.0 + i * 0.1
        sent[run.flight.start_host_ns + round(at * 1e9)] = at
        run.at(at, "TIMESYNC", tc1=0, ts1=run.flight.start_host_ns + round(at * 1e9))
    run.fly()
    answers = [(now, h.fields) for now, h in run.heard if h.name == "TIMESYNC" and h.fields["tc1"]]
    assert len(answers) == 80
    for now, fields in answers:
        middle = (fields["ts1"] + now) // 2
        error = fields["tc1"] - run.flight.clock.boot_ns(middle)
        assert abs(error) <= (now - fields["ts1"]) // 2 + 2000
    assert max(now - fields["ts1"] for now, fields in answers) > 25_000_000


def test_it_asks_for_itself_and_learns_from_the_answer(companion):
    run = companion("perfect", seconds=2.0)
    heard = []

    def answer(data, now):
        replies = []
        for message in run.listener.feed(data):
            if message.name == "TIMESYNC" and message.fields["tc1"] == 0:
                heard.append(message.fields["ts1"])
                replies.append(run.speaker.frame("TIMESYNC", {"tc1": now, "ts1": message.fields["ts1"]}))
                replies.append(run.speaker.frame("TIMESYNC", {"tc1": now + 5, "ts1": message.fields["ts1"] + 1}))
        return replies

    run.on_bytes = answer
    run.fly()
    assert [ts1 % 1000 for ts1 in heard] == [1], "ArduPilot's: microseconds, and its own system id"
    (exchange,) = run.flight.vehicle.timesync.exchanges
    truth = run.flight.start_host_ns - run.flight.clock.boot_ns(run.flight.start_host_ns)
    assert exchange[1] == pytest.approx(truth, abs=100_000)


def test_px4_asks_ten_times_a_second(companion):
    assert 15 <= len(companion("px4", seconds=2.0).fly().of("TIMESYNC")) <= 20


def test_silent_clock(companion):
    run = companion("silent_clock", seconds=2.0).at(1.0, "TIMESYNC", tc1=0, ts1=77).fly()
    assert all(f["tc1"] == 0 for f in run.of("TIMESYNC"))


def test_a_foreign_speaker_answers_too_with_another_clock(companion):
    run = companion("foreign_timesync", seconds=3.0).at(2.0, "TIMESYNC", tc1=0, ts1=77).fly()
    answers = [(h.component, h.fields["tc1"]) for _, h in run.heard if h.name == "TIMESYNC" and h.fields["ts1"] == 77]
    assert sorted(component for component, _ in answers) == [1, 195]
    assert abs(answers[0][1] - answers[1][1]) > 10**13


def test_a_rate_is_accepted_up_to_the_ceiling(companion):
    run = companion("slow_loop", seconds=4.0)
    run.ask_rate(1.0, "ATTITUDE", 41.0).ask_rate(1.5, "ATTITUDE", 40.0).fly()
    assert acks(run) == [(511, 2), (511, 0)]
    times = np.array(run.times_of("ATTITUDE")) * 1e-9 - 1000.0
    assert 98 <= np.sum(times > 1.5) <= 101


def test_rates_stop_return_to_default_and_are_told(companion):
    run = companion(seconds=6.0)
    run.command(1.0, 511, 30, -1).command(3.0, 511, 30, 0).command(5.0, 510, 30).fly()
    times = np.array(run.times_of("ATTITUDE")) * 1e-9 - 1000.0
    assert np.sum((times > 1.1) & (times < 3.0)) == 0
    assert 10 <= np.sum(times > 3.0) <= 13
    assert run.of("MESSAGE_INTERVAL") == [{"message_id": 30, "interval_us": 250_000}]


def test_what_ardupilot_does_not_have_is_denied_with_a_word(companion):
    run = companion(seconds=2.0).ask_rate(1.0, "ALTITUDE", 5.0).fly()
    assert acks(run) == [(511, 2)]
    assert run.of("STATUSTEXT")[0]["text"] == "No ap_message for mavlink id (141)"


def test_px4_acknowledges_more_than_it_sends(companion):
    run = companion("px4_slow", seconds=4.0).ask_rate(1.0, "ATTITUDE", 50.0).fly()
    assert (511, 0) in acks(run)
    times = np.array(run.times_of("ATTITUDE")) * 1e-9 - 1000.0
    assert 52 <= np.sum(times > 1.05) <= 56


def test_data_streams_override_intervals(companion):
    run = companion(seconds=4.0).ask_rate(1.0, "ATTITUDE", 50.0)
    run.at(
        2.0,
        "REQUEST_DATA_STREAM",
        target_system=1,
        target_component=1,
        req_stream_id=10,
        req_message_rate=3,
        start_stop=1,
    )
    run.fly()
    times = np.array(run.times_of("ATTITUDE")) * 1e-9 - 1000.0
    assert np.sum((times > 1.0) & (times < 2.0)) > 45
    assert 5 <= np.sum(times > 2.01) <= 6


def names_between(run, from_s, to_s):
    """Rates of the autopilot's messages between two instants, hertz, by name."""
    names = [h.name for now, h in run.heard if from_s <= (now * 1e-9 - 1000.0) < to_s and h.component == 1]
    return {name: names.count(name) / (to_s - from_s) for name in names}


def request_group(run, at_s, number, rate_hz, start=1):
    fields = {"req_stream_id": number, "req_message_rate": rate_hz, "start_stop": start}
    return run.at(at_s, "REQUEST_DATA_STREAM", target_system=1, target_component=1, **fields)


def test_arducopter_streams_nothing_before_it_is_asked_and_then_by_groups(companion):
    run = request_group(companion("arducopter", seconds=9.0, **{"autopilot.arms_at_s": None}), 3.0, 0, 4)
    request_group(run, 6.0, 2, 0, start=0).fly()
    assert set(names_between(run, 0.0, 3.0)) <= {"HEARTBEAT", "TIMESYNC"}
    asked = names_between(run, 3.5, 6.0)
    for name in ("SYS_STATUS", "VFR_HUD", "BATTERY_STATUS", "RC_CHANNELS", "EKF_STATUS_REPORT", "ATTITUDE"):
        assert asked[name] == pytest.approx(4.0, abs=0.5), name
    assert "ATTITUDE_QUATERNION" not in asked, "it is in no group"
    after = names_between(run, 6.5, 9.0)
    assert "SYS_STATUS" not in after
    assert after["VFR_HUD"] == pytest.approx(4.0, abs=0.5)


def test_ardupilots_default_interval_is_its_groups_rate_and_some_messages_have_none(companion):
    run = companion("arducopter", seconds=8.0, **{"autopilot.group_rates_hz": {6: 3.0}})
    run.ask_rate(1.0, "GLOBAL_POSITION_INT", 20.0).command(2.0, 511, 33, 0).command(2.1, 510, 33)
    request_group(run, 3.0, 10, 5).ask_rate(3.1, "ATTITUDE", 50.0).command(3.2, 511, 30, 0).command(3.3, 510, 30)
    run.command(4.0, 511, 31, 0).command(4.1, 510, 31).fly()
    intervals = [(f["message_id"], f["interval_us"]) for f in run.of("MESSAGE_INTERVAL")]
    assert intervals == [(33, pytest.approx(333_333, abs=1)), (30, 200_000), (31, -1)]
    assert acks(run) == [(511, 0), (511, 0), (510, 0), (511, 0), (511, 0), (510, 0), (511, 4), (510, 0)]
    assert run.flight.vehicle.rates_hz["GLOBAL_POSITION_INT"] == 3.0


def test_arduplane_streams_each_group_once_a_second_and_lists_the_rates(companion):
    run = companion("arduplane", seconds=9.0)
    run.at(2.0, "PARAM_REQUEST_LIST", target_system=1, target_component=1).fly()
    rates = names_between(run, 1.0, 9.0)
    assert {rates[name] for name in ("SYS_STATUS", "ATTITUDE", "RAW_IMU", "VFR_HUD", "VIBRATION")} <= {1.0, 1.125}
    parameters = {f["param_id"]: f["param_value"] for f in run.of("PARAM_VALUE")}
    assert parameters["SR1_EXTRA1"] == 1.0


def test_a_copter_forgets_a_stations_groups_at_a_reboot(companion):
    run = companion("arducopter", seconds=9.0, **{"others.reboots_at_s": (4.0,)})
    request_group(run, 1.0, 0, 4).fly()
    assert names_between(run, 2.0, 4.0)["VFR_HUD"] == pytest.approx(4.0, abs=0.6)
    assert "VFR_HUD" not in names_between(run, 6.0, 9.0)


@pytest.mark.parametrize(
    ("name", "rates"),
    [
        ("px4_normal", {"ATTITUDE": 15.0, "VFR_HUD": 4.0, "RC_CHANNELS": 5.0, "SYS_STATUS": 1.0}),
        ("px4_onboard", {"ATTITUDE": 100.0, "ATTITUDE_QUATERNION": 50.0, "HIGHRES_IMU": 50.0, "ODOMETRY": 30.0}),
    ],
)
def test_px4_streams_by_its_mode_and_ignores_groups(companion, name, rates):
    run = request_group(companion(name, seconds=6.0), 1.0, 0, 2).fly()
    heard = names_between(run, 2.0, 6.0)
    assert {each: heard[each] for each in rates} == pytest.approx(rates, rel=0.1)
    assert ("ATTITUDE_QUATERNION" in heard) is (name == "px4_onboard")


def test_px4_says_minus_one_of_an_unlimited_stream_and_zero_of_a_stopped_one(companion):
    run = companion("px4_onboard", seconds=4.0).command(1.0, 510, 24).command(1.1, 511, 30, -1).command(1.2, 510, 30)
    run.command(1.3, 511, 30, 0).command(1.4, 510, 30).fly()
    intervals = [(f["message_id"], f["interval_us"]) for f in run.of("MESSAGE_INTERVAL")]
    assert intervals == [(24, -1), (30, 0), (30, 10_000)]


def test_more_parameters_are_listed_at_their_pace(companion):
    changes = {"autopilot.more_parameters": 200, "autopilot.parameter_interval_s": 0.002}
    run = companion("arducopter", seconds=3.0, **changes)
    run.at(1.0, "PARAM_REQUEST_LIST", target_system=1, target_component=1).fly()
    values = run.of("PARAM_VALUE")
    assert {f["param_id"] for f in values} >= {f"MORE_{number}" for number in range(200)}
    assert max(run.times_of("PARAM_VALUE")) * 1e-9 - 1001.0 < 0.5


def test_a_thief_takes_the_rates(companion):
    run = (
        companion("gcs_thief", seconds=4.0, **{"others.rates_stolen_every_s": 2.0})
        .ask_rate(1.0, "ATTITUDE", 50.0)
        .fly()
    )
    times = np.array(run.times_of("ATTITUDE")) * 1e-9 - 1000.0
    assert np.sum((times > 1.0) & (times < 2.0)) > 45
    assert np.sum(times > 2.01) < 10
    assert len(run.of("HEARTBEAT", system=255)) == 4


def test_where_the_command_is_unknown_the_old_way_works(companion):
    run = companion("old_rates", seconds=3.0).ask_rate(0.5, "ATTITUDE", 20.0)
    run.at(
        1.0,
        "REQUEST_DATA_STREAM",
        target_system=1,
        target_component=1,
        req_stream_id=10,
        req_message_rate=20,
        start_stop=1,
    )
    run.fly()
    assert acks(run) == [(511, 3)]
    assert np.sum(np.array(run.times_of("ATTITUDE")) * 1e-9 > 1001.0) >= 38


def test_messages_on_request(companion):
    run = companion(seconds=2.0).command(1.0, 512, 148).command(1.1, 512, 242).command(1.2, 512, 141).fly()
    assert acks(run) == [(512, 0), (512, 0), (512, 2)]
    assert run.of("AUTOPILOT_VERSION")[0]["flight_sw_version"] >> 24 == 4
    assert len(run.of("HOME_POSITION")) == 1


def test_parameters_are_read_listed_and_set(companion):
    run = companion(seconds=3.0)
    run.at(1.0, "PARAM_REQUEST_READ", target_system=1, target_component=1, param_id=b"SCHED_LOOP_RATE", param_index=-1)
    run.at(1.2, "PARAM_REQUEST_READ", target_system=1, target_component=1, param_id=b"NO_SUCH", param_index=-1)
    run.at(1.4, "PARAM_SET", target_system=1, target_component=1, param_id=b"PLND_LAG", param_value=0.08, param_type=9)
    run.at(1.6, "PARAM_REQUEST_LIST", target_system=1, target_component=1)
    run.fly()
    values = [(f["param_id"], f["param_value"]) for f in run.of("PARAM_VALUE")]
    assert values[0] == ("SCHED_LOOP_RATE", 400.0)
    assert values[1] == ("PLND_LAG", pytest.approx(0.08))
    listed = dict(values[2:])
    assert len(listed) == run.of("PARAM_VALUE")[0]["param_count"]
    assert {"PTCH_TRIM_DEG", "FLIGHT_OPTIONS", "INS_GYRO_FILTER", "PLND_LAG"} <= set(listed)


def test_every_command_is_acknowledged_and_others_commands_are_not(companion):
    run = companion(seconds=3.0).command(1.0, 9999).command(1.2, 400, 0).command(1.4, 511, float("nan"), 1.0)
    run.command(1.6, 511, 30, 20000, target=(2, 1)).command(1.8, 512, 148, target=(1, 191)).fly()
    assert acks(run) == [(9999, 3), (400, 0), (511, 2)]


def test_a_reboot_is_a_silence_and_a_clock_from_zero(companion):
    run = companion("rebooting", seconds=8.0, **{"others.reboots_at_s": (3.0,)}).ask_rate(1.0, "ATTITUDE", 50.0).fly()
    times = np.array(run.times_of("HEARTBEAT")) * 1e-9 - 1000.0
    assert not np.any((times > 3.01) & (times < 5.0))
    after = [h.fields["time_boot_ms"] for now, h in run.heard if h.name == "ATTITUDE" and now > 1005 * 10**9]
    assert after[0] < 300
    assert len(after) < 15, "its rates are the default again"


def test_a_commanded_reboot(companion):
    run = companion(seconds=4.0).command(1.0, 246, 1).fly()
    assert acks(run) == [(246, 0)]
    assert min(f["time_boot_ms"] for f in run.of("ATTITUDE")) < 500


def test_the_stamp_wraps_after_49_days(companion):
    run = companion(**{"autopilot.boot_at_start_s": 4294967.296 - 2.0, "camera.enabled": False}).fly()
    stamps = [f["time_boot_ms"] for f in run.of("ATTITUDE")]
    assert max(stamps) > 2**32 - 1000
    assert min(stamps) < 1000


def test_a_second_vehicle(companion):
    run = companion("two_vehicles", seconds=3.0).fly()
    assert len(run.of("HEARTBEAT", system=2)) == 3
    assert len(run.of("ATTITUDE", system=2)) > 20


@pytest.mark.parametrize("scenario_name", ["default", "old_ardupilot", "px4"])
def test_no_content_of_a_message_stops_it(companion, scenario_name):
    """Random payloads under valid checksums: NaN, infinities, huge numbers, ids that do not exist."""
    run = companion(scenario_name, seconds=4.0)
    rng = Random(4)
    names = ("COMMAND_LONG", "COMMAND_INT", "LANDING_TARGET", "TIMESYNC", "PARAM_SET", "REQUEST_DATA_STREAM")
    for i in range(600):
        name = rng.choice(names)
        message = MESSAGES[name]
        fields = {}
        for field, kind in zip(message.fieldnames, message.fieldtypes, strict=True):
            fields[field] = any_value(rng, kind, 4 if field == "q" else 0)
        fields.update({key: 1 for key in ("target_system", "target_component") if key in fields})
        if "command" in fields:
            fields["command"] = rng.choice((511, 512, 510, 400, 246, fields["command"]))
        run.at(0.5 + i * 0.005, name, **fields)
    run.fly()
    assert sum(run.flight.vehicle.heard.values()) > 400


def any_value(rng, kind, count):
    if kind == "char":
        return bytes(rng.randrange(32, 127) for _ in range(rng.randrange(1, 16)))
    if kind in ("float", "double"):
        choices = (float("nan"), float("inf"), -1e38, 1e38, 0.0, 30.0, 1.0, rng.gauss(0.0, 100.0))
    else:
        bits = int(kind.removeprefix("u").removeprefix("int").removesuffix("_t"))
        low, high = (0, 2**bits - 1) if kind.startswith("u") else (-(2 ** (bits - 1)), 2 ** (bits - 1) - 1)
        choices = (low, high, 0, 1, 12, rng.randint(low, high))
    return [rng.choice(choices) for _ in range(count)] if count else rng.choice(choices)
