"""One flight drawn from the configuration's priors: the mock's options, and the configuration of its replay. PURE.

Each quantity has a stream of random numbers of its own, by (seed, index, quantity). A flight is the same on every
worker, and two arms of a study differ in one cause alone.
"""

from __future__ import annotations

from math import cos, exp, hypot, log, pi, radians, sin, sqrt, tan
from random import Random
from typing import Any, Final

import msgspec

from fwav_companion.config import Config
from fwav_companion.tools.study.causes import error_cause
from fwav_companion.tools.study.keys import FLIGHT, Value, flight_settings, toml_text
from fwav_companion.tools.study.paper_preset import FIRST_PICTURE_S, TARGET_M
from fwav_companion.tools.study.study_plan import StudyPlan, terrain_sigma_m

CONFIGURED: Final = "configured"
"""Arm of the flights as configured."""
TWICE: Final = "twice"
"""Arm with every true sigma twice its prior."""
PAPER_FILTER: Final = "paper_filter"
"""Arm of the same flights, tracked by the paper's low-pass."""
WITHOUT: Final = "without_"
"""Beginning of the arms with the sigma of one cause zero, in truth and prior."""

LABEL: Final = "target"
FPS: Final = 30.0
"""Rate of a camera whose configuration states none, hertz: the most common one."""
FALSE_DETECTIONS: Final = 0.02
"""Mean number of false detections in a picture."""
LATENCY_S: Final = 0.03
MOST_LATENCY_S: Final = 0.4
"""Usual and longest time from a picture to its detections, seconds. No stamp is later than its arrival: late stamps add
four sigma to this time, also if sigmas are doubled. The pipeline refuses a picture after half a second."""
LONGEST_READOUT_S: Final = 0.075
"""Longest readout of an unknown camera, seconds: [camera] readout_s = "unknown"."""
USUAL_POSITION_M: Final = 1.0
"""True sigma of a position whose accuracy is "auto", metres: the mock's receiver claims the same."""
WANDER_TIMES_S: Final = (30.0, 1800.0)
"""Time constants of a position error that is "auto", log-uniform, seconds."""
BIRD_PITCH_DEG: Final = 37.0
"""Mean pitch of the paper's bird, whose camera looks along the body's down axis, degrees."""
DOWNWARD_DEG: Final = -70.0
"""Mount pitch below which a camera is taken to look along the body's down axis."""
USUAL: Final[dict[str, tuple[float, float]]] = {
    "height_m": (15.0, 15.0),
    "speed_m_s": (5.0, 5.0),
    "flap_hz": (4.0, 6.0),
    "flap_deg": (3.0, 7.0),
    "wind_m_s": (0.0, 4.0),
    "miss_rate": (0.0, 0.2),
}
"""Ranges of flight keys that are not set; radius and pitch follow from pattern, height and mount."""
GUSTS: Final = 0.15
"""Turbulence intensity: sigma of the gusts over the mean wind (IEC 61400-1, class B at low height)."""
WANDER_PER_GUST_S: Final = 1.0 / 0.57
"""RMS of the mock's slow drift over the RMS of its rate: three sines with periods of 24, 11 and 6 s."""
LEAST_PIXEL_NOISE_PX: Final = 0.05
LOW_PASS: Final = ("tracking.filter", "lowpass")
ARDUPILOT_DEFAULTS: Final = ("ATTITUDE", "LOCAL_POSITION_NED", "VFR_HUD", "SYS_STATUS", "RAW_IMU", "SERVO_OUTPUT_RAW")
"""Streams that the pipeline does not use: a simulated flight leaves them out."""
NOISES: Final = ("pixel_noise_px", "attitude_noise_deg", "position_noise_m", "height_noise_m")
BIASES: Final = (
    "attitude_bias_deg", "heading_bias_deg", "height_bias_m", "mount_bias_deg", "time_offset_sigma_s",
    "position_delay_sigma_s", "lever_arm_sigma_m",
)  # fmt: skip
"""Keys of [uncertainty] that the mock has by the same names."""


