"""The result of ``check --shake`` as text, as lines for the configuration, and as one JSON object."""

from __future__ import annotations

from collections.abc import Iterator
from math import ceil, cos, degrees
from typing import Any, Final

from fwav_companion.geometry.mounts import describe_mount, euler_from_body_from_camera
from fwav_companion.tools.shake.estimate import ShakeEstimate, WithSigma

NEARLY_VERTICAL: Final = 0.1
"""Cosine of the pitch below which the camera looks nearly straight down: within 6 deg of it, a rotation by a degree
across changes roll and yaw by ten degrees and more."""
ONE_AXIS: Final = "looking straight down, roll and yaw turn about one axis: what counts is their sum"
AXES: Final = ("roll", "pitch", "yaw")
LEAST_DELAY_SIGMA_S: Final = 0.0005
LEAST_MOUNT_SIGMA_DEG: Final = 0.05
"""Least sigmas in the lines for [uncertainty]: print, lens and autopilot have errors that no shaking shows."""


class ShakeReport:
    """Writes results against the configuration that they correct."""

    def __init__(self, file: str, time_offset_s: float) -> None:
        """``file``: the configuration's name. ``time_offset_s``: as configured."""
        self.file = file
        self.time_offset_s = time_offset_s

    def toml_lines(self, result: ShakeEstimate) -> list[str]:
        """Configuration lines of what was found; empty while a sign error must be corrected first."""
        if any(not error.fixed_by_mount for error in result.sign_errors):
            return []
        lines: list[str] = []
        uncertainty: list[str] = []
        if result.delay is not None:
            lines += ["[camera]", f"time_offset_s = {self.time_offset_s + result.delay.value:.4f}"]
            sigma_s = max(LEAST_DELAY_SIGMA_S, ceil(result.delay.sigma * 1e4) / 1e4)
            uncertainty.append(f"time_offset_sigma_s = {sigma_s:.4f}")
        if result.mount is not None and result.body_from_camera is not None:
            lines.append("[camera.mount]")
            angles = euler_from_body_from_camera(result.body_from_camera)
            for name, angle in zip(AXES, angles, strict=True):
                lines.append(f"{name}_deg = {degrees(angle):.3f}")
            if cos(angles[1]) < NEARLY_VERTICAL:
                lines[-1] += f"  # {ONE_AXIS}"
            sigma_deg = degrees(max(angle.sigma for angle in result.mount))
            uncertainty.append(f"mount_bias_deg = {max(LEAST_MOUNT_SIGMA_DEG, ceil(sigma_deg * 100.0) / 100.0):.2f}")
        return [*lines, "[uncertainty]", *uncertainty] if uncertainty else []

    def text(self, result: ShakeEstimate) -> Iterator[str]:
        """The whole result, line by line."""
        yield from _session(result)
        yield from self._found(result)
        for reason in result.not_shown:
            yield f"not shown: {reason}"
        for number, error in enumerate(result.sign_errors, start=1):
            yield f"{number}. {error.name}"
            yield f"          {error.fix}"
        lines = self.toml_lines(result)
        if lines:
            yield ""
            yield f"for {self.file}, in place of the present values of these keys:"
            yield from lines

    def _found(self, result: ShakeEstimate) -> Iterator[str]:
        if result.delay is not None:
            total_s = self.time_offset_s + result.delay.value
            yield f"delay of the camera: {1e3 * total_s:.1f} ms, one sigma {1e3 * result.delay.sigma:.1f} ms"
        if result.mount is not None and result.body_from_camera is not None:
            yield f"mount: {describe_mount(result.body_from_camera)}; correction of the configured one, body axes:"
            axes = zip(AXES, result.mount, strict=True)
            yield "  " + ", ".join(f"{name} {_deg(angle)} deg" for name, angle in axes)
            yield "  it includes the autopilot's constant roll and pitch error, which cannot be separated from it"
        if result.rate_lag is not None:
            lag_ms, sigma_ms = 1e3 * result.rate_lag.lag_s, 1e3 * result.rate_lag.sigma_s
            yield f"rates come {lag_ms:.1f} ms after the attitude, one sigma {sigma_ms:.1f} ms; `run` corrects for it"

    def json_object(self, result: ShakeEstimate, *, ok: bool) -> dict[str, Any]:
        """The result for scripts."""
        lag = result.rate_lag
        return {
            "ok": ok,
            "frames": result.frames,
            "side_px": result.side_px,
            "held_m": result.distance_m,
            "turned_deg": degrees(result.heading_change),
            "swung_deg_s": [degrees(rate) for rate in result.rates_rms],
            "likeness": result.correlation,
            "pixel_sigma": result.pixel_sigma,
            "delay": self._delay(result),
            "mount": _mount(result),
            "rates_lag": None if lag is None else {"lag_s": lag.lag_s, "sigma_s": lag.sigma_s},
            "mistakes": [error.name for error in result.sign_errors],
            "not_shown": list(result.not_shown),
            "lines": self.toml_lines(result),
        }

    def _delay(self, result: ShakeEstimate) -> dict[str, float] | None:
        if result.delay is None:
            return None
        return {"time_offset_s": self.time_offset_s + result.delay.value, "sigma_s": result.delay.sigma}


def is_usable(result: ShakeEstimate) -> bool:
    """Whether delay and mount were found without a sign error."""
    return result.delay is not None and result.mount is not None and not result.sign_errors


def _session(result: ShakeEstimate) -> Iterator[str]:
    if not result.frames:
        return
    yield f"the tag was seen in {result.frames} frames, {4 * result.frames} corners, {result.side_px:.0f} pixels a side"
    if result.distance_m:
        yield f"its distance was {result.distance_m:.2f} m; if that is wrong, so is --tag-size, or the camera file"
    roll, pitch, yaw = (degrees(rate) for rate in result.rates_rms)
    shaken = f"shaken at {roll:.0f} deg/s in roll, {pitch:.0f} in pitch, {yaw:.0f} in yaw"
    yield f"{shaken}; turned by {degrees(result.heading_change):.0f} deg"


def _mount(result: ShakeEstimate) -> dict[str, Any] | None:
    if result.mount is None or result.body_from_camera is None:
        return None
    angles = euler_from_body_from_camera(result.body_from_camera)
    return {
        "correction_deg": [degrees(angle.value) for angle in result.mount],
        "sigma_deg": [degrees(angle.sigma) for angle in result.mount],
        **{f"{name}_deg": degrees(angle) for name, angle in zip(AXES, angles, strict=True)},
    }


def _deg(angle: WithSigma) -> str:
    return f"{degrees(angle.value):+.2f} ± {degrees(angle.sigma):.2f}"
