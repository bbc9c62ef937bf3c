"""Rates of the autopilot's messages on each link, case by case."""

from __future__ import annotations

from math import inf

import pytest

from fwav_companion.geometry.stamps import NS_PER_S, HostNs
from fwav_companion.mavlink.router.station_rates import (
    FORGOTTEN_NS,
    MAX_ASKERS,
    MAX_RATES,
    ONCE_NS,
    AskedRates,
    MergedRates,
)
from fwav_companion.mavlink.wire.rate_messages import OwnStreams, RateRequest
from sitl_mock.codec import NUMBERS

T0 = HostNs(1000 * NS_PER_S)
ATTITUDE, QUATERNION, POSITION = (NUMBERS[name] for name in ("ATTITUDE", "ATTITUDE_QUATERNION", "GLOBAL_POSITION_INT"))
HUD, PARAM_VALUE, HOME = (NUMBERS[name] for name in ("VFR_HUD", "PARAM_VALUE", "HOME_POSITION"))


def request(rates, link="ground", system=255, target=(1, 1), once=None, source=""):
    return RateRequest(
        system=system, component=190, link=link, target_system=target[0], target_component=target[1], rates=rates,
        once=once, source=source,
    )  # fmt: skip


class Table:
    """Two links, and our own requests."""

    def __init__(self, *, stated=True, **before_hz):
        self.rates = MergedRates(["ground", "tablet"])
        own = {NUMBERS[name]: hz for name, hz in before_hz.items()}
        self.rates.share(OwnStreams(1, 1, own, frozenset(own) if stated else frozenset()), 1)

    def ask(self, now=T0, **how):
        return self.rates.note(request(**how), 1, now)

    def cap(self, msgid, link="ground"):
        cap = self.rates.links[link].caps.get(msgid)
        return None if cap is None else (cap.hz, str(cap.why))


def test_what_only_we_asked_for_does_not_leave():
    table = Table(GLOBAL_POSITION_INT=0.0, ATTITUDE_QUATERNION=0.0)
    assert table.cap(POSITION) == (0.0, "only_ours")
    assert table.cap(QUATERNION) == (0.0, "only_ours")


def test_what_is_not_asked_for_passes():
    assert Table().cap(HUD) is None


def test_attitude_of_a_stated_rate_that_is_not_asked_for_passes_at_four_hertz_at_most():
    assert Table(ATTITUDE=100.0, ATTITUDE_QUATERNION=50.0).cap(QUATERNION) == (4.0, "attitude")
    assert Table(ATTITUDE=100.0).cap(ATTITUDE) == (4.0, "attitude")
    assert Table(ATTITUDE=1.0).cap(ATTITUDE) == (1.0, "attitude")
    assert Table(ATTITUDE=0.0).cap(ATTITUDE) == (4.0, "attitude"), "where only we asked for it"


def test_attitude_that_this_service_knows_nothing_about_passes_as_it_comes():
    assert Table().cap(ATTITUDE) is None


def test_without_a_stated_rate_nothing_is_thinned_below_the_measured_one():
    table = Table(stated=False, ATTITUDE=12.0, ATTITUDE_QUATERNION=50.0, GLOBAL_POSITION_INT=3.0, GPS_RAW_INT=0.0)
    assert table.cap(ATTITUDE) == (12.0, "attitude")
    assert table.cap(QUATERNION) == (50.0, "own_rate")
    assert table.cap(POSITION) == (3.0, "own_rate")
    assert table.cap(NUMBERS["GPS_RAW_INT"]) == (0.0, "only_ours")
    assert Table(stated=False, ATTITUDE=0.0, ATTITUDE_QUATERNION=0.0).cap(ATTITUDE) == (4.0, "attitude")
    assert Table(stated=False, ATTITUDE_QUATERNION=0.0).cap(QUATERNION) == (0.0, "only_ours")


def test_what_the_autopilot_sends_by_itself_passes_at_its_own_rate():
    assert Table(GLOBAL_POSITION_INT=5.0).cap(POSITION) == (5.0, "own_rate")
    assert Table(GLOBAL_POSITION_INT=inf).cap(POSITION) is None


def test_what_a_station_asked_for_is_thinned_to_that_on_its_link():
    table = Table(GLOBAL_POSITION_INT=0.0)
    assert table.ask(rates={POSITION: 3.0, ATTITUDE: 20.0})
    assert table.cap(POSITION) == (3.0, "asked")
    assert table.cap(ATTITUDE) == (20.0, "asked"), "an asked attitude is not held to 4 Hz"


def test_of_several_askers_the_highest_counts():
    table = Table(GLOBAL_POSITION_INT=0.0)
    for system, hz in ((255, 3.0), (254, 7.0), (253, 5.0)):
        table.ask(rates={POSITION: hz}, system=system)
    assert table.cap(POSITION) == (7.0, "asked")
    assert dict(table.rates.demanded) == {POSITION: 7.0}
    table.ask(rates={POSITION: 2.0}, system=254)
    assert table.cap(POSITION) == (5.0, "asked"), "a later request replaces the station's own earlier one"


def test_a_stop_counts_where_no_other_station_asks():
    table = Table(GLOBAL_POSITION_INT=0.0)
    table.ask(rates={POSITION: 0.0})
    assert table.cap(POSITION) == (0.0, "stopped")
    table.ask(rates={POSITION: 1.0}, system=254)
    assert table.cap(POSITION) == (1.0, "asked")