class FlightDraw(msgspec.Struct, frozen=True, kw_only=True):
    """One flight before it is flown."""

    index: int
    arm: str
    varied: dict[str, Value]
    """Values of the varied keys."""
    flown: dict[str, float]
    """Values of the flight: height, speed, wing beat..."""
    request: dict[str, Any]
    """Request to the mock (sitl_mock/service.py)."""
    settings: tuple[str, ...]
    """The ``KEY=VALUE`` of the replay."""
    claim: Config
    """Configuration of the replay."""


def draw_flight(plan: StudyPlan, index: int, arm: str = CONFIGURED) -> FlightDraw:
    """The flight with this index in an arm of a study."""
    varied = {each.key: each.drawn(_stream(plan, index, f"vary/{each.key}")) for each in plan.variations}
    more = tuple((key, toml_text(value)) for key, value in varied.items())
    zeroed = _zeroed(arm)
    truth = plan.truth((*more, *zeroed))
    flown = _flown(plan, index, varied, truth)
    readout_s = _readout_s(plan, index, truth)
    settings = plan.claim_settings((*more, *zeroed, *((LOW_PASS,) if arm == PAPER_FILTER else ())))
    if arm == f"{WITHOUT}readout":
        settings = (*settings, f"camera.readout_s={readout_s!r}")
    claim = plan.parsed(settings)
    times = 2.0 if arm == TWICE else 1.0
    request = {
        "set": {
            "seed": _stream(plan, index, "mock").getrandbits(48),
            "seconds": plan.seconds,
            "noise_by_cause": True,
            "biases.readout_s": readout_s,
            **_of_flight(plan, index, flown, truth, times=times),
            **_of_autopilot(plan, index, truth),
            **_of_camera(plan, truth, flown["miss_rate"]),
            **_of_priors(plan, index, truth, times),
            **(_paper() if plan.preset == "paper" else {}),
        },
        "rates_hz": _rates_hz(claim),
    }
    return FlightDraw(index=index, arm=arm, varied=varied, flown=flown, request=request, settings=settings, claim=claim)


def _zeroed(arm: str) -> tuple[tuple[str, str], ...]:
    """Keys of [uncertainty] that an arm sets to zero, the noise of pixels to the least; with these values."""
    keys = error_cause(arm.removeprefix(WITHOUT)).keys if arm.startswith(WITHOUT) else ()
    least = {"pixel_noise_px": LEAST_PIXEL_NOISE_PX}
    return tuple((f"uncertainty.{key}", repr(least.get(key, 0.0))) for key in keys)


def _stream(plan: StudyPlan, index: int, quantity: str) -> Random:
    return Random(f"{plan.seed}/{index}/{quantity}")  # noqa: S311  # a drawn flight, no secret


def _flown(plan: StudyPlan, index: int, varied: dict[str, Value], truth: Config) -> dict[str, float]:
    """The values of the flight's keys: set, varied, or drawn."""
    given = flight_settings([*plan.settings, *((key, str(value)) for key, value in varied.items())])
    values: dict[str, float] = {}
    usual = USUAL if truth.ground.model != "fixed" else USUAL | {"height_m": (truth.ground.height_m,) * 2}
    for name, (low, high) in usual.items():
        values[name] = given.get(name, _stream(plan, index, FLIGHT + name).uniform(low, high))
    mount_pitch = truth.camera.mount.pitch_deg
    level = BIRD_PITCH_DEG if mount_pitch <= DOWNWARD_DEG and not truth.camera.mount.gimbal_device_id else 0.0
    values["pitch_deg"] = given.get("pitch_deg", level)
    values["radius_m"] = given.get("radius_m", _radius_m(plan, values, mount_pitch))
    return values


def _radius_m(plan: StudyPlan, values: dict[str, float], mount_pitch_deg: float) -> float:
    """A radius at which the target is in view: where the camera looks, between 15 and 45 degrees from straight down.

    A figure eight, whose camera sees the target as it passes, has a radius of 1.25 heights, a survey 1.5.
    """
    height_m = values["height_m"]
    if plan.pattern in ("eight", "survey"):
        return (1.25 if plan.pattern == "eight" else 1.5) * height_m
    look_deg = min(45.0, max(15.0, values["pitch_deg"] + mount_pitch_deg + 90.0))
    return height_m * tan(radians(look_deg))


