"""The paper's three figures, and one that it does not have: where the error of a fix comes from."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import numpy as np

from fwav_companion.errors import UserError
from fwav_companion.paper.comparison import Comparison, flapping_pitch
from fwav_companion.paper.experiment import ONE_MM_PX, TARGET_M, Noise, filtered, located_samples


def draw_figures(folder: Path, seed: int, comparison: Comparison) -> list[Path]:
    """The files that were written. UserError: no matplotlib, or the folder cannot be written."""
    try:
        import matplotlib as mpl

        mpl.use("Agg")
        from matplotlib import pyplot as plt
    except ImportError as error:
        raise UserError("the figures need matplotlib: pip install 'fwav-companion[demo]'") from error
    try:
        folder.mkdir(parents=True, exist_ok=True)
        return [
            _pitch(plt, folder / "pitch.png"),
            _coordinate(plt, folder / "x.png", 0, seed),
            _coordinate(plt, folder / "y.png", 1, seed),
            _where_the_error_goes(plt, folder / "error-sources.png", comparison),
        ]
    except OSError as error:
        raise UserError(f"{error.filename or folder}: {error.strerror}; a folder to write to is accepted") from error


def _pitch(plt: Any, path: Path) -> Path:
    at_s = np.linspace(0.0, 2.0, 400)
    figure, axes = plt.subplots(figsize=(8, 3), layout="constrained")
    axes.plot(at_s, np.degrees(flapping_pitch(at_s)), color="tab:blue")
    axes.set(title="Pitch of the flapping body: 37° on the mean", xlabel="time, s", ylabel="pitch, °")
    return _saved(plt, figure, path)


def _coordinate(plt: Any, path: Path, axis: int, seed: int) -> Path:
    """One run each with the noise that the paper states and with the one that gives its Table I."""
    name = "XY"[axis]
    figure, both = plt.subplots(1, 2, figsize=(11, 3.5), layout="constrained")
    for axes, pixel_px in zip(both, (4.0, ONE_MM_PX), strict=True):
        samples = located_samples(np.random.default_rng(seed), 1, Noise(pixel_px=pixel_px))
        axes.plot(samples[0, :, axis], ":", color="tab:green", label="each fix")
        axes.plot(filtered(samples, 0.0)[0, :, axis], color="tab:red", label="filtered, start at 0 (the paper's)")
        started = filtered(samples, samples[:, 0])[0, :, axis]
        axes.plot(started, color="tab:blue", label="filtered, start at the first sample")
        axes.axhline(TARGET_M[axis], color="black", linewidth=0.8, label="truth")
        axes.set(title=f"{name}, detection noise {pixel_px:.0f} px", xlabel="sample", ylabel=f"{name}, m")
    both[0].legend(fontsize="small")
    return _saved(plt, figure, path)


def _where_the_error_goes(plt: Any, path: Path, comparison: Comparison) -> Path:
    names = list(comparison.rms_by_source_m)
    x, y = (np.array([comparison.rms_by_source_m[name][axis] for name in names]) for axis in (0, 1))
    figure, axes = plt.subplots(figsize=(8, 4), layout="constrained")
    at = np.arange(len(names))
    axes.barh(at - 0.2, x, 0.4, label="X")
    axes.barh(at + 0.2, y, 0.4, label="Y")
    axes.set_yticks(at, names)
    axes.invert_yaxis()
    axes.set(xscale="log", xlabel="RMS error of one output by this cause alone, m", title="Where the error goes")
    axes.legend()
    return _saved(plt, figure, path)


def _saved(plt: Any, figure: Any, path: Path) -> Path:
    figure.savefig(path, dpi=110, metadata={"Software": None})
    plt.close(figure)
    return path
