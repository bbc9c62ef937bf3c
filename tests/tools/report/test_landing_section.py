"""The landing of a recording: chosen messages, and what the report makes of them."""

from math import pi
from types import SimpleNamespace

import pytest
from report_lines import BEGUN, Markup, header, summary, target

from fwav_companion.tools.report import RecordedMessages, flight_data, page
from fwav_companion.types import Message

COMPANION, AUTOPILOT = 191, 1


def message(at_s, name, component=AUTOPILOT, **fields):
    return round((BEGUN + at_s) * 1e6), Message(name, 1, component, "", SimpleNamespace(**fields))


def sent(at_s, x, y, z, frame=12):
    return message(at_s, "LANDING_TARGET", COMPANION, frame=frame, x=x, y=y, z=z)


def text(at_s, words, component=AUTOPILOT):
    return message(at_s, "STATUSTEXT", component, text=words)


def mode(at_s, number, *, armed=True, autopilot=3, vehicle=2):
    base = 128 if armed else 0
    return message(at_s, "HEARTBEAT", autopilot=autopilot, type=vehicle, custom_mode=number, base_mode=base)


def attitude(at_s, yaw):
    return message(at_s, "ATTITUDE", roll=0.0, pitch=0.0, yaw=yaw)


def seen(at_s, sigma_m=0.1, **other):
    variance = sigma_m**2
    cov = [[variance, 0.0, 0.0], [0.0, variance, 0.0], [0.0, 0.0, variance]]
    relative = {"north": 0.0, "east": 0.0, "down": 3.0, "cov": cov}
    chosen = {"label": "pad", "relative": relative, "fix": {"north": 0.0, "east": 0.0}} | other
    return target(at_s, 0.0, 0.0, **chosen)


def flight(messages, lines=None):
    recorded = RecordedMessages(messages, frozenset({COMPANION}), "pad")
    return flight_data([header(), *(lines or [seen(0.0), seen(9.0)]), summary()], title="", recorded=recorded)


def steady(from_s, to_s, height_m=3.0):
    return [sent(from_s + 0.1 * k, 1.0, 0.0, height_m) for k in range(round((to_s - from_s) * 10) + 1)]


def test_vector_to_ardupilot_is_turned_by_the_attitude_before_it():
    (point,) = flight([attitude(1.0, pi / 2.0), sent(1.01, 2.0, 0.0, 5.0)]).landing.points
    assert (point.north, point.east, point.height) == pytest.approx((0.0, -2.0, 5.0))


def test_vector_to_px4_counts_from_its_own_local_position():
    own = message(1.0, "LOCAL_POSITION_NED", x=10.0, y=20.0, z=-5.0)
    (point,) = flight([own, sent(1.01, 11.0, 22.0, 0.5, frame=1)]).landing.points
    assert (point.north, point.east, point.height) == pytest.approx((-1.0, -2.0, 5.5))


def test_claim_and_sight_are_those_of_the_newest_picture():
    lines = [seen(1.0, 0.2), seen(2.0, 0.1, fix=None)]
    points = flight([attitude(0.5, 0.0), sent(1.5, 1.0, 0.0, 3.0), sent(2.5, 1.0, 0.0, 3.0)], lines).landing.points
    assert [point.radius95_m for point in points] == pytest.approx([0.2 * 2.4477, 0.1 * 2.4477], rel=1e-3)
    assert [point.seen for point in points] == [True, False]


def test_last_picture_is_the_one_before_the_pad_was_lost():
    lines = [seen(1.0), seen(2.0, fix=None)]
    shown = flight([attitude(0.5, 0.0), sent(1.5, -1.0, 0.0, 3.0), sent(2.5, -4.0, 0.0, 2.0)], lines)
    assert (shown.landing.last_seen.north, shown.landing.last_seen.height) == pytest.approx((1.0, 3.0))
    markup = Markup(page(shown))
    assert "3.00 m above the landing point" in markup.text
    north_1_m = 170.0 * (1.0 - 1.0 / 4.4)  # in a view of 4.4 m each way
    assert pytest.approx(north_1_m, abs=0.1) in [float(each["cy"]) for each in markup.of("estimate") if "cy" in each]