def _of_flight(plan: StudyPlan, index: int, flown: dict[str, float], truth: Config, *, times: float) -> dict[str, Any]:
    """The mock's options of the flight, about a target near the flight centre. ``times``: true over configured sigmas.

    A camera at a fixed height holds it; the error of that height makes its target higher or lower.
    """
    is_fixed = truth.ground.model == "fixed"
    pattern, radius, speed, height = plan.pattern, flown["radius_m"], flown["speed_m_s"], flown["height_m"]
    place = _stream(plan, index, "place")
    wind_from = place.uniform(0.0, 2.0 * pi)
    off, toward = 0.2 * height * sqrt(place.random()), place.uniform(0.0, 2.0 * pi)
    options: dict[str, Any] = {
        "flight.height_m": height,
        "flight.speed_m_s": speed,
        "flight.start_phase_deg": place.uniform(0.0, 360.0),
        "flight.pitch_deg": flown["pitch_deg"],
        "flight.flapping_hz": flown["flap_hz"],
        "flight.flapping_pitch_deg": flown["flap_deg"],
        "flight.flapping_roll_deg": 0.1 * flown["flap_deg"],
        "flight.heave_m": 0.004 * flown["flap_deg"],
        "flight.wander_m": 0.0 if is_fixed else GUSTS * flown["wind_m_s"] * WANDER_PER_GUST_S,
        "flight.wind_m_s": (flown["wind_m_s"] * cos(wind_from), flown["wind_m_s"] * sin(wind_from)),
    }
    options |= _of_pattern(pattern, radius, speed, plan.seconds)
    sigma_m = hypot(terrain_sigma_m(truth), truth.uncertainty.height_bias_m if is_fixed else 0.0)
    up = _stream(plan, index, "terrain").gauss(0.0, 1.0) * times * sigma_m
    east = off * sin(toward) + (radius if pattern == "survey" else 0.0)
    options["targets"] = [{"label": LABEL, "north": off * cos(toward), "east": east, "up": up}]
    return options


def _of_pattern(pattern: str, radius: float, speed: float, seconds: float) -> dict[str, Any]:
    """The mock's options of the path; metres, m/s."""
    if pattern == "eight":
        return {"flight.pattern": "figure_eight", "flight.half_axes_m": (radius, 0.5 * radius)}
    if pattern == "orbit":
        return {"flight.pattern": "orbit", "flight.half_axes_m": (radius, radius)}
    if pattern == "hover":
        return {"flight.pattern": "hover", "flight.offset_m": (-radius, 0.0)}
    if pattern == "survey":
        return {
            "flight.pattern": "racetrack",
            "flight.half_axes_m": (radius, 0.4 * radius),
            "flight.drift_m_s": (0.0, 2.0 * radius / seconds),
            "flight.centre": (40.0, -25.0 - radius),
        }
    return {
        "flight.pattern": "hover",
        "flight.heading": "course",
        "flight.offset_m": (-0.5 * speed * seconds, 0.0),
        "flight.drift_m_s": (speed, 0.0),
    }


def _of_autopilot(plan: StudyPlan, index: int, truth: Config) -> dict[str, Any]:
    """The autopilot, its clock and its link: an ordinary oscillator, and a wire of a millisecond or three."""
    clock = _stream(plan, index, "clock")
    stamp_delay_s = truth.uncertainty.attitude_stamp_delay_s
    off = dict.fromkeys(ARDUPILOT_DEFAULTS, 0.0)
    if truth.ground.model != "rangefinder":
        off["DISTANCE_SENSOR"] = 0.0
    return {
        "autopilot.system_id": truth.vehicle.system_id or 1,
        "autopilot.drift_ppm": clock.gauss(0.0, 15.0),
        "autopilot.pitch_trim_deg": 0.0,
        "autopilot.gyro_sample_hz": 250.0,
        "autopilot.position_delay_s": truth.vehicle.position_delay_s,
        "autopilot.position_wander": "smooth",
        "autopilot.stamp_delay_s": None if stamp_delay_s == "auto" else stamp_delay_s,
        "autopilot.rates_hz": off,
        "downlink.delay_s": clock.uniform(0.0005, 0.003),
        "downlink.jitter_s": clock.uniform(0.0001, 0.001),
        "uplink.delay_s": clock.uniform(0.0005, 0.003),
        "uplink.jitter_s": clock.uniform(0.0001, 0.001),
    }


