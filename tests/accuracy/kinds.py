"""The kinds of flight on which an estimator is measured: each a scenario of the mock with its differences. PURE.

The configuration of a kind states the sigmas from which the mock draws. ``errors`` names what is drawn: "exact",
nothing; "wander", a receiver's wander of a metre alone; "drawn", every error. An exact position is stated as such.
"""

from __future__ import annotations

from dataclasses import dataclass, field
from itertools import product
from typing import Any

from sitl_mock import Options, TargetOptions, scenario
from sitl_mock.copter_scenarios import COPTER_CIRCLES, EXACT_POSITION

RANDOM = "random_configurations"
RANDOM_FLIGHTS = 40
SURVEY_SIGMA_M = 0.05
"""One sigma of a landmark's surveyed place, each axis."""
NOISES = ("pixel_noise_px", "attitude_noise_deg", "position_noise_m", "height_noise_m")
BIASES = (
    "attitude_bias_deg", "heading_bias_deg", "height_bias_m", "mount_bias_deg", "time_offset_sigma_s",
    "position_delay_sigma_s", "lever_arm_sigma_m",
)  # fmt: skip
"""Keys of [uncertainty] that the mock has by the same names."""

COMMON = {"autopilot.pitch_trim_deg": 0.0, "noise_by_cause": True}
ERRORS: dict[str, dict[str, Any]] = {
    "exact": {**EXACT_POSITION, "draw_biases": False, "camera.readout_s": 0.0},
    "wander": {"draw_biases": False, "camera.readout_s": 0.0, "biases.position_m": 1.0,
               "autopilot.position_wander": "smooth"},
    "drawn": {"autopilot.position_wander": "smooth"},
}  # fmt: skip
UNKNOWN_DELAY = {"priors.time_offset_sigma_s": 0.05, "camera.latency_s": 0.4}
"""A delay that nobody measured; pictures arrive after their stamps, however late these are."""
PLANTED = {**UNKNOWN_DELAY, "biases.time_offset_s": 0.035, "biases.mount_deg": (0.5, 1.0, 2.0)}


def _targets(*places: tuple[float, float], label: str = "target") -> tuple[TargetOptions, ...]:
    return tuple(TargetOptions(label=label, north=north, east=east) for north, east in places)


def _grid(rows: int, columns: int) -> tuple[TargetOptions, ...]:
    """Targets three metres apart about the flight centre."""
    middle = (0.5 * (rows - 1), 0.5 * (columns - 1))
    return _targets(*((3.0 * (i - middle[0]), 3.0 * (j - middle[1])) for i, j in product(range(rows), range(columns))))


ORBITED = _targets((-2.0, -2.0), (2.0, -2.0), (0.0, 1.5))
HOVERED = _targets((1.0, 0.5), (3.0, -3.0), (-1.5, 2.0), (4.0, 3.0), (1.5, 4.5))
FIELD = _targets(*product((-21.0, -7.0, 7.0, 21.0), (-12.0, 0.0, 12.0)), label="cow")
"""Twelve, 12 to 14 m apart."""
WALKER = TargetOptions(label="person", north=-4.0, speed_m_s=1.5, leg_m=8.0)
MARKS = {"mark": (3.0, -2.0), "second": (-3.0, -2.0), "third": (0.0, 4.0)}
"""Places of the landmarks from the flight centre: north, east."""
STILL = {
    "flight.pattern": "hover", "flight.offset_m": (-8.0, 0.0), "flight.flapping_pitch_deg": 0.0,
    "flight.flapping_roll_deg": 0.0, "flight.heave_m": 0.0, "flight.wander_m": 0.0, "flight.wander_deg": 0.0,
}  # fmt: skip
AWAY = {
    "flight.pattern": "waypoints", "flight.pitch_deg": 0.0, "seconds": 110.0,
    "flight.waypoints": ((0.0, -3.0, 1.0, 12.0, 0.0), (15.0, 2.0, -1.0, 12.0, 120.0), (25.0, 40.0, 0.0, 12.0, 180.0),
                         (75.0, 40.0, 30.0, 12.0, 180.0), (85.0, 2.0, 1.0, 12.0, 180.0),
                         (110.0, -3.0, 0.0, 12.0, 90.0)),
}  # fmt: skip
"""Twenty seconds above the targets, a minute away from them, and back."""


@dataclass(frozen=True)
class Kind:
    """One kind of flight."""

    name: str
    base: str = "default"
    """The mock's scenario."""
    errors: str = "drawn"
    differences: dict[str, Any] = field(default_factory=dict)
    settings: tuple[str, ...] = ()
    """``KEY=VALUE`` of the replay after the stated sigmas: a position that shifts is not stated as exact."""
    marks: dict[str, tuple[float, float]] = field(default_factory=dict)
    """Landmarks, and by how much their survey is wrong beyond its sigma: north, east, metres."""
    has_surface: bool = False
    """Whether the replay has the surface as an elevation model."""

    def options(self, seed: int) -> Options:
        """The mock's options of one flight."""
        marks = tuple(TargetOptions(label=name, north=MARKS[name][0], east=MARKS[name][1]) for name in self.marks)
        options = scenario(self.base, Options(seed=seed, seconds=45.0)).but(
            {**COMMON, **ERRORS[self.errors], **self.differences}
        )
        return options.but({"targets": (*marks, *options.targets)})


