"""What an operator's click selects, and that STOP ends it."""

from math import inf, nan

import pytest
from camera_component import MS, OPTIONS, command, run

from fwav_companion.publishing.options import PublishOptions
from fwav_companion.publishing.publisher import Publisher
from fwav_companion.types import CommandResult, NoticeCode, TrackState
from fwav_companion.types.spots import SpotRefused


@pytest.fixture
def publisher():
    return Publisher(OPTIONS)


def click(publisher, world, at, x, y, radius=0.0, number=2004):
    params = (x, y, radius) if number == 2004 else (x, y, radius[0], radius[1])
    return publisher.on_command(command(number, *params), world.situation(now=at))


def show(publisher, world, at, *places):
    """A frame with track numbers at normalized places, all of equal age."""
    tracks = tuple(
        world.track(number, at=at, confirmed_at=world.NOW - world.S, fix=world.fix(pixel=pixel, box=box, at=at))
        for number, (pixel, box) in enumerate(places, start=1)
    )
    publisher.on_tracks(tracks, world.situation(now=at))


def test_a_click_selects_what_was_there_when_the_picture_was_taken(publisher, world):
    """The two swap places every 100 ms: only the picture of 300 ms ago shows which one was meant."""
    left, right = ((120.0, 240.0), None), ((520.0, 240.0), None)
    for count in range(10):
        places = (left, right) if count % 2 == 0 else (right, left)
        show(publisher, world, world.NOW + count * 100 * MS, *places)
    shown = 6  # 1 is on the left there
    answer = click(publisher, world, world.NOW + (shown * 100 + 300) * MS, 120.5 / 640, 240.5 / 480)
    assert answer.result is CommandResult.ACCEPTED
    assert publisher.selected.id == 1
    click(publisher, world, world.NOW + (7 * 100 + 300) * MS, 120.5 / 640, 240.5 / 480)
    assert publisher.selected.id == 2


def test_a_click_beside_every_target_fails_and_says_so(publisher, world):
    show(publisher, world, world.NOW, ((120.0, 240.0), None))
    answer = click(publisher, world, world.NOW + 300 * MS, 0.8, 0.5)
    assert answer.result is CommandResult.FAILED
    (text,) = answer.messages
    assert (text.name, text.notice, text.link) == ("STATUSTEXT", NoticeCode.CLICK_WITHOUT_TARGET, "ground")
    assert NoticeCode.CLICK_WITHOUT_TARGET in [notice.code for notice in publisher.notices()]


def test_a_click_of_a_time_without_a_picture_fails(publisher, world):
    show(publisher, world, world.NOW, ((120.0, 240.0), None))
    assert click(publisher, world, world.NOW + 600 * MS, 0.2, 0.5).result is CommandResult.FAILED


def test_a_delay_that_is_not_exact_still_hits_and_a_tie_is_refused(publisher, world):
    """The target crosses the picture; 100 ms off it is a quarter of the picture away."""
    for count in range(11):
        show(publisher, world, world.NOW + count * 50 * MS, ((60.0 + 52.0 * count, 240.0), None))
    assert click(publisher, world, world.NOW + 600 * MS, 268.5 / 640, 240.5 / 480).result is CommandResult.ACCEPTED
    assert publisher.selected.id == 1
    publisher.on_command(command(2010), world.situation())
    both = ((200.0, 240.0), None), ((210.0, 240.0), None)
    for count in range(10):
        seen = both if count % 2 else (((600.0, 20.0), None), ((600.0, 460.0), None))
        show(publisher, world, world.NOW + (1000 + count * 100) * MS, *seen)
    answer = click(publisher, world, world.NOW + (1400 + 300) * MS, 205.5 / 640, 240.5 / 480)
    assert answer.result is CommandResult.FAILED
    assert answer.messages[0].notice is NoticeCode.CLICK_AMBIGUOUS


class FollowsAnything:
    """Takes every order."""

    def __init__(self):
        self.ordered = []

    def follow(self, point, host_ns, sigma_px):
        self.ordered.append((point, host_ns, sigma_px))
        return 7

    def release_all(self):
        self.ordered.clear()


def test_a_click_where_no_track_is_follows_the_spot_and_selects_its_track(world):
    spots = FollowsAnything()
    publisher = Publisher(OPTIONS, spots=spots)
    show(publisher, world, world.NOW, ((120.0, 240.0), None))
    assert click(publisher, world, world.NOW + 300 * MS, 0.8, 0.5).result is CommandResult.ACCEPTED
    assert spots.ordered == [((511.5, 239.5), world.NOW, pytest.approx(19.2))]
    assert publisher.selected is None
    seen = world.fix(pixel=(511.5, 239.5), at=world.NOW + world.S, label="click", detector_id=7)
    of_spot = world.track(9, "click", at=world.NOW + world.S, confirmed_at=world.NOW + world.S, fix=seen)
    other = world.track(1, at=world.NOW + world.S, confirmed_at=world.NOW - world.S)
    publisher.on_tracks((other, of_spot), world.situation(now=world.NOW + world.S))
    assert publisher.selected.id == 9
    publisher.on_tracks((other,), world.situation(now=world.NOW + 2 * world.S))
    assert publisher.selected is None, "the spot is out of view, and no other target is chosen"
    again = world.track(12, "click", at=world.NOW + 3 * world.S, confirmed_at=world.NOW + 3 * world.S, fix=seen)
    publisher.on_tracks((other, again), world.situation(now=world.NOW + 3 * world.S))
    assert publisher.selected.id == 12
    publisher.on_command(command(2010), world.situation())
    assert spots.ordered == []


