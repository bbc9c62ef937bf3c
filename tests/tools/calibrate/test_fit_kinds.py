"""Lenses of every kind, narrow and wide, off the image's middle: found from their corners alone, with no guess."""

import numpy as np
import pytest
from drawn_boards import TrueLens, views
from draws import first_rows_of

from fwav_companion.tools.calibrate.lens_fit.bundle_adjustment import adjusted, residuals, with_flips_resolved
from fwav_companion.tools.calibrate.lens_fit.initial_estimate import initial_estimate
from fwav_companion.tools.calibrate.lens_fit.lens_fit import FittedLens, fit_lens
from fwav_companion.tools.calibrate.lens_fit.reprojection import BoardView, LensAndPoses, concatenated

KINDS = {
    "f theta": (1.0,),
    "f tan(theta)": (1.0, 1 / 3, 2 / 15, 17 / 315, 62 / 2835),
    "2 f tan(theta / 2)": (1.0, 1 / 12, 1 / 120, 17 / 20160, 31 / 362880),
    "2 f sin(theta / 2)": (1.0, -1 / 24, 1 / 1920, -1 / 322560),
    "f sin(theta)": (1.0, -1 / 6, 1 / 120, -1 / 5040),
}
"""Lenses by their series."""
HALF_ANGLES_DEG = {
    "f theta": (100.0, 9.0),
    "f tan(theta)": (36.0, 6.0),
    "2 f tan(theta / 2)": (90.0, 15.0),
    "2 f sin(theta / 2)": (100.0, 30.0),
    "f sin(theta)": (65.0, 25.0),
}


def lens_of(kind, half_deg, size=(640, 480), off=0.04):
    """Seen up to ``half_deg`` at the image's corner, or where it is wide at its upper edge."""
    half, series = np.radians(half_deg), KINDS[kind]
    edge = np.hypot(*size) / 2 if half_deg < 50 else size[1] / 2
    focal = edge / sum(c * half ** (2 * i + 1) for i, c in enumerate(series))
    centre = (size[0] * (0.5 + off), size[1] * (0.5 - off))
    return TrueLens(tuple(focal * c for c in series), centre, size, 1.002, 1.05 * half), half


@pytest.mark.parametrize(
    ("kind", "half_deg"),
    first_rows_of(*((kind, HALF_ANGLES_DEG[kind][narrow]) for narrow in (0, 1) for kind in KINDS), few=len(KINDS)),
)
def test_it_is_found(kind, half_deg):
    lens, half = lens_of(kind, half_deg)
    seen = [BoardView(*view) for view in views(lens, np.random.default_rng(8), 16, reach=0.8 * half, share=0.8 * half)]
    fitted = fit_lens(seen, lens.size)
    assert isinstance(fitted, FittedLens)
    assert not fitted.dropped
    assert fitted.noise_px == pytest.approx(0.1, rel=0.15)
    assert fitted.lens[3] == pytest.approx(lens.c[0], abs=4.0 * fitted.sigma(3))


def mirrored(state, board, i):
    """Board i turned by half a turn about the line of sight and back about its own normal: its other pose."""
    turns = state.rotations.copy()
    middle = state.positions[i] + turns[i][:, :2] @ board.mean(axis=0)
    sight = middle / np.linalg.norm(middle)
    turns[i] = (2.0 * np.outer(sight, sight) - np.eye(3)) @ turns[i] @ np.diag([-1.0, -1.0, 1.0])
    return LensAndPoses(state.lens, turns, state.positions)


def test_a_board_that_is_taken_for_its_mirror_image_is_turned_back():
    """The search alone leaves some as they are."""
    lens, half = lens_of("f sin(theta)", 60.0)
    seen = [
        BoardView(*view) for view in views(lens, np.random.default_rng(8), 10, reach=0.7 * half, share=0.15, noise=0.0)
    ]
    corners = concatenated(seen)
    ones = np.ones(len(corners.pixels))
    state = initial_estimate(corners, lens.size)
    state = adjusted(
        corners, LensAndPoses(np.array([*lens.centre, lens.aspect, *lens.c]), state.rotations, state.positions), ones
    )
    assert np.abs(residuals(corners, state)).max() < 0.01
    stayed = 0
    for i, view in enumerate(seen):
        wrong = mirrored(state, view.board, i)
        stayed += bool(np.abs(residuals(corners, adjusted(corners, wrong, ones))).max() > 0.1)
        assert np.abs(residuals(corners, with_flips_resolved(corners, wrong))).max() < 0.01
    assert stayed >= 3
