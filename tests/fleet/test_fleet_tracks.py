"""A vehicle's tracks as it shares them, from a flight against the mock."""

from __future__ import annotations

from math import hypot

import msgspec
import numpy as np
import pytest
from flying import fly

from fwav_companion.fleet.fleet_tracks import FleetTracks
from fwav_companion.fleet.options import FleetTable
from fwav_companion.fleet.payloads import TracksMessage, decoded, encoded
from fwav_companion.geometry.earth import Geodetic
from fwav_companion.tracking.smoothed.solve_jobs import SmootherOptions
from sitl_mock import scenario


def square(values) -> np.ndarray:
    nn, ne, nd, ee, ed, dd = values
    return np.array([[nn, ne, nd], [ne, ee, ed], [nd, ed, dd]])


@pytest.fixture(scope="module", params=[None, SmootherOptions()], ids=["filter", "smoother"])
def shared(request):
    """(message, state, flight) at the end of a flight, by each estimator."""
    flown = fly(scenario("demo").but({"seconds": 12.0}), (), smoother=request.param)
    companion = flown.companion
    tracks, situation, obstacle = companion.pipeline.shared(companion._now)
    situation = msgspec.structs.replace(situation, utc_minus_host_s=1000.0)
    maker = FleetTracks(FleetTable(), companion.config.priors, "session")
    common = companion.pipeline.common_errors()
    assert bool(common) is (request.param is not None)
    message, state = maker.messages(tracks, situation, obstacle, common)
    assert tracks
    assert message.tracks
    return message, state, flown, tracks, situation


def test_every_covariance_splits_into_parts_that_are_covariances(shared):
    message, *_ = shared
    for track in message.tracks:
        total, common = square(track.cov), square(track.cov_shared)
        jacobian = np.array(track.bias_jacobian)
        own = jacobian @ np.diag(np.array(message.bias.sigma) ** 2) @ jacobian.T
        noise = (total - common - own)[:2, :2]
        assert np.linalg.eigvalsh(noise).min() > -0.02 * np.trace(total)  # three digits
        assert np.linalg.eigvalsh(common).min() >= 0.0
        assert np.trace(own[:2, :2]) > 0.0


def test_a_target_moves_with_the_vehicles_position_whatever_estimates(shared):
    """Hardly anything but the position's error, that of now above all, places a target that was seen for seconds."""
    message, *_ = shared
    assert message.bias.names == ("position_north", "position_east", "position_down", "heading")
    for track in message.tracks:
        (nn, ne, *_), (en, ee, *_), (_, _, down, _) = track.bias_jacobian
        assert 0.7 < min(nn, ee) <= max(nn, ee) <= 1.0
        assert (ne, en) == pytest.approx((0.0, 0.0), abs=0.15)
        assert 0.0 < down <= 1.0


def test_places_and_labels_are_the_tracks(shared):
    message, _, _, tracks, situation = shared
    for shown, track in zip(message.tracks, tracks, strict=True):
        ned = situation.plane.ned_from_geodetic(Geodetic.from_degrees(shown.lat, shown.lon, shown.alt_amsl))
        assert hypot(ned[0] - track.position_ned[0], ned[1] - track.position_ned[1]) < 1e-3
        assert (shown.track, shown.label) == (track.id, track.label)


def test_the_message_is_understood_and_the_state_has_the_vehicle(shared):
    message, state, *_ = shared
    (data,) = encoded(message)
    assert isinstance(decoded(data, TracksMessage), TracksMessage)
    assert state.vehicle == message.vehicle == "1"
    assert state.lat is not None
    assert state.heading_deg is not None
    assert 0.0 <= state.heading_deg < 360.0


def test_the_footprint_is_the_border_of_the_image_on_the_ground():
    """Projected back by the camera, each corner is on the border, or on the way to it where there is no ground."""
    companion = fly(scenario("demo").but({"seconds": 12.0}), ()).companion
    camera, plane = companion.pipeline._components.camera, companion.pipeline.telemetry.world.plane
    corners = companion.pipeline.footprint(camera._last_view.host_ns)
    assert len(corners) >= 3
    view = camera.look.view_at(camera._last_view.host_ns)
    home_m = plane.origin.alt_amsl_m - companion.pipeline.telemetry.world.home_down_m
    for lat, lon in corners:
        ned = plane.ned_from_geodetic(Geodetic.from_degrees(lat, lon, home_m))
        pixel = view.pixel_of(ned)
        assert pixel is not None
        across = max(abs(pixel[0] - 319.5) / 320.0, abs(pixel[1] - 239.5) / 240.0)
        assert min(abs(across - share) for share in (0.99, 0.8, 0.6, 0.4)) < 0.01
    assert companion.pipeline.footprint(camera._last_view.host_ns + 5_000_000_000) == ()


def test_state_has_the_ages_of_what_it_repeats(shared):
    """The vehicle falls silent: what is sent 45 s later is 45 s older."""
    *_, flown, tracks, situation = shared
    maker = FleetTracks(FleetTable(), flown.companion.config.priors, "s")
    _, before = maker.messages(tracks, situation, None)
    assert before.position_age_s < 0.1
    assert before.autopilot_age_s < 2.0
    assert before.frame_age_s < 1.0
    _, later, _ = flown.companion.pipeline.shared(situation.now_ns + 45 * 10**9)
    later = msgspec.structs.replace(later, utc_minus_host_s=1000.0)
    _, after = maker.messages(tracks, later, None)
    for name in ("position_age_s", "autopilot_age_s", "frame_age_s"):
        assert getattr(after, name) == pytest.approx(getattr(before, name) + 45.0, abs=0.02), name
    assert (after.lat, after.lon) == (before.lat, before.lon)


def test_without_utc_nothing_is_made(shared):
    *_, flown, tracks, situation = shared
    maker = FleetTracks(FleetTable(), flown.companion.config.priors, "s")
    assert maker.messages(tracks, msgspec.structs.replace(situation, utc_minus_host_s=None), None) is None


def test_without_a_plane_tracks_and_vehicle_are_in_the_local_world(shared):
    """The same flight as it would be without a global position: the tracks' own places, and no other."""
    *_, flown, tracks, situation = shared
    maker = FleetTracks(FleetTable(), flown.companion.config.priors, "s")
    message, state = maker.messages(tracks, msgspec.structs.replace(situation, plane=None), None)
    (data,) = encoded(message)
    read = decoded(data, TracksMessage)
    assert read.tracks == ()
    for sent, track in zip(read.local_tracks, tracks, strict=True):
        assert (sent.track, sent.label, sent.state) == (track.id, track.label, track.state.value)
        assert (sent.north, sent.east, sent.down) == pytest.approx(track.position_ned, abs=1e-3)
        assert square(sent.cov) == pytest.approx(np.array(track.cov), rel=0.01)
    here = situation.vehicle.position_ned
    assert (state.local.north, state.local.east, state.local.down) == pytest.approx(here, abs=1e-3)
    assert (state.lat, state.lon) == (None, None)
    assert state.heading_deg is not None
    assert state.position_age_s < 0.1


def test_relative_world_is_not_shared(shared):
    """Its zero is the point below the camera, which moves."""
    *_, flown, tracks, situation = shared
    maker = FleetTracks(FleetTable(), flown.companion.config.priors, "s")
    nowhere = msgspec.structs.replace(situation.vehicle, position_ned=None)
    situation = msgspec.structs.replace(situation, plane=None, newest_state=lambda: nowhere)
    assert maker.messages(tracks, situation, None) is None