def _of_camera(plan: StudyPlan, truth: Config, miss_rate: float) -> dict[str, Any]:
    lens, camera, doubt_s = plan.lens, truth.camera, truth.uncertainty.time_offset_sigma_s
    return {
        "gimbal.device_id": camera.mount.gimbal_device_id,
        "gimbal.late_s": camera.mount.gimbal_delay_s,
        "priors.gimbal_yaw_bias_deg": camera.mount.gimbal_yaw_bias_deg,
        "camera.image_size": lens.image_size,
        "camera.k_mm": lens.k_mm,
        "camera.pixels_per_mm": lens.pixels_per_mm,
        "camera.principal_point": lens.principal_point,
        "camera.max_angle_deg": lens.max_angle * 180.0 / pi,
        "camera.mount_deg": camera.mount.angles,
        "camera.position_m": camera.mount.position_m,
        "camera.fps": _fps(truth),
        "camera.stamp": "row0_mid" if camera.stamp == "auto" else camera.stamp,
        "camera.time_offset_s": camera.time_offset_s,
        "camera.latency_s": min(MOST_LATENCY_S, LATENCY_S + max(0.0, camera.time_offset_s) + 8.0 * doubt_s),
        "camera.missed": miss_rate,
        "camera.clutter": FALSE_DETECTIONS,
        "camera.tell_sigma": False,
        **({"camera.exposure_s": camera.exposure_s} if camera.exposure_s else {}),
    }


def _fps(truth: Config) -> float:
    return truth.vision.fps if truth.vision is not None and truth.vision.fps else FPS


def _readout_s(plan: StudyPlan, index: int, truth: Config) -> float:
    """True readout of the image: as configured, else uniform over what a camera of this rate may have."""
    if truth.camera.known_readout_s is not None:
        return truth.camera.known_readout_s
    return _stream(plan, index, "readout").uniform(0.0, min(1.0 / _fps(truth), LONGEST_READOUT_S))


def _of_priors(plan: StudyPlan, index: int, truth: Config, times: float) -> dict[str, Any]:
    """The sigmas from which the mock draws, each ``times`` that of the configuration."""
    stated = truth.uncertainty
    sigmas = {name: times * getattr(stated, name) for name in (*NOISES, *BIASES)}
    sigmas["pixel_noise_px"] = max(LEAST_PIXEL_NOISE_PX, sigmas["pixel_noise_px"])
    position_m = USUAL_POSITION_M if stated.position_bias_m == "auto" else stated.position_bias_m
    time_s = stated.position_bias_time_s
    if time_s == "auto":
        low, high = map(log, WANDER_TIMES_S)
        time_s = exp(_stream(plan, index, "wander").uniform(low, high))
    sigmas |= {"position_bias_m": times * position_m, "position_bias_time_s": time_s}
    return {f"priors.{name}": sigma for name, sigma in sigmas.items()}


def _paper() -> dict[str, Any]:
    """The paper's values that no key states: the target's place, a still vehicle, 90 pictures."""
    north, east = TARGET_M
    return {
        "flight.offset_m": (0.0, 0.0),
        "flight.wander_deg": 0.0,
        "camera.first_frame_s": FIRST_PICTURE_S,
        "camera.clutter": 0.0,
        "targets": [{"label": LABEL, "north": north, "east": east}],
    }


def _rates_hz(claim: Config) -> dict[str, float]:
    """Rates that the recording companion requests, as the service does."""
    attitude = "ATTITUDE" if claim.vehicle.attitude_message == "ATTITUDE" else "ATTITUDE_QUATERNION"
    return {
        attitude: claim.rates.attitude,
        "GLOBAL_POSITION_INT": claim.rates.position,
        "HOME_POSITION": 0.2,
        "GPS_GLOBAL_ORIGIN": 0.2,
    }