def stated(options: Options) -> tuple[str, ...]:
    """The ``KEY=VALUE`` of a configuration that knows the flight's camera and the sigmas of its errors."""
    camera, priors, biases = options.camera, options.priors, options.biases
    values: dict[str, Any] = {f"uncertainty.{name}": getattr(priors, name) for name in (*NOISES, *BIASES)}
    if biases.position_m == 0.0:
        values["uncertainty.position_bias_m"] = 0.0
    if biases.position_delay_s == 0.0:
        values["uncertainty.position_delay_sigma_s"] = 0.0
    if biases.lever_arm_m == (0.0, 0.0, 0.0):
        values["uncertainty.lever_arm_sigma_m"] = 0.0
    if camera.readout_s is not None:
        values["camera.readout_s"] = camera.readout_s
    values |= dict(
        zip((f"camera.mount.{axis}_deg" for axis in ("roll", "pitch", "yaw")), camera.mount_deg, strict=True)
    )
    values |= {"camera.time_offset_s": camera.time_offset_s, "camera.mount.gimbal_device_id": options.gimbal.device_id}
    return tuple(f"{key}={value!r}" for key, value in values.items())


EIGHT, HOVER = "figure_eight", "hover"
ONE_WRONG = {"mark": (0.32, -0.24), "second": (0.0, 0.0), "third": (0.0, 0.0)}
KINDS: dict[str, Kind] = {
    kind.name: kind
    for kind in (
        Kind("eight_exact", EIGHT, "exact"),
        Kind("eight_wander", EIGHT, "wander"),
        Kind("eight_late_and_crooked", EIGHT, "exact", PLANTED),
        Kind("eight_drawn", EIGHT, "drawn", {**UNKNOWN_DELAY, "biases.position_m": 0.0,
             "priors.position_noise_m": 0.02}),
        Kind("descent_exact", "descent", "exact"),
        Kind("descent_wander", "descent_wander", "wander"),
        Kind("descent_jump", "descent_shift", "exact", settings=("uncertainty.position_bias_m=auto",)),
        Kind("hover_1", HOVER, "wander", {"targets": HOVERED[:1]}),
        Kind("hover_5", HOVER, "wander", {"targets": HOVERED}),
        Kind("orbit_1", "default", "wander"),
        Kind("orbit_3", "default", "wander", {"targets": ORBITED}),
        Kind("circles", "default", "drawn", {**COPTER_CIRCLES, "seconds": 60.0}),
        Kind("photographs", "photographs", "wander", {"camera.fps": 0.25, "seconds": 240.0, "targets": FIELD}),
        Kind("survey", "survey"),
        Kind("slow_telemetry", "slow_telemetry", "drawn", {"seconds": 60.0, "autopilot.true_ceiling_hz": 4.0,
             "autopilot.rates_hz": {"ATTITUDE": 4.0, "ATTITUDE_QUATERNION": 4.0, "GLOBAL_POSITION_INT": 4.0}}),
        Kind("walker", "default", "wander", {"targets": (WALKER, *_targets((-2.0, -2.0), (2.0, -3.0), (0.0, 2.5),
             label="thing"))}, ("tracking.motion=moving",)),
        Kind("targets_10", "default", "wander", {"targets": _grid(2, 5)}),
        Kind("targets_30", "default", "wander", {"targets": _grid(5, 6)}),
        Kind("landmark_1", marks={"mark": (0.0, 0.0)}),
        Kind("landmark_3", marks=dict.fromkeys(MARKS, (0.0, 0.0))),
        Kind("landmark_wrong", marks=ONE_WRONG),
        Kind("rtk", EIGHT, "drawn", {"priors.position_bias_m": 0.02, "priors.position_noise_m": 0.02,
             "autopilot.fix_type": 6, "autopilot.h_acc_m": 0.02}),
        Kind("consumer_receiver", EIGHT, "drawn", {"priors.position_bias_m": 2.0, "autopilot.h_acc_m": 2.0,
             "autopilot.position_wander_times_s": (30.0, 1800.0)}),
        Kind("gimbal", "gimbal", "drawn"),
        Kind("terrain", "village", "drawn", {"camera.fps": 4.0}, (
             "ground.model=terrain", "uncertainty.terrain_m=0.5", 'ground.terrain=["survey.tif"]',
             "ground.terrain_datum=egm96"), has_surface=True),
        Kind("rangefinder", "default", "drawn", settings=("ground.model=rangefinder",)),
        Kind("targetless_minute", "default", "drawn", AWAY),
        Kind("standing", "default", "drawn", STILL),
    )
}  # fmt: skip
"""By name. The random configurations of studies are the one further kind, by the name of RANDOM."""
NAMES = (*KINDS, RANDOM)