def test_a_spot_that_cannot_be_followed_is_reported_and_the_choice_is_as_before(world):
    publisher = Publisher(OPTIONS, spots=FollowsAnything())
    show(publisher, world, world.NOW, ((120.0, 240.0), None))
    click(publisher, world, world.NOW + 300 * MS, 0.8, 0.5)
    publisher.on_spot_refused(SpotRefused(7, "no_texture"))
    assert NoticeCode.CLICK_REFUSED in [notice.code for notice in publisher.notices()]
    assert publisher.selected.id == 1


def test_the_box_is_the_target_and_the_radius_widens_the_click(publisher, world):
    show(publisher, world, world.NOW, ((120.0, 240.0), (100.0, 60.0, 140.0, 260.0)))
    at = world.NOW + 300 * MS
    assert click(publisher, world, at, 120 / 640, 70 / 480).result is CommandResult.ACCEPTED
    assert click(publisher, world, at, 220 / 640, 240 / 480).result is CommandResult.FAILED
    assert click(publisher, world, at, 220 / 640, 240 / 480, radius=0.2).result is CommandResult.ACCEPTED


def test_a_rectangle_takes_the_target_nearest_to_its_middle_however_it_was_drawn(publisher, world):
    show(publisher, world, world.NOW, ((120.0, 240.0), None), ((300.0, 240.0), None))
    at = world.NOW + 300 * MS
    answer = click(publisher, world, at, 0.7, 0.9, (0.1, 0.2), number=2005)
    assert answer.result is CommandResult.ACCEPTED
    assert publisher.selected.id == 2
    assert click(publisher, world, at, 0.8, 0.1, (0.9, 0.2), number=2005).result is CommandResult.FAILED


@pytest.mark.parametrize("point", [(nan, 0.5), (0.5, nan), (-0.1, 0.5), (0.5, 1.1), (inf, 0.5)])
def test_a_click_outside_the_picture_is_invalid(publisher, world, point):
    assert click(publisher, world, world.NOW, *point).result is CommandResult.DENIED
    assert click(publisher, world, world.NOW, *point, (0.6, 0.6), number=2005).result is CommandResult.DENIED


def test_between_pictures_the_ground_decides(world):
    asked = []

    def locate(u, v, sigma_px, host_ns):
        asked.append((u, v, host_ns))
        return world.fix((4.2, 2.9, 0.0))

    publisher = Publisher(OPTIONS, locate)
    far = world.track(1, position_ned=(40.0, 3.0, 0.0), confirmed_at=world.NOW - 9 * world.S)
    publisher.on_tracks((far, world.track(2)), world.situation())
    answer = click(publisher, world, world.NOW + 2 * world.S, 0.5, 0.5)
    assert answer.result is CommandResult.ACCEPTED
    assert publisher.selected.id == 2
    assert asked == [(319.5, 239.5, world.NOW + 1700 * MS)]


@pytest.mark.parametrize("place", [None, (9.0, 3.0, 0.0)])
def test_ground_without_a_target_is_answered_so(world, place):
    publisher = Publisher(OPTIONS, lambda *_: world.fix(place) if place is not None else None)
    publisher.on_tracks((world.track(),), world.situation())
    assert click(publisher, world, world.NOW + 2 * world.S, 0.5, 0.5).result is CommandResult.FAILED


def test_without_a_calibrated_camera_nothing_can_be_clicked(world):
    answer = click(Publisher(PublishOptions()), world, world.NOW, 0.5, 0.5)
    assert answer.result is CommandResult.FAILED


def test_a_tentative_track_cannot_be_clicked(publisher, world):
    publisher.on_tracks((world.track(state=TrackState.TENTATIVE),), world.situation())
    assert click(publisher, world, world.NOW + 300 * MS, 0.5, 0.5).result is CommandResult.FAILED


def test_stop_ends_the_statuses_with_idle(publisher, world):
    run(publisher, world, 0.3, (1,))
    assert publisher.on_command(command(2010), world.situation()).result is CommandResult.ACCEPTED
    sent = run(publisher, world, 1.0, (1,), start=world.NOW + world.S)
    assert [one.fields["tracking_status"] for one in sent] == [0, 0, 0]
    assert publisher.status(world.NOW).selected is None
