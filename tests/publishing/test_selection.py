"""Which target is the selected one, through clicks, stops, ends and replacements."""

import pytest

from fwav_companion.publishing.options import PublishOptions
from fwav_companion.publishing.selection import Selection
from fwav_companion.types import Reason, TrackState


@pytest.fixture
def tracks(world):
    return (
        world.track(4, "person", confirmed_at=world.NOW - 3 * world.S),
        world.track(2, "boat", confirmed_at=world.NOW - 8 * world.S),
        world.track(9, "person", confirmed_at=world.NOW - 5 * world.S, state=TrackState.COASTING),
        world.track(1, "person", confirmed_at=None, state=TrackState.TENTATIVE),
    )


def chosen(selection, tracks):
    selection.on_tracks(tracks)
    return selection.selected.id if selection.selected is not None else None


@pytest.mark.parametrize(
    ("options", "expected"),
    [
        (PublishOptions(), 2),
        (PublishOptions(label="person"), 9),
        (PublishOptions(label="nobody"), None),
        (PublishOptions(select="operator"), None),
    ],
)
def test_by_rule(options, expected, tracks):
    assert chosen(Selection(options), tracks) == expected


def test_of_two_confirmed_at_once_the_lower_number_is_taken(world):
    twins = (world.track(8), world.track(5))
    assert chosen(Selection(PublishOptions()), twins) == 5


@pytest.mark.parametrize("options", [PublishOptions(label="person"), PublishOptions(select="operator")])
def test_a_click_goes_before_every_rule(options, tracks):
    selection = Selection(options)
    selection.on_tracks(tracks)
    selection.click(2)
    assert chosen(selection, tracks) == 2
    assert selection.by_click


def test_after_stop_there_is_none_until_the_next_click(tracks):
    selection = Selection(PublishOptions())
    selection.on_tracks(tracks)
    selection.stop()
    assert chosen(selection, tracks) is None
    selection.click(4)
    assert chosen(selection, tracks) == 4


def test_when_the_clicked_one_ends_the_rule_is_back(world, tracks):
    selection = Selection(PublishOptions())
    selection.on_tracks(tracks)
    selection.click(4)
    ended = world.track(4, state=TrackState.DROPPED, reason=Reason.NOT_SEEN)
    assert chosen(selection, (*tracks[1:], ended)) == 2
    assert not selection.by_click


@pytest.mark.parametrize("reported", [True, False])
def test_a_click_goes_on_with_what_the_clicked_one_turned_out_to_be(world, reported):
    """The selection follows the replacement, not the nearest target; also where a late frame replaced the frame that
    reported the end.
    """
    clicked = world.track(4, position_ned=(10.0, 0.0, 0.0))
    same = world.track(2, position_ned=(10.9, 0.0, 0.0), confirmed_at=world.NOW - world.S)
    near = world.track(3, position_ned=(10.1, 0.0, 0.0), confirmed_at=world.NOW - 9 * world.S)
    selection = Selection(PublishOptions())
    selection.on_tracks((clicked, same, near))
    selection.click(4)
    replaced = world.track(4, state=TrackState.DROPPED, reason=Reason.REPLACED, replaced_by=2)
    same = world.track(2, confirmed_at=world.NOW - world.S, replaces=(5, 4))
    assert chosen(selection, (same, near, *([replaced] if reported else []))) == 2
    assert selection.by_click
