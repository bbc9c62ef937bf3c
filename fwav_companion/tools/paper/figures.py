"""Draws the paper's three figures and a fourth one, the error sources of a fix."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import numpy as np

from fwav_companion.errors import UserError
from fwav_companion.libraries import require
from fwav_companion.on_disk import made_folder, whole
from fwav_companion.tools.paper.comparison import STATED_PX, PaperComparison, drawn_samples, flapping_pitch
from fwav_companion.tools.paper.experiment import ONE_MM_PX, TARGET_M, filtered

TOLD_HZ = 25.0
"""Rate of attitudes, hertz. At 10 Hz every other stroke has the same phase: the body would not seem to move."""


def draw_figures(folder: Path, seed: int, comparison: PaperComparison) -> list[Path]:
    """The files that were written. UserError: no matplotlib, or the folder cannot be written."""
    require("the figures", "matplotlib")
    import matplotlib as mpl

    mpl.use("Agg")
    from matplotlib import pyplot as plt

    try:
        made_folder(folder)
        return [
            _pitch(plt, folder / "pitch.png"),
            _coordinate(plt, folder / "x.png", 0, seed),
            _coordinate(plt, folder / "y.png", 1, seed),
            _where_the_error_goes(plt, folder / "error-sources.png", comparison),
        ]
    except OSError as error:
        raise UserError(f"{error.filename or folder}: {error.strerror}; accepted: a folder to write to") from error


def _pitch(plt: Any, path: Path) -> Path:
    """Pitch of a flapping body, the latest attitude of it, and the range of the paper's noise."""
    at_s = np.linspace(0.0, 1.0, 800)
    latest = np.degrees(flapping_pitch(np.floor(at_s * TOLD_HZ) / TOLD_HZ))
    figure, axes = plt.subplots(figsize=(9, 3.5), layout="constrained")
    axes.axhspan(36.8, 37.2, color="tab:green", alpha=0.4, label="the paper's simulation: 37° ± two of its 0.1°")
    axes.plot(at_s, np.degrees(flapping_pitch(at_s)), color="tab:blue", label="the body, 5 strokes a second")
    axes.step(at_s, latest, color="tab:red", linewidth=1, label=f"the latest of {TOLD_HZ:.0f} attitudes a second")
    axes.set(title="Pitch of the flapping body: 37° on the mean", xlabel="time, s", ylabel="pitch, °", ylim=(30, 48))
    axes.legend(fontsize="small", loc="upper right", ncols=3)
    return _saved(plt, figure, path)


def _coordinate(plt: Any, path: Path, axis: int, seed: int) -> Path:
    """The first run with the noise that the paper states, and with the noise that gives its Table I."""
    name = "XY"[axis]
    figure, both = plt.subplots(1, 2, figsize=(11, 3.5), layout="constrained")
    for axes, pixel_px in zip(both, (STATED_PX, ONE_MM_PX), strict=True):
        samples = drawn_samples(seed, pixel_px)[:1]
        axes.plot(samples[0, :, axis], ":", color="tab:green", label="each fix")
        axes.plot(filtered(samples, 0.0)[0, :, axis], color="tab:red", label="filtered, start at 0 (the paper's)")
        started = filtered(samples, samples[:, 0])[0, :, axis]
        axes.plot(started, color="tab:blue", label="filtered, start at the first sample")
        axes.axhline(TARGET_M[axis], color="black", linewidth=0.8, label="truth")
        why = "as stated" if pixel_px == STATED_PX else "as Table I needs"
        axes.set(title=f"{name}, detection noise {pixel_px:.0f} px: {why}", xlabel="sample", ylabel=f"{name}, m")
    both[0].legend(fontsize="small")
    return _saved(plt, figure, path)


def _where_the_error_goes(plt: Any, path: Path, comparison: PaperComparison) -> Path:
    """Each cause alone, the largest first, with numbers, since the scale is logarithmic."""
    names = sorted(comparison.rms_by_source_m, key=lambda name: -max(comparison.rms_by_source_m[name]))
    x, y = (np.array([comparison.rms_by_source_m[name][axis] for name in names]) for axis in (0, 1))
    figure, axes = plt.subplots(figsize=(9, 4), layout="constrained")
    at = np.arange(len(names))
    for offset, values, name in ((-0.2, x, "X"), (0.2, y, "Y")):
        bars = axes.barh(at + offset, values, 0.4, label=name)
        axes.bar_label(bars, [f" {value:.2g} m" for value in values], fontsize="small")
    axes.set_yticks(at, names)
    axes.invert_yaxis()
    axes.set(xscale="log", xlim=(1e-3, 20.0), title="Where the error goes")
    axes.set_xlabel("RMS error of one output by this cause alone, m; the target is 5 m away")
    axes.legend(loc="lower right")
    return _saved(plt, figure, path)


def _saved(plt: Any, figure: Any, path: Path) -> Path:
    with whole(path) as file:
        figure.savefig(file, format="png", dpi=110, metadata={"Software": None})
    plt.close(figure)
    return path
