"""Kinds of gimbals and of mistakes in what they report: targets on both sides, located within their claims.

Biases are drawn from the priors of the configuration, so that errors are compared with claims, not with zero. A flight
is one draw of its biases: each kind is flown with a few seeds, and the bounds are the 99.9 % limits of so many draws.
"""

from math import radians, sin

import numpy as np
import pytest
from draws import first_of
from flying import fly
from scipy.stats import chi2

from fwav_companion.types import NoticeCode
from sitl_mock import Options, TargetOptions, scenario

BEHIND_AUTOPILOT, OWN_COMPONENT = 1, 154
BOTH_SIDES = (
    TargetOptions(label="left", north=1.5, east=-3.0),
    TargetOptions(label="right", north=1.5, east=3.0),
)
COPTER = {"flight.pattern": "hover", "flight.pitch_deg": 4.0, "flight.flapping_pitch_deg": 5.0, "flight.flapping_hz": 0.6,
          "flight.flapping_roll_deg": 4.0, "flight.offset_m": (-5.0, 0.0)}  # fmt: skip
KINDS = {
    "stabilised": {},
    "servo": {"gimbal.kind": "servo", "gimbal.yaw": "vehicle", "gimbal.device_id": BEHIND_AUTOPILOT, **COPTER},
    "yaw_follow": {"gimbal.yaw": "vehicle"},
    "own_zero": {"gimbal.yaw": "vehicle_and_delta", "gimbal.yaw_zero_deg": 70.0},
    "own_zero_earth": {"gimbal.yaw": "north_and_delta", "gimbal.yaw_zero_deg": 70.0},
    "slow": {"gimbal.rate_hz": 1.0, "gimbal.swing_deg": 2.0},
    "late": {"gimbal.late_s": 0.08},
    "reset": {"gimbal.resets_at_s": 6.0},
    "straight_down": {"gimbal.pitch_deg": -90.0, "gimbal.swing_deg": 3.0},
    "orientation_only": {
        "gimbal.message": "MOUNT_ORIENTATION",
        "gimbal.yaw": "vehicle",
        "gimbal.device_id": BEHIND_AUTOPILOT,
        "autopilot.rates_hz": {"MOUNT_ORIENTATION": 10.0},
    },
    "two_gimbals": {"gimbal.second_id": 155},
}


def flown(kind, seed=1, **differences):
    options = scenario("gimbal", Options(seed=seed)).but(
        {"seconds": 10.0, "targets": BOTH_SIDES, "gimbal.yaw_deg": 0.0, "camera.clutter": 0.0, **KINDS[kind], **differences}
    )
    settings = [f"camera.mount.gimbal_device_id={options.gimbal.device_id}", "camera.mount.pitch_deg=0.0"]
    if options.gimbal.late_s:
        settings.append(f"camera.mount.gimbal_delay_s={options.gimbal.late_s}")
    return fly(options, settings)


def squares(flight, lines):
    """Normalised squares of the horizontal errors of these lines of targets."""
    found = []
    for line in lines:
        index = [target.label for target in flight.options.targets].index(line["label"])
        true = flight.mock.scene[index].at(flight.seen_at_s(line))
        error = np.array((line["north"] - true[0], line["east"] - true[1]))
        found.append(float(error @ np.linalg.solve(np.array(line["cov"])[:2, :2], error)))
    return found


def fixes_of(flight, label):
    return [{**line, **line["fix"]} for line in flight.companion.targets(label) if line["fix"]]
