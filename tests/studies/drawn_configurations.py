"""One configuration drawn within what users set: file, lens, flight. PURE."""

from __future__ import annotations

from math import atan, exp, log, radians, sqrt
from random import Random
from typing import Any

import msgspec

from fwav_companion.tools.study.study_plan import PATTERNS, RadialLens, StudyPlan

SIGMAS = {
    "pixel_noise_px": (0.3, 8.0),
    "attitude_noise_deg": (0.02, 0.5),
    "attitude_bias_deg": (0.05, 2.0),
    "heading_bias_deg": (0.3, 10.0),
    "position_noise_m": (0.01, 0.5),
    "position_bias_m": (0.02, 3.0),
    "position_bias_time_s": (20.0, 1800.0),
    "position_delay_sigma_s": (0.005, 0.2),
    "lever_arm_sigma_m": (0.003, 0.1),
    "height_noise_m": (0.02, 1.0),
    "height_bias_m": (0.02, 3.0),
    "terrain_m": (0.1, 3.0),
    "mount_bias_deg": (0.05, 5.0),
    "time_offset_sigma_s": (0.0005, 0.05),
    "attitude_stamp_delay_s": (0.001, 0.02),
}
"""Ranges of [uncertainty] from a good receiver or a measured mount to guesses, log-uniform."""
DEFAULT_SHARE, ZERO_SHARE = 0.4, 0.05
"""Shares of keys that a user leaves out, and of biases that are stated as zero."""
SECONDS = (20.0, 30.0)
MOST_TURN_M_S2 = 12.0
"""Largest acceleration of a turn: a bank of 50 degrees."""
SHARPEST = {"eight": 0.5, "orbit": 1.0, "survey": 0.16}
"""Least radius of a turn over the radius of the pattern."""
LEAST_RADIUS = {"eight": 1.25, "orbit": 0.26, "survey": 1.5}
"""Least radius of the pattern that a study chooses, over the height."""


class DrawnConfiguration(msgspec.Struct, frozen=True):
    """A configuration file and a flight by it."""

    text: str
    """The configuration, TOML; its lens is ``camera-INDEX.yaml``."""
    lens: RadialLens
    pattern: str
    seconds: float
    settings: tuple[tuple[str, str], ...]
    """Keys of the flight, as --set has them; and self-calibration, which studies have on unless it is set."""


def drawn_plan(seed: int, index: int) -> StudyPlan:
    """The study whose flight ``index`` is flown."""
    drawn = drawn_configuration(Random(f"{seed}/{index}/configuration"), index)
    return StudyPlan(
        config=drawn.text,
        config_name=f"drawn-{index}.toml",
        lens=drawn.lens,
        flights=index + 1,
        seconds=drawn.seconds,
        pattern=drawn.pattern,  # type: ignore[arg-type]
        seed=seed,
        settings=drawn.settings,
    )


def drawn_configuration(rng: Random, index: int) -> DrawnConfiguration:
    """A configuration of a wing or a copter."""
    lens, is_wing, pattern = _lens(rng), rng.random() < 0.6, rng.choice(PATTERNS)
    tables = {
        "vehicle": _vehicle(rng),
        "rates": {"attitude": rng.choice((20.0, 50.0, 100.0, 100.0, 200.0)), "position": rng.choice((2.0, 5.0, 10.0))},
        "camera": {"calibration": f"camera-{index}.yaml", **_camera(rng)},
        "camera.mount": _mount(rng),
        "vision": {"source": "/dev/video0", "fps": float(rng.choice((10, 15, 24, 60)))} if rng.random() < 0.3 else {},
        "ground": {"model": "rangefinder"} if rng.random() < 0.2 else {},
        "uncertainty": _uncertainty(rng),
        "tracking": _tracking(rng),
    }
    text = "".join(f"[{name}]\n{_lines(table)}\n" for name, table in tables.items() if table)
    seconds = round(rng.uniform(*SECONDS), 1)
    settings = _flight(rng, pattern, is_wing=is_wing)
    if rng.random() < 0.3:
        settings += (("tracking.self_calibration", "false"),)
    return DrawnConfiguration(text, lens, pattern, seconds, settings)


def _lines(table: dict[str, Any]) -> str:
    return "".join(f"{key} = {msgspec.json.encode(value).decode()}\n" for key, value in table.items())


def _log(rng: Random, low: float, high: float) -> float:
    """Log-uniform, three digits."""
    return float(f"{exp(rng.uniform(log(low), log(high))):.3g}")