def test_the_default_interval_takes_a_request_back():
    table = Table(GLOBAL_POSITION_INT=5.0)
    table.ask(rates={POSITION: 50.0})
    table.ask(rates={POSITION: None})
    assert table.cap(POSITION) == (5.0, "own_rate")


def test_a_link_without_a_request_gets_what_another_links_station_asked_for():
    """The same as with any router; only messages that this service alone requested are held back."""
    table = Table(GLOBAL_POSITION_INT=1.0)
    table.ask(rates={POSITION: 7.0, HUD: 10.0})
    assert table.cap(POSITION, "tablet") == (7.0, "own_rate")
    assert table.cap(HUD, "tablet") is None


def test_a_quaternion_that_another_link_asked_for_stays_away_from_a_station_that_would_freeze_on_it():
    """QGroundControl ignores ATTITUDE for good once it has seen one ATTITUDE_QUATERNION."""
    table = Table(ATTITUDE_QUATERNION=0.0, ATTITUDE=0.0)
    table.ask(rates={QUATERNION: 50.0})
    assert table.cap(QUATERNION, "ground") == (50.0, "asked")
    assert table.cap(QUATERNION, "tablet") == (0.0, "only_ours")


@pytest.mark.parametrize("msgid", [PARAM_VALUE, HOME])
def test_what_is_no_telemetry_is_never_capped(msgid):
    table = Table(HOME_POSITION=0.0)
    table.ask(rates={msgid: 1.0})
    assert table.cap(msgid) is None


def test_a_station_is_forgotten_a_minute_after_its_last_heartbeat():
    table = Table(GLOBAL_POSITION_INT=0.0)
    table.ask(rates={POSITION: 3.0})
    later = HostNs(T0 + 40 * NS_PER_S)
    table.rates.heard("ground", 255 << 8 | 190, later)
    table.rates.heard("tablet", 255 << 8 | 190, HostNs(later + FORGOTTEN_NS))
    assert not table.rates.expire(1, HostNs(later + FORGOTTEN_NS))
    assert table.cap(POSITION) == (3.0, "asked")
    assert table.rates.expire(1, HostNs(later + FORGOTTEN_NS + 1))
    assert table.cap(POSITION) == (0.0, "only_ours")
    assert not table.rates.demanded


def test_requests_to_other_vehicles_and_components_do_not_count():
    table = Table(GLOBAL_POSITION_INT=0.0)
    table.ask(rates={POSITION: 3.0}, target=(2, 1))
    table.ask(rates={POSITION: 3.0}, target=(1, 154))
    assert table.cap(POSITION) == (0.0, "only_ours")
    table.ask(rates={POSITION: 3.0}, target=(0, 0))
    assert table.cap(POSITION) == (3.0, "asked")


def test_a_request_before_the_vehicle_is_known_counts_when_it_is():
    rates = MergedRates(["ground"])
    rates.note(request({POSITION: 3.0}, target=(9, 1)), 1, T0)
    rates.share(OwnStreams(9, 1, {POSITION: 0.0}), 9)
    assert rates.links["ground"].caps[POSITION].hz == 3.0


def test_repeating_a_request_changes_nothing():
    table = Table()
    assert table.ask(rates={HUD: 4.0})
    assert not table.ask(rates={HUD: 4.0})
    assert table.ask(rates={HUD: 5.0})


def test_a_request_on_a_link_that_does_not_merge_is_not_noted():
    assert not Table().ask(rates={HUD: 4.0}, link="autopilot")


def test_a_single_message_passes_once_and_not_for_ever():
    asked = AskedRates()
    asked.note(request({}, once=QUATERNION), T0)
    assert asked.take_once(QUATERNION, T0)
    assert not asked.take_once(QUATERNION, T0)
    asked.note(request({}, once=QUATERNION), T0)
    assert not asked.take_once(QUATERNION, HostNs(T0 + ONCE_NS + 1))


def test_single_message_that_a_station_awaits_is_not_forgotten_for_another_sources_requests():
    asked = AskedRates()
    asked.note(request({}, once=QUATERNION, source="10.0.0.1"), T0)
    for msgid in range(200):
        asked.note(request({}, once=msgid, source="10.0.0.66", system=1 + msgid), T0)
    assert not asked.take_once(0, T0), "the oldest of the source that asks for most"
    assert asked.take_once(199, T0)
    assert asked.take_once(QUATERNION, T0)


def test_strangers_do_not_fill_the_tables():
    asked = AskedRates()
    for system in range(1, 250):
        asked.note(request({HUD: 1.0}, system=system), HostNs(T0 + system))
    for msgid in range(5 * MAX_RATES):
        asked.note(request({msgid: 1.0}, system=8), HostNs(T0 + 1000))
        asked.note(request({}, once=msgid), T0)
    assert len(asked._askers) <= MAX_ASKERS
    assert max(len(asker.rates) for asker in asked._askers.values()) <= MAX_RATES
    assert len(asked._once_ns) <= 32
    assert set(asked._askers) == {system << 8 | 190 for system in range(1, 9)}, "who is heard keeps its place"
