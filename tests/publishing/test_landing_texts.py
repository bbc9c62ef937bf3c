"""What the pilot reads of LANDING_TARGET that is withheld, and what the status counts of it."""

from itertools import pairwise

import numpy as np
import pytest
from landing_options import OPTIONS
from msgspec import structs

from fwav_companion.publishing.landing import Landing

SEEN = "pad seen: 4.00 m ahead, 3.00 m right, 95 % 0.24 m"
"""The pad 4 m north and 3 m east of a vehicle that heads north, known to 0.1 m (one sigma)."""


class Pilot:
    """What the pilot reads, with the instants."""

    def __init__(self, world, **options):
        self.world, self.texts, self.now = world, [], world.NOW
        options = structs.replace(OPTIONS, **options)
        self.landing = Landing(options, notify=lambda notice: self.texts.append((self.now, notice)))
        self.landing.lag_s = 0.0

    def frame(self, after_s, sigma_m=0.1, late_s=0.0, unseen_s=0.0, **vehicle):
        self.now += round(after_s * self.world.S)
        at = self.now - round(late_s * self.world.S)
        track = self.world.track(
            at=at,
            relative_cov=self.world.diagonal(sigma_m, sigma_m, sigma_m),
            last_seen_host_ns=at - round(unseen_s * self.world.S),
        )
        self.landing.on_tracks((track,), self.world.situation(self.now, vehicle=self.world.state(self.now, **vehicle)))

    def said(self):
        return [notice.text for _, notice in self.texts]


def test_pilot_reads_at_once_why_landing_target_is_withheld_and_when_it_flows_again(world):
    pilot = Pilot(world)
    for _ in range(10):
        pilot.frame(0.1)
    for _ in range(20):
        pilot.frame(0.1, sigma_m=0.62)
    assert pilot.said()[1:] == ["LANDING_TARGET withheld: target 0.62 m, limit 0.50"]
    assert 1.0 < (pilot.texts[1][0] - world.NOW) / world.S - 1.0 <= 1.3
    for _ in range(60):
        pilot.frame(0.1, sigma_m=0.2)
    assert pilot.said()[2:] == ["LANDING_TARGET is sent: target 0.20 m"]
    assert all(len(text) <= 50 for text in pilot.said())


def test_pilot_reads_how_late_the_camera_is(world):
    pilot = Pilot(world)
    for _ in range(5):
        pilot.frame(0.1)
    for _ in range(20):
        pilot.frame(0.1, late_s=1.7)
    assert "LANDING_TARGET withheld: camera 1.7 s late" in pilot.said()


def test_pilot_reads_nothing_of_a_gap_below_a_second(world):
    pilot = Pilot(world)
    for sigma_m in (0.1, 0.7, 0.7, 0.1, 0.7, 0.1) * 10:
        pilot.frame(0.3, sigma_m=sigma_m)
    assert pilot.said() == [SEEN]


def test_pilot_gets_at_most_one_text_in_five_seconds(world):
    pilot = Pilot(world)
    for k in range(600):
        pilot.frame(0.1, sigma_m=0.2 if (k // 15) % 2 else 0.8)
    at_s = [at / world.S for at, _ in pilot.texts]
    assert len(at_s) >= 6
    assert min(np.diff(at_s)) >= 5.0
    codes = [notice.code for _, notice in pilot.texts]
    assert all(one is not other for one, other in pairwise(codes)), "withheld, sent, withheld"


def test_status_counts_each_reason_and_how_long_it_lasts(world):
    pilot = Pilot(world)
    for _ in range(5):
        pilot.frame(0.1)
    for _ in range(8):
        pilot.frame(0.1, sigma_m=0.9)
    status = pilot.landing.status(pilot.now)
    assert (status.sent, status.withheld, status.last_withheld) == (5, {"too_uncertain": 8}, "too_uncertain")
    assert status.withheld_s == pytest.approx(0.7)


def test_pilot_reads_the_offset_along_the_heading_and_the_95_percent_claim_at_the_first_sight(world):
    pilot = Pilot(world)
    for _ in range(20):
        pilot.frame(0.1)
    assert pilot.said() == [SEEN]
    turned = Pilot(world)
    turned.frame(0.1, sigma_m=0.2, q=world.quaternion(yaw_deg=90.0), position=(-6.5, 15.3, -3.0))
    assert turned.said() == ["pad seen: 12 m behind, 11 m left, 95 % 0.49 m"]
    assert all(len(notice.text) <= 50 for _, notice in pilot.texts + turned.texts)


def test_pilot_reads_that_the_pad_is_lost_after_a_second_and_seen_again(world):
    pilot = Pilot(world)
    for _ in range(10):
        pilot.frame(0.1)
    for k in range(1, 15):
        pilot.frame(0.1, unseen_s=0.1 * k)
    assert pilot.said()[1:] == ["pad lost: not seen for 1.1 s"]
    assert pilot.landing.sent == 24, "its prediction is sent for another half second"
    for _ in range(60):
        pilot.frame(0.1)
    assert pilot.said()[2:] == [SEEN]


def test_pilot_reads_that_pictures_stopped_as_the_cause_of_the_loss(world):
    pilot = Pilot(world)
    for _ in range(10):
        pilot.frame(0.1)
    for _ in range(8):
        pilot.now += round(0.2 * world.S)
        pilot.landing.on_wake(world.situation(pilot.now, vehicle=world.state(pilot.now)))
    assert pilot.said()[1:] == ["pad lost: no picture for 1.2 s"]


def test_late_camera_that_shows_the_pad_in_every_picture_has_not_lost_it(world):
    pilot = Pilot(world)
    for _ in range(30):
        pilot.frame(0.1, late_s=1.3)
    assert [text for text in pilot.said() if "lost" in text] == []


def test_pilot_reads_where_the_pad_was_in_the_last_message_before_the_landing(world):
    pilot = Pilot(world)
    pilot.frame(0.1, position=(4.04, 2.98, -0.5))
    pilot.now += 3 * world.S
    pilot.landing.on_disarmed(pilot.now)
    assert pilot.said()[1:] == ["landed: pad 0.04 m behind, 0.02 m right, 3 s ago"]
    status = pilot.landing.status(pilot.now)
    assert status.landed_offset_m == pytest.approx((-0.04, 0.02))
    assert status.offset_m is None
    assert len(pilot.said()[1]) <= 50


@pytest.mark.parametrize(("after_s", "height_m"), [(16.0, 0.5), (1.0, 3.5)])
def test_vehicle_that_disarms_long_after_the_last_look_or_from_high_above_did_not_land_on_it(world, after_s, height_m):
    pilot = Pilot(world)
    pilot.frame(0.1, position=(4.0, 3.0, -height_m))
    pilot.landing.on_disarmed(pilot.now + round(after_s * world.S))
    assert [text for text in pilot.said() if "landed" in text] == []
    assert pilot.landing.status(pilot.now).landed_offset_m is None


def test_vehicle_that_disarms_without_a_message_says_nothing(world):
    pilot = Pilot(world)
    pilot.landing.on_disarmed(pilot.now)
    assert pilot.said() == []


def test_status_has_the_offset_of_the_newest_message_and_its_age(world):
    pilot = Pilot(world)
    assert pilot.landing.status(pilot.now).offset_m is None
    pilot.frame(0.1)
    status = pilot.landing.status(pilot.now + world.S)
    assert status.offset_m == pytest.approx((4.0, 3.0, 10.0))
    assert status.offset_age_s == pytest.approx(1.0)