def _lens(rng: Random) -> RadialLens:
    width, height = rng.choice(((640, 480), (1280, 720), (1456, 1088), (1920, 1080)))
    focal = round(width * _log(rng, 0.4, 1.6), 1)
    centre = (round(0.5 * width + rng.gauss(0.0, 5.0), 1), round(0.5 * height + rng.gauss(0.0, 5.0), 1))
    bent = round(rng.uniform(-0.03, 0.03), 4)
    corner = min(radians(75.0), 1.2 * atan(0.5 * (width * width + height * height) ** 0.5 / focal))
    return RadialLens((1.0, bent, 0.0, 0.0, 0.0), (focal, focal), centre, (width, height), round(corner, 4))


def _vehicle(rng: Random) -> dict[str, Any]:
    found: dict[str, Any] = {"attitude_message": rng.choice(("auto", "auto", "ATTITUDE", "ATTITUDE_QUATERNION"))}
    if rng.random() < 0.3:
        found["position_delay_s"] = _log(rng, 0.02, 0.3)
    return found


def _camera(rng: Random) -> dict[str, Any]:
    found: dict[str, Any] = {"stamp": rng.choice(("auto", "row0_mid", "row0_start", "row0_end"))}
    if rng.random() < 0.5:
        found["exposure_s"] = _log(rng, 0.0005, 0.015)
    if rng.random() < 0.4:
        found["time_offset_s"] = round(rng.uniform(-0.02, 0.12), 4)
    if rng.random() < 0.5:
        found["readout_s"] = rng.choice((0.0, _log(rng, 0.004, 0.033), _log(rng, 0.004, 0.033)))
    return found


def _mount(rng: Random) -> dict[str, Any]:
    found: dict[str, Any] = {}
    if rng.random() < 0.1:
        found = {"gimbal_device_id": rng.choice((1, 154)), "pitch_deg": 0.0}
    elif rng.random() < 0.5:
        found["pitch_deg"] = round(rng.uniform(-90.0, -30.0), 1)
        found["roll_deg"] = round(rng.gauss(0.0, 3.0), 1)
        found["yaw_deg"] = rng.choice((0.0, 0.0, 90.0, 180.0, -90.0, round(rng.gauss(0.0, 4.0), 1)))
    if rng.random() < 0.4:
        found["position_m"] = [round(rng.uniform(-0.3, 0.3), 3) for _ in range(3)]
    return found


def _uncertainty(rng: Random) -> dict[str, Any]:
    found: dict[str, Any] = {}
    for name, (low, high) in SIGMAS.items():
        share = rng.random()
        if share < DEFAULT_SHARE:
            continue
        is_bias = "noise" not in name and name != "position_bias_time_s"
        found[name] = 0.0 if is_bias and share < DEFAULT_SHARE + ZERO_SHARE else _log(rng, low, high)
    if rng.random() < 0.8:
        found.pop("terrain_m", None)
    return found


def _tracking(rng: Random) -> dict[str, Any]:
    found: dict[str, Any] = {"motion": "static"}
    if rng.random() < 0.15:
        found |= {"filter": "lowpass", "alpha": _log(rng, 0.03, 0.5)}
    elif rng.random() < 0.2:
        found["motion"] = "moving"
    return found


def _flight(rng: Random, pattern: str, *, is_wing: bool) -> tuple[tuple[str, str], ...]:
    height_m, speed_m_s = _log(rng, 2.0, 80.0), _log(rng, 1.0, 16.0)
    radius_m = _log(rng, 0.3 * height_m, 2.0 * height_m) if rng.random() < 0.3 else None
    if pattern in SHARPEST:
        turn_m = SHARPEST[pattern] * (radius_m or LEAST_RADIUS[pattern] * height_m)
        speed_m_s = min(speed_m_s, float(f"{sqrt(MOST_TURN_M_S2 * turn_m):.3g}"))
    values: dict[str, float] = {
        "height_m": height_m,
        "speed_m_s": speed_m_s,
        "wind_m_s": round(rng.uniform(0.0, 0.5) * (min(speed_m_s, 10.0) if pattern != "hover" else 10.0), 2),
        "miss_rate": round(rng.random() ** 3 * 0.9, 2),
    }
    if is_wing:
        values |= {"flap_hz": _log(rng, 2.0, 12.0), "flap_deg": _log(rng, 1.0, 12.0)}
    else:
        values |= {"flap_deg": 0.0, "pitch_deg": round(rng.gauss(0.0, 5.0), 1)}
    if radius_m is not None:
        values["radius_m"] = radius_m
    return tuple((f"flight.{name}", repr(value)) for name, value in values.items())
