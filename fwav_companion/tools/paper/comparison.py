"""Comparison of the paper's Table I with the results of its own constants over many runs; error sources of one fix."""

from __future__ import annotations

from collections.abc import Callable
from math import pi, radians

import msgspec
import numpy as np

from fwav_companion.tools.paper.experiment import (
    ALPHA,
    BETA,
    HEIGHT_M,
    LENS,
    ONE_MM_PX,
    TARGET_M,
    Floats,
    Noise,
    averaged,
    filtered,
    ground_points,
    located_samples,
)

RUNS = 2000
STEPS = 4
STATED_PX, MORE_PX = 4.0, 200.0
FLAP_HZ, FLAP = 5.0, radians(5.0)
"""Frequency and amplitude of the pitch, as of a bird of this size."""


class Quantity(msgspec.Struct, frozen=True):
    """One number of a row."""

    median: float
    median_sigma: float
    """One sigma of the median itself, between seeds."""
    low: float
    """5th percentile of the runs."""
    high: float
    """95th percentile of the runs."""
    one_run: float
    """Value of the first run, as an example of a single repetition of the experiment."""


class ComparisonRow(msgspec.Struct, frozen=True):
    """A line of the comparison: the same four numbers as in Table I, variances with ddof = 0."""

    name: str
    mean_x: Quantity
    var_x: Quantity
    mean_y: Quantity
    var_y: Quantity
    refused: int
    """Number of samples of all runs whose ray did not meet the ground."""


TABLE_I = {
    "unfiltered": {"mean_x": 4.54, "var_x": 18.76, "mean_y": 3.46, "var_y": 15.74},
    "filtered": {"mean_x": 4.11, "var_x": 1.24, "mean_y": 3.17, "var_y": 2.51},
}


class PaperComparison(msgspec.Struct, frozen=True):
    """Result of the command."""

    rows: tuple[ComparisonRow, ...]
    variance_ratio: float
    """Measured ratio of the variance of the settled filter's output to that of its input."""
    variance_ratio_theory: float
    """The same ratio in theory: alpha / (2 - alpha)."""
    start_ratio: float
    """Ratio of filtered to unfiltered mean in theory, due to the start at 0 alone."""
    rms_by_source_m: dict[str, tuple[float, float]]
    """RMS error (X, Y) of one fix from each cause alone."""


def compare(seed: int, runs: int = RUNS, on_step: Callable[[], None] = lambda: None) -> PaperComparison:
    """The whole experiment; the same seed gives the same numbers. ``on_step`` is called :data:`STEPS` times.

    Every noise is drawn once and scaled, so that rows differ only by what their names say.
    """
    stated, one_mm, more = (drawn_samples(seed, px, runs, on_step) for px in (STATED_PX, ONE_MM_PX, MORE_PX))
    rng = np.random.default_rng((seed, 1))
    rows = (
        _row("stated noise, unfiltered", stated),
        _row("stated noise, filtered, start at 0 (the paper's)", filtered(stated, 0.0)),
        _row("stated noise, filtered, start at the first sample", filtered(stated, stated[:, 0])),
        _row("stated noise, Kalman, a target that stands still", averaged(stated)),
        _row("detection noise 188 px (1 mm), unfiltered", one_mm),
        _row("the same, filtered, start at 0 (the paper's)", filtered(one_mm, 0.0)),
        _row("the same, filtered, start at the first sample", filtered(one_mm, one_mm[:, 0])),
        _row("the same, Kalman, a target that stands still", averaged(one_mm)),
        _row("detection noise 200 px, unfiltered", more),
    )
    white = rng.standard_normal((200, 2000, 1))
    settled = filtered(white, 0.0)[:, 200:]
    on_step()
    k = np.arange(stated.shape[1])
    return PaperComparison(
        rows=rows,
        variance_ratio=float(settled.var() / white[:, 200:].var()),
        variance_ratio_theory=ALPHA / (2.0 - ALPHA),
        start_ratio=float(np.mean(1.0 - (1.0 - ALPHA) ** k)),
        rms_by_source_m=_rms_by_source(rng),
    )


