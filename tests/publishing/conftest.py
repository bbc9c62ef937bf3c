"""Tracks, instants and a foreign encoder: shared by the publishing tests."""

import sys
from pathlib import Path
from types import SimpleNamespace

import pytest
from handmade import KnownErrors, a_sighting
from pymavlink.dialects.v20 import ardupilotmega as mavlink
from scipy.spatial.transform import Rotation

from fwav_companion.geometry.earth import Geodetic, TangentPlane
from fwav_companion.publishing.landing import Landing
from fwav_companion.types import (
    BIAS_COUNT,
    Autopilot,
    AutopilotKind,
    ClockEstimate,
    ClockStatus,
    Detection,
    ErrorBudget,
    GroundFix,
    Ray,
    Situation,
    Track,
    TrackState,
    VehicleState,
)

sys.path.insert(0, str(Path(__file__).parent))

from landing_options import OPTIONS

S = 10**9
NOW = 40_000 * S
BOOT_FROM_HOST = -39_000 * S
ORIGIN = Geodetic.from_degrees(47.397742, 8.545594, 488.0)
LOOKS_DOWN = ((0.0, -1.0, 0.0), (1.0, 0.0, 0.0), (0.0, 0.0, 1.0))


def diagonal(*sigmas):
    return tuple(tuple(sigma**2 if i == j else 0.0 for j in range(3)) for i, sigma in enumerate(sigmas))


def quaternion(yaw_deg=0.0, pitch_deg=0.0, roll_deg=0.0):
    """(w, x, y, z) of ned_from_body, by scipy."""
    x, y, z, w = Rotation.from_euler("ZYX", [yaw_deg, pitch_deg, roll_deg], degrees=True).as_quat().tolist()
    return (w, x, y, z)


def state(at=NOW, q=None, rates=(0.0, 0.0, 0.0), position=(0.0, 0.0, -10.0), velocity=(0.0, 0.0, 0.0), height=10.0):
    return VehicleState(
        boot_ns=at + BOOT_FROM_HOST,
        ned_from_body=q or quaternion(),
        rates=rates,
        attitude_sigma=0.0,
        gap_s=0.0,
        position_ned=position,
        velocity_ned=velocity,
        position_sigma_m=0.0,
        height_above_home_m=height,
    )


def clock(round_trip_s=0.0):
    return ClockEstimate(NOW, -BOOT_FROM_HOST, 0.0, 1e-4, 1e-3, round_trip_s, ClockStatus.SETTLED)


def autopilot(kind=AutopilotKind.ARDUPILOT, system=1):
    return Autopilot(system=system, component=1, kind=kind, vehicle_type=16, armed=True, link="fc")


def situation(now=NOW, kind=AutopilotKind.ARDUPILOT, **changes):
    usual = {
        "now_ns": now,
        "autopilot": autopilot(kind) if kind is not None else None,
        "plane": TangentPlane(ORIGIN),
        "vehicle": state(now),
        "clock": clock(),
        "undulation_m": 47.3,
        "utc_minus_host_s": 1_790_000_000.0,
    }
    given = usual | changes
    vehicle, estimate = given.pop("vehicle"), given.pop("clock")
    return Situation(newest_state=lambda: vehicle, clock_estimate=lambda: estimate, **given)


def fix(
    position=(4.0, 3.0, 0.0),
    pixel=(320.0, 240.0),
    box=None,
    at=NOW,
    ray=(0.0, 0.0, 1.0),
    sigma_px=4.0,
    cov=None,
    **detection,
):
    sighting = a_sighting(
        at,
        state(at),
        detection=Detection(u=pixel[0], v=pixel[1], box=box, **detection),
        ray=Ray(ray, (0.0, 0.0, 0.0), (0.0, 0.0, 0.0)),
        pixel_sigma=sigma_px,
        axes=LOOKS_DOWN,
    )
    cov = cov or diagonal(0.2, 0.1, 0.05)
    budget = ErrorBudget(0.1, 0.1, 0.1, 0.1, 0.1, 0.1, 0.1, 0.1)
    return GroundFix(sighting, position, cov, ((0.0, 0.0, 0.0),) * BIAS_COUNT, KnownErrors(cov, cov, budget), "home")


def track(number=1, label="pad", at=NOW, confirmed_at=NOW - 5 * S, with_fix=True, **changes):
    position = changes.get("position_ned", (4.0, 3.0, 0.0))
    usual = {
        "id": number,
        "label": label,
        "state": TrackState.CONFIRMED,
        "host_ns": at,
        "boot_ns": at + BOOT_FROM_HOST,
        "frame": 1,
        "position_ned": position,
        "cov": diagonal(1.0, 0.8, 0.6),
        "apparent_ned": position,
        "relative_cov": diagonal(0.3, 0.2, 0.1),
        "fix": fix(position, at=at) if with_fix else None,
        "first_host_ns": NOW - 6 * S,
        "confirmed_host_ns": confirmed_at,
        "last_seen_host_ns": at,
    }
    return Track(**usual | changes)


def packed(outgoing):
    """What a receiver has after the message went through pymavlink's own encoder and decoder, as a dict."""
    kind = getattr(mavlink, f"MAVLink_{outgoing.name.lower()}_message")
    texts = {name: value.encode() for name, value in outgoing.fields.items() if isinstance(value, str)}
    sender = mavlink.MAVLink(None, srcSystem=1, srcComponent=outgoing.component)
    (received,) = mavlink.MAVLink(None).parse_buffer(kind(**outgoing.fields | texts).pack(sender))
    assert received.get_type() == outgoing.name
    raw = {name: getattr(received, f"_{name}_raw") for name in texts}  # pymavlink reads text as ASCII
    return received.to_dict() | {name: value.rstrip(b"\0").decode() for name, value in raw.items()}


@pytest.fixture(scope="session")
def world():
    """Everything above, under one name: test files cannot import one another."""
    return SimpleNamespace(
        S=S,
        NOW=NOW,
        ORIGIN=ORIGIN,
        diagonal=diagonal,
        quaternion=quaternion,
        state=state,
        clock=clock,
        autopilot=autopilot,
        situation=situation,
        fix=fix,
        track=track,
        packed=packed,
    )


@pytest.fixture
def landing():
    """LANDING_TARGET on the label "pad", for an autopilot without a lag."""
    made = Landing(OPTIONS)
    made.lag_s = 0.0
    return made
