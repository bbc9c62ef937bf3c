"""What the pilot reads of LANDING_TARGET that is withheld, and what the status counts of it."""

from itertools import pairwise

import numpy as np
import pytest
from msgspec import structs

from fwav_companion.publishing.landing import Landing
from fwav_companion.publishing.options import PublishOptions

OPTIONS = PublishOptions(landing_target=True, landing_label="pad")


class Pilot:
    """What the pilot reads, with the instants."""

    def __init__(self, world, **options):
        self.world, self.texts, self.now = world, [], world.NOW
        options = structs.replace(OPTIONS, **options)
        self.landing = Landing(options, notify=lambda notice: self.texts.append((self.now, notice)))
        self.landing.lag_s = 0.0

    def frame(self, after_s, sigma_m=0.1, late_s=0.0):
        self.now += round(after_s * self.world.S)
        at = self.now - round(late_s * self.world.S)
        track = self.world.track(at=at, relative_cov=self.world.diagonal(sigma_m, sigma_m, sigma_m))
        self.landing.on_tracks((track,), self.world.situation(self.now, vehicle=self.world.state(self.now)))

    def said(self):
        return [notice.text for _, notice in self.texts]


def test_pilot_reads_at_once_why_landing_target_is_withheld_and_when_it_flows_again(world):
    pilot = Pilot(world)
    for _ in range(10):
        pilot.frame(0.1)
    for _ in range(20):
        pilot.frame(0.1, sigma_m=0.62)
    assert pilot.said() == ["LANDING_TARGET withheld: target 0.62 m, limit 0.50"]
    assert 1.0 < (pilot.texts[0][0] - world.NOW) / world.S - 1.0 <= 1.3
    for _ in range(60):
        pilot.frame(0.1, sigma_m=0.2)
    assert pilot.said()[1:] == ["LANDING_TARGET is sent: target 0.20 m"]
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
    assert pilot.said() == []


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