def drawn_samples(seed: int, pixel_px: float, runs: int = RUNS, on_step: Callable[[], None] = lambda: None) -> Floats:
    """(runs, 90, 2) samples of the comparison; the figures show the first run."""
    samples = located_samples(np.random.default_rng(seed), runs, Noise(pixel_px=pixel_px))
    on_step()
    return samples


def _row(name: str, output: Floats) -> ComparisonRow:
    """The row of a (runs, 90, 2) output."""
    means, variances = np.nanmean(output, axis=1), np.nanvar(output, axis=1)
    return ComparisonRow(
        name=name,
        mean_x=_quantity(means[:, 0]),
        var_x=_quantity(variances[:, 0]),
        mean_y=_quantity(means[:, 1]),
        var_y=_quantity(variances[:, 1]),
        refused=int(np.isnan(output[..., 0]).sum()),
    )


def _quantity(by_run: Floats) -> Quantity:
    low, median, high = np.percentile(by_run, [5.0, 50.0, 95.0])
    n, half = len(by_run), 0.5 * len(by_run) ** 0.5  # the rank of the median is binomial: sigma sqrt(n) / 2
    below, above = np.percentile(by_run, [50.0 - 100.0 * half / n, 50.0 + 100.0 * half / n])
    return Quantity(
        median=float(median),
        median_sigma=float(above - below) / 2.0,
        low=float(low),
        high=float(high),
        one_run=float(by_run[0]),
    )


def _rms_by_source(rng: np.random.Generator) -> dict[str, tuple[float, float]]:
    none = Noise(0.0, 0.0, 0.0)
    replace, runs = msgspec.structs.replace, 200
    fixes = {
        "pitch angle, 0.1 deg": located_samples(rng, runs, replace(none, beta_deg=0.1)),
        "height, 0.5 m": located_samples(rng, runs, replace(none, height_m=0.5)),
        "detection, 4 px": located_samples(rng, runs, replace(none, pixel_px=4.0)),
        "detection, 188 px": located_samples(rng, runs, replace(none, pixel_px=ONE_MM_PX)),
        "the filter's start at 0": filtered(located_samples(rng, runs, none), 0.0),
        "flapping, attitude up to 20 ms old": stale_fixes(rng.uniform(0.0, 0.02, 20_000), rng),
        "flapping, attitude up to 100 ms old": stale_fixes(rng.uniform(0.0, 0.1, 20_000), rng),
    }
    return {name: _rms(points) for name, points in fixes.items()}


def flapping_pitch(at_s: Floats) -> Floats:
    """Pitch of the body, radians; its mean is 37 degrees."""
    return BETA + FLAP * np.sin(2.0 * pi * FLAP_HZ * at_s)


def stale_fixes(age_s: Floats, rng: np.random.Generator) -> Floats:
    """(N, 2) fixes of the target without noise, with an attitude that is ``age_s`` older than the picture."""
    at_s = rng.uniform(0.0, 1.0 / FLAP_HZ, age_s.shape)
    true, old = flapping_pitch(at_s), flapping_pitch(at_s - age_s)
    (x, y), c, s = TARGET_M, np.cos(true), np.sin(true)
    points = np.stack([c * x - s * HEIGHT_M, np.full_like(c, y), s * x + c * HEIGHT_M], axis=-1)
    pixels = np.array([LENS.pixel_from_camera_point((a, b, d)) for a, b, d in points.tolist()])
    return ground_points(pixels, old, np.full_like(old, HEIGHT_M))


def _rms(points: Floats) -> tuple[float, float]:
    off = points.reshape(-1, 2) - np.array(TARGET_M)
    x, y = np.sqrt(np.nanmean(off**2, axis=0)).tolist()
    return (x, y)
