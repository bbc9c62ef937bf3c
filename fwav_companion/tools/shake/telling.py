"""What came of the shaking, in words, as lines for the configuration, and as one object."""

from __future__ import annotations

from collections.abc import Iterator
from math import ceil, cos, degrees
from typing import Any, Final

from fwav_companion.geometry.mounts import describe_mount, euler_from_body_from_camera
from fwav_companion.tools.shake.estimate import Known, Shaken

NEARLY_VERTICAL: Final = 0.1
"""Cosine of the pitch: within 6 deg of straight down, a degree across turns roll and yaw by ten and more."""
ONE_AXIS: Final = "looking straight down, roll and yaw turn about one axis: what counts is their sum"
AXES: Final = ("roll", "pitch", "yaw")
LEAST_DELAY_SIGMA_S: Final = 0.0005
LEAST_MOUNT_SIGMA_DEG: Final = 0.05
"""What is written into [uncertainty] is never less: paper, lens and autopilot err in ways that no shaking shows."""


class Configured:
    """What the configuration says now, and the lines that would say it better."""

    def __init__(self, file: str, time_offset_s: float) -> None:
        self.file = file
        self.time_offset_s = time_offset_s

    def lines(self, shaken: Shaken) -> list[str]:
        """TOML, only of what was found; nothing where a mistake must be put right first."""
        if any(not mistake.mount_rights_it for mistake in shaken.mistakes):
            return []
        lines: list[str] = []
        uncertainty: list[str] = []
        if shaken.delay is not None:
            lines += ["[camera]", f"time_offset_s = {self.time_offset_s + shaken.delay.value:.4f}"]
            sigma_s = max(LEAST_DELAY_SIGMA_S, ceil(shaken.delay.sigma * 1e4) / 1e4)
            uncertainty.append(f"time_offset_sigma_s = {sigma_s:.4f}")
        if shaken.mount is not None and shaken.body_from_camera is not None:
            lines.append("[camera.mount]")
            angles = euler_from_body_from_camera(shaken.body_from_camera)
            for name, angle in zip(AXES, angles, strict=True):
                lines.append(f"{name}_deg = {degrees(angle):.3f}")
            if cos(angles[1]) < NEARLY_VERTICAL:
                lines[-1] += f"  # {ONE_AXIS}"
            sigma_deg = degrees(max(known.sigma for known in shaken.mount))
            uncertainty.append(f"mount_bias_deg = {max(LEAST_MOUNT_SIGMA_DEG, ceil(sigma_deg * 100.0) / 100.0):.2f}")
        return [*lines, "[uncertainty]", *uncertainty] if uncertainty else []

    def told(self, shaken: Shaken) -> Iterator[str]:
        """All of it, line by line."""
        yield from _seen(shaken)
        yield from self._found(shaken)
        for reason in shaken.not_shown:
            yield f"not shown: {reason}"
        for number, mistake in enumerate(shaken.mistakes, start=1):
            yield f"{number}. {mistake.name}"
            yield f"          {mistake.do}"
        lines = self.lines(shaken)
        if lines:
            yield ""
            yield f"for {self.file}, in the place of the keys that stand there:"
            yield from lines

    def _found(self, shaken: Shaken) -> Iterator[str]:
        if shaken.delay is not None:
            total_s = self.time_offset_s + shaken.delay.value
            yield f"delay of the camera: {1e3 * total_s:.1f} ms, one sigma {1e3 * shaken.delay.sigma:.1f} ms"
        if shaken.mount is not None and shaken.body_from_camera is not None:
            yield f"mount: {describe_mount(shaken.body_from_camera)}; off the configured one, about the body's axes, by"
            axes = zip(AXES, shaken.mount, strict=True)
            yield "  " + ", ".join(f"{name} {_deg(known)} deg" for name, known in axes)
            yield "  a constant error of the autopilot's roll and pitch cannot be told from it, and is part of it"
        if shaken.rates is not None:
            lag_ms, sigma_ms = 1e3 * shaken.rates.lag_s, 1e3 * shaken.rates.sigma_s
            yield f"rates come {lag_ms:.1f} ms after the attitude, one sigma {sigma_ms:.1f} ms; `run` allows for it"

    def object(self, shaken: Shaken, *, ok: bool) -> dict[str, Any]:
        """For scripts."""
        return {
            "ok": ok,
            "frames": shaken.frames,
            "side_px": shaken.side_px,
            "held_m": shaken.held_m,
            "turned_deg": degrees(shaken.turned),
            "swung_deg_s": [degrees(rate) for rate in shaken.swung],
            "likeness": shaken.likeness,
            "pixel_sigma": shaken.pixel_sigma,
            "delay": self._delay(shaken),
            "mount": _mount(shaken),
            "rates_lag": None if shaken.rates is None else _plain(Known(shaken.rates.lag_s, shaken.rates.sigma_s), "s"),
            "mistakes": [mistake.name for mistake in shaken.mistakes],
            "not_shown": list(shaken.not_shown),
            "lines": self.lines(shaken),
        }

    def _delay(self, shaken: Shaken) -> dict[str, float] | None:
        if shaken.delay is None:
            return None
        return {"time_offset_s": self.time_offset_s + shaken.delay.value, "sigma_s": shaken.delay.sigma}


def is_usable(shaken: Shaken) -> bool:
    """Both were found, and no mistake stands in the way."""
    return shaken.delay is not None and shaken.mount is not None and not shaken.mistakes


def _seen(shaken: Shaken) -> Iterator[str]:
    if not shaken.frames:
        return
    roll, pitch, yaw = (degrees(rate) for rate in shaken.swung)
    yield f"the tag was seen in {shaken.frames} frames, {4 * shaken.frames} corners, {shaken.side_px:.0f} pixels a side"
    if shaken.held_m:
        yield f"it was {shaken.held_m:.2f} m from the camera; if that is wrong, so is --tag-size, or the camera file"
    yield (
        f"shaken at {roll:.0f} deg/s in roll, {pitch:.0f} in pitch, {yaw:.0f} in yaw; turned by "
        f"{degrees(shaken.turned):.0f} deg"
    )


def _mount(shaken: Shaken) -> dict[str, Any] | None:
    if shaken.mount is None or shaken.body_from_camera is None:
        return None
    angles = euler_from_body_from_camera(shaken.body_from_camera)
    return {
        "correction_deg": [degrees(known.value) for known in shaken.mount],
        "sigma_deg": [degrees(known.sigma) for known in shaken.mount],
        **{f"{name}_deg": degrees(angle) for name, angle in zip(AXES, angles, strict=True)},
    }


def _plain(known: Known, unit: str) -> dict[str, float]:
    return {f"lag_{unit}": known.value, f"sigma_{unit}": known.sigma}


def _deg(known: Known) -> str:
    return f"{degrees(known.value):+.2f} ± {degrees(known.sigma):.2f}"
