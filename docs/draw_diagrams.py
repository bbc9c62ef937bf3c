#!/usr/bin/env python3
"""Draws docs/drawings/*.svg: the wiring, the error budget by height, and what a delay does while a wing flaps.

``.venv/bin/python docs/draw_diagrams.py``. It needs matplotlib, which the extra ``[demo]`` brings. The curves are the
formulas of the handbook's tables, with the default configuration's sigmas.
"""

from __future__ import annotations

import argparse
import sys
from math import cos, hypot, pi, radians, sin, tan
from pathlib import Path
from typing import Final

import matplotlib as mpl
from matplotlib.axes import Axes
from matplotlib.figure import Figure
from matplotlib.patches import FancyBboxPatch

from fwav_companion.config.estimation import USUAL_POSITION_SIGMA_M, UncertaintyConfig

FOLDER: Final = Path(__file__).parent / "drawings"
SIGMAS: Final = UncertaintyConfig()
PX_PER_RADIAN: Final = 667.0
"""Of the camera that `init` writes: 3.55 mm times 188 pixels per millimetre."""
HEIGHTS_M: Final = [2.0 * 1.1**k for k in range(40)]
"""2 to 82 m."""
TICKS_M: Final = (2, 5, 10, 20, 50)


def causes_m(height_m: float, angle: float) -> dict[str, float]:
    """One sigma of each cause, metres along the ray's ground direction, ``angle`` off the vertical. A still vehicle."""
    along = height_m / cos(angle) ** 2  # d(ground distance)/d(angle)
    return {
        "position": hypot(USUAL_POSITION_SIGMA_M, SIGMAS.position_noise_m),
        "mount": along * radians(SIGMAS.mount_bias_deg),
        "attitude": along * radians(hypot(SIGMAS.attitude_bias_deg, SIGMAS.attitude_noise_deg)),
        "height": tan(angle) * hypot(SIGMAS.height_bias_m, SIGMAS.height_noise_m),
        "heading": height_m * tan(angle) * radians(SIGMAS.heading_bias_deg),
        "pixel": along * SIGMAS.pixel_noise_px / PX_PER_RADIAN,
    }


def budget() -> Figure:
    """The causes by height, straight down and at 45 degrees."""
    figure = Figure(figsize=(9.0, 3.6), layout="constrained")
    axes = figure.subplots(1, 2, sharey=True)
    for subplot, angle in zip(axes, (0.0, pi / 4), strict=True):
        for cause in causes_m(1.0, angle):
            curve = [max(causes_m(h, angle)[cause], 1e-9) for h in HEIGHTS_M]
            subplot.loglog(HEIGHTS_M, curve, label=cause, linestyle="--" if cause == "heading" else "-")
        totals = [hypot(*causes_m(h, angle).values()) for h in HEIGHTS_M]
        subplot.loglog(HEIGHTS_M, totals, color="black", linewidth=2.5, label="all")
        subplot.set(
            title="straight down" if angle == 0.0 else "45° off the vertical", xlabel="height, m", ylim=(0.01, 10)
        )
        subplot.set_xticks(TICKS_M, map(str, TICKS_M))
        subplot.set_xticks([], minor=True)
        subplot.grid(visible=True, which="both", alpha=0.25)
    axes[0].set_ylabel("one sigma of one fix, m")
    axes[1].legend(fontsize=8, loc="lower right")
    return figure


def flapping() -> Figure:
    """Largest apparent motion of a target below, 10 m under the vehicle, by the error of time: 2 A |sin(pi f dt)| h."""
    figure = Figure(figsize=(7.0, 3.4), layout="constrained")
    axes = figure.subplots()
    delays_s = [0.0005 * k for k in range(81)]
    for amplitude_deg, frequency_hz in ((5.0, 5.0), (3.0, 12.0), (1.0, 5.0)):
        swing = radians(amplitude_deg)
        motion_m = [2.0 * swing * abs(sin(pi * frequency_hz * delay)) * 10.0 for delay in delays_s]
        axes.plot([1e3 * d for d in delays_s], motion_m, label=f"{amplitude_deg:.0f}° at {frequency_hz:.0f} Hz")
    axes.set(xlabel="error of time between picture and attitude, ms", ylabel="apparent motion, m")
    axes.grid(visible=True, alpha=0.25)
    axes.legend()
    return figure


def wiring() -> Figure:
    """The three wires between autopilot and Raspberry Pi."""
    figure = Figure(figsize=(8.0, 3.2), layout="constrained")
    axes = figure.subplots()
    axes.set(xlim=(0, 16), ylim=(0, 6.4))
    axes.axis("off")
    _box(axes, 0.3, "autopilot, TELEM2")
    _box(axes, 11.2, "Raspberry Pi")
    wires = (
        ("2  TX", "RXD  pin 10", "tab:green"),
        ("3  RX", "TXD  pin 8", "tab:blue"),
        ("6  GND", "GND  pin 6", "black"),
    )
    for row, (left, right, color) in enumerate(wires):
        y = 4.2 - 1.4 * row
        axes.plot([4.8, 11.2], [y, y], color=color, linewidth=3)
        axes.text(4.5, y, left, ha="right", va="center", fontsize=12, family="monospace")
        axes.text(11.5, y, right, ha="left", va="center", fontsize=12, family="monospace")
    axes.text(8.0, 5.6, "3.3 V levels; 5 V (pin 1) stays open", ha="center", fontsize=11)
    axes.text(8.0, 0.4, "5 V for the Raspberry Pi: from a regulator of its own", ha="center", fontsize=11)
    return figure


def _box(axes: Axes, x: float, title: str) -> None:
    axes.add_patch(FancyBboxPatch((x, 0.8), 4.5, 4.2, boxstyle="round,pad=0.1", facecolor="0.95", edgecolor="0.3"))
    axes.text(x + 2.25, 5.3, title, ha="center", fontsize=12, weight="bold")


def draw(folder: Path) -> list[Path]:
    """Write every drawing; the same bytes each time with one version of matplotlib."""
    mpl.rcParams |= {"svg.hashsalt": "fwav-companion", "svg.fonttype": "none", "font.family": "sans-serif"}
    folder.mkdir(exist_ok=True)
    paths = []
    for make in (wiring, budget, flapping):
        path = folder / f"{make.__name__}.svg"
        make().savefig(path, metadata={"Date": None})
        paths.append(path)
    return paths


if __name__ == "__main__":
    argparse.ArgumentParser(description=__doc__).parse_args()
    for drawn in draw(FOLDER):
        sys.stdout.write(f"{drawn}\n")
