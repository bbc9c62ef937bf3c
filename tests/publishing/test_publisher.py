"""The publisher as a whole: order, timing, and that it is the same every time."""

from msgspec import to_builtins

from fwav_companion.publishing.options import PublishOptions
from fwav_companion.publishing.publisher import Publisher
from fwav_companion.types import Destination, Notice, NoticeCode, Severity, TrackState

MS = 10**6
EVERYTHING = PublishOptions(
    landing_target=True, landing_label="pad", adsb=True, cot=True, image_size=(640, 480), unit="u", rate_hz=10
)


def flight(world, options=EVERYTHING, clock_base=0):
    """Three seconds at 20 frames a second, the target seen, predicted, lost."""
    publisher, sent = Publisher(options), []
    for count in range(60):
        now = world.NOW + count * 50 * MS
        state = [TrackState.CONFIRMED, TrackState.COASTING, TrackState.DROPPED][min(count // 25, 2)]
        tracks = () if count > 50 else (world.track(at=now, state=state, with_fix=state is TrackState.CONFIRMED),)
        moment = world.situation(now=now)
        while publisher.wake_at is not None and publisher.wake_at <= now:
            sent += publisher.on_wake(publisher.wake_at, world.situation(now=publisher.wake_at))
        sent += publisher.on_tracks(tracks, moment)
    return publisher, sent


def test_every_message_of_a_flight_can_be_encoded(world):
    _, sent = flight(world)
    assert {one.name for one in sent} == {
        "LANDING_TARGET",
        "CAMERA_TRACKING_IMAGE_STATUS",
        "CAMERA_TRACKING_GEO_STATUS",
        "NAMED_VALUE_FLOAT",
        "ADSB_VEHICLE",
    }
    for one in sent:
        world.packed(one)


def test_the_same_flight_gives_the_same_messages(world):
    first, second = (to_builtins(flight(world)[1]) for _ in range(2))
    assert str(first) == str(second)


def test_landing_target_goes_first_and_with_every_frame_until_the_last_fix_is_old(world):
    publisher = Publisher(EVERYTHING)
    sent = publisher.on_tracks((world.track(),), world.situation())
    assert sent[0].name == "LANDING_TARGET"
    publisher, sent = flight(world)
    assert sum(one.name == "LANDING_TARGET" for one in sent) == 50
    assert publisher.status(world.NOW).landing.withheld == {"no_target": 10}


def test_only_the_landing_target_goes_to_the_autopilot(world):
    _, sent = flight(world)
    assert {one.name for one in sent if one.to is Destination.AUTOPILOT} == {"LANDING_TARGET"}
    assert {one.to for one in sent if one.name == "ADSB_VEHICLE"} == {Destination.GROUND_LINKS}


def test_by_default_nothing_steers_and_nothing_flies_on_the_map(world):
    publisher, sent = flight(world, PublishOptions(image_size=(640, 480)))
    assert not {"LANDING_TARGET", "ADSB_VEHICLE"} & {one.name for one in sent}
    assert publisher.datagrams() == []


def test_it_wakes_only_in_the_future_and_not_before_there_is_anything(world):
    publisher = Publisher(EVERYTHING)
    assert publisher.wake_at is None
    now = world.NOW
    publisher.on_tracks((world.track(),), world.situation())
    for _ in range(200):
        assert publisher.wake_at > now
        now = publisher.wake_at
        publisher.on_wake(now, world.situation(now=now))


def test_the_status_names_the_selected_target(world):
    publisher, _ = flight(world)
    assert publisher.status(world.NOW).selected is None
    publisher.on_tracks((world.track(77),), world.situation())
    assert publisher.status(world.NOW).selected == 77
    assert publisher.status(world.NOW).selected_by == "best"


def test_notices_reach_the_ground_with_their_code(world):
    notice = Notice(NoticeCode.SEVERAL_AUTOPILOTS, Severity.WARNING, "two autopilots", to_ground=True)
    (out,) = Publisher(EVERYTHING).on_notice(notice, world.NOW)
    assert (out.notice, out.fields["text"]) == (notice.code, notice.text)


def test_a_target_is_reported_by_notices_and_each_is_handed_out_once(world):
    publisher, _ = flight(world)
    codes = [notice.code for notice in publisher.notices()]
    assert codes == [NoticeCode.LANDING_IN_SIGHT, NoticeCode.TARGET_FOUND, NoticeCode.TARGET_LOST]
    assert publisher.notices() == []
