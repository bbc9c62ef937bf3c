"""Message rates between the autopilot, the daemon and a ground station that wants others."""

import time
from pathlib import Path

import pytest
from processes import GroundStation
from pymavlink.dialects.v20 import ardupilotmega as dialect
from sites import Site

ALL_STREAMS = 0


@pytest.fixture
def site(tmp_path: Path):
    site = Site(tmp_path)
    yield site
    site.close()


def attitude_hz(ground: GroundStation, seconds: float = 2.0) -> float:
    """Of the quaternion, as the ground station gets it."""
    ground.listen_during(0.2)
    names = [message.get_type() for message in ground.listen_during(seconds)]
    return names.count("ATTITUDE_QUATERNION") / seconds


def ask_for_four_hz(site: Site) -> None:
    site.ground.beat()
    site.ground.send(dialect.MAVLink_request_data_stream_message(1, 1, ALL_STREAMS, 4, 1))


@pytest.mark.timeout(120)
def test_a_ground_stations_request_for_other_rates_stops_here(site: Site):
    with site.service() as service, site.mock("--scenario", "unbiased", seconds=60.0):
        site.ground.listen(until="CAMERA_TRACKING_GEO_STATUS")
        ask_for_four_hz(site)
        assert attitude_hz(site.ground) == pytest.approx(100.0, abs=12.0)
        time.sleep(1.1)
        traffic = {link["name"]: link for link in site.status()["traffic"]}
        assert traffic["ground"]["stopped"] == 1
        assert service.stop() == 0


@pytest.mark.timeout(120)
def test_where_it_may_pass_our_own_rates_are_asked_for_again_at_once(site: Site):
    site.replace("# forward_rate_requests = false", "forward_rate_requests = true")
    with site.service() as service, site.mock("--scenario", "unbiased", seconds=60.0):
        site.ground.listen(until="CAMERA_TRACKING_GEO_STATUS")
        ask_for_four_hz(site)
        service.wait_for("255/190 on ground asks the autopilot for other message rates")
        assert attitude_hz(site.ground) == pytest.approx(100.0, abs=12.0)
        assert service.stop() == 0


@pytest.mark.timeout(120)
def test_a_slow_link_is_spared_what_it_names_and_nothing_else(site: Site):
    site.replace('role = "gcs"', 'role = "gcs"\nmax_rate_hz = { ATTITUDE_QUATERNION = 5 }')
    with site.service() as service, site.mock("--scenario", "unbiased", seconds=60.0):
        site.ground.listen(until="CAMERA_TRACKING_GEO_STATUS")
        heard = site.ground.listen_during(3.0)
        hz = {
            name: sum(m.get_type() == name for m in heard) / 3.0 for name in ("ATTITUDE_QUATERNION", "DISTANCE_SENSOR")
        }
        assert hz["ATTITUDE_QUATERNION"] == pytest.approx(5.0, abs=1.0)
        assert hz["DISTANCE_SENSOR"] == pytest.approx(10.0, abs=2.0)
        assert site.status()["telemetry"]["rates_hz"]["ATTITUDE_QUATERNION"] > 85.0
        assert service.stop() == 0


def test_a_rate_for_a_message_that_does_not_exist_is_one_line_and_exit_2(site: Site):
    site.replace('role = "gcs"', 'role = "gcs"\nmax_rate_hz = { ATITUDE = 4 }')
    with site.service() as service:
        assert service.end() == 2
    assert service.said.count("\n") == 1
    assert 'fwav-companion.toml: [[link]] 2 "ground" max_rate_hz: no MAVLink message is called ATITUDE' in service.said
    assert 'did you mean "ATTITUDE"?' in service.said