def test_time_without_messages_is_listed_with_the_services_own_cause():
    cause = text(3.1, "LANDING_TARGET withheld: camera 1.7 s late", COMPANION)
    shown = flight([attitude(0.5, 0.0), *steady(1.0, 2.0), cause, *steady(4.0, 5.0)])
    (pause,) = shown.landing.pauses
    assert (pause.from_s, pause.to_s, pause.why) == (pytest.approx(2.0), pytest.approx(4.0), "camera 1.7 s late")
    assert "camera 1.7 s late" in Markup(page(shown)).text


def test_time_from_the_last_message_to_the_ground_is_a_pause():
    on_ground = [mode(0.0, 9), mode(6.0, 9, armed=False)]
    (pause,) = flight(
        sorted([attitude(0.5, 0.0), *steady(1.0, 3.0), *on_ground], key=lambda each: each[0])
    ).landing.pauses
    assert (pause.from_s, pause.to_s, pause.why) == (pytest.approx(3.0), pytest.approx(6.0), "")


def test_steady_messages_have_no_pause():
    shown = flight([attitude(0.5, 0.0), *steady(1.0, 5.0)])
    assert shown.landing.pauses == []
    assert "never paused" in Markup(page(shown)).text


def test_modes_and_texts_of_both_are_listed_in_order_and_a_copy_once():
    messages = [
        mode(0.0, 5), text(0.9, "EKF3 IMU0 is using GPS"), text(1.0, "pad seen: 0.60 m ahead", COMPANION),
        text(1.2, "pad seen: 0.60 m ahead", COMPANION), *steady(1.3, 1.5), mode(2.0, 9),
        text(3.0, "PrecLand: Target Found"), mode(9.0, 9, armed=False),
        text(9.1, "landed: pad 0.04 m behind", COMPANION),
    ]  # fmt: skip
    events = [(each.by, each.text) for each in flight(messages).landing.events]
    assert events == [
        ("autopilot", "mode Loiter"), ("autopilot", "armed"), ("service", "pad seen: 0.60 m ahead"),
        ("autopilot", "mode Land"), ("autopilot", "PrecLand: Target Found"), ("autopilot", "disarmed"),
        ("service", "landed: pad 0.04 m behind"),
    ]  # fmt: skip


def test_text_before_the_first_line_is_no_copy():
    messages = [text(-0.5, "PrecLand: Target Found"), *steady(1.0, 1.2)]
    (event,) = flight(messages).landing.events
    assert (event.at_s, event.text) == (pytest.approx(-0.5), "PrecLand: Target Found")


@pytest.mark.parametrize(
    ("autopilot", "vehicle", "number", "name"),
    [(3, 2, 9, "Land"), (3, 1, 9, "9"), (12, 2, 4 << 16 | 9 << 24, "Precision land"), (12, 2, 7 << 16, "7.0")],
)
def test_mode_has_the_name_of_its_autopilot_and_vehicle(autopilot, vehicle, number, name):
    messages = [mode(0.0, number, autopilot=autopilot, vehicle=vehicle), *steady(1.0, 1.2)]
    assert flight(messages).landing.events[0].text == f"mode {name}"


def test_recording_without_landing_target_has_no_such_section():
    shown = flight([mode(0.0, 9), text(1.0, "PrecLand: Target Found")])
    assert shown.landing is None
    assert "The landing" not in page(shown)


def test_landing_without_a_known_vector_shows_its_texts_alone():
    shown = flight([*steady(1.0, 1.2), text(2.0, "PrecLand: Target Lost")])
    assert shown.landing.points == []
    assert "PrecLand: Target Lost" in Markup(page(shown)).text
