"""A calibration's verdict: its weaknesses, the pictures to take, and no remarks on a good one."""

from dataclasses import dataclass

import numpy as np
import pytest
from drawn_boards import PAPER, WIDE, TrueLens, chess_points, turn, views

from fwav_companion.tools.calibrate.calibration_verdict import (
    Grade,
    calibration_verdict,
    covered_parts,
    least_mount_bias_deg,
    least_pixel_noise_px,
)
from fwav_companion.tools.calibrate.lens_fit.lens_fit import FittedLens, fit_lens
from fwav_companion.tools.calibrate.lens_fit.reprojection import BoardView, project


@dataclass(frozen=True)
class Decentred(TrueLens):
    """Brown's tangential terms on top, about the principal point."""

    p: float = 0.0

    def pixels(self, points):
        pixels = super().pixels(points)
        x, y = np.moveaxis((pixels - np.array(self.centre)) / self.c[0], -1, 0)
        moved = [2 * self.p * x * y, self.p * (x * x + 3 * y * y)]
        return pixels + self.c[0] * np.stack(moved, axis=-1)


def fitted(lens=WIDE, count=30, seed=1, *, reach=1.5, share=0.8, noise=0.1, spoil=lambda view, rng: view):
    rng = np.random.default_rng(seed)
    seen = [BoardView(*view) for view in views(lens, rng, count, reach=reach, share=share, noise=noise)]
    result = fit_lens([spoil(view, rng) for view in seen], lens.size)
    assert isinstance(result, FittedLens), result
    return result


def judged(result):
    """The grade, all findings, and the lines of the verdict."""
    verdict = calibration_verdict(result)
    findings = " | ".join(weakness.finding for weakness in verdict.weaknesses)
    return verdict.grade, findings, list(verdict.lines(result))


def test_good_pictures():
    result = fitted()
    grade, findings, lines = judged(result)
    assert (grade, findings) == (Grade.GOOD, "")
    assert len(lines) == 1
    assert lines[0].startswith("verdict: good: rays are accurate to 0.2")
    occupied, visible = covered_parts(result)
    assert occupied > 0.9 * visible
    assert least_pixel_noise_px(result) == pytest.approx(0.1, abs=0.11)
    assert 0.02 < least_mount_bias_deg(result) < 0.3


def test_a_good_lens_is_right_to_what_the_verdict_says():
    """The true rays in eight directions, up to 85 % of the usable angle: 3.3 sigmas of a good one, 0.1 deg."""
    result = fitted()
    verdict = calibration_verdict(result)
    theta, phi = np.meshgrid(np.radians(verdict.usable_deg) * np.linspace(0.1, 0.85, 8), np.arange(8) * np.pi / 4)
    rays = np.stack([np.sin(theta) * np.cos(phi), np.sin(theta) * np.sin(phi), np.cos(theta)], axis=-1)
    miss = project(result.lens, rays.reshape(-1, 3))[0] - WIDE.pixels(rays).reshape(-1, 2)
    assert np.degrees(np.abs(miss).max() / WIDE.c[0]) < 0.33


def test_corners_in_the_middle_only():
    result = fitted(PAPER, reach=0.1, share=0.25)
    grade, findings, lines = judged(result)
    assert grade is not Grade.GOOD
    assert "of the image's 34° from the axis; rays beyond" in findings or "of 34° from the optical axis" in findings
    assert "parts of the image" in findings
    regions = next(line for line in lines if "regions of the image" in line)
    for region in ("upper left", "lower right"):
        assert region in regions
    assert "middle" not in regions


def test_corners_in_the_left_half_only():
    """The regions without corners are named: those on the right."""

    def left(view, _rng):
        seen = view.pixels[:, 0] < 0.45 * WIDE.size[0]
        return BoardView(view.name, view.board[seen], view.pixels[seen])

    _, _, lines = judged(fitted(spoil=left, count=40))
    regions = next(line for line in lines if "regions of the image" in line)
    assert "upper right" in regions
    assert "lower right" in regions
    assert "left" not in regions.replace("upper left", "").replace("lower left", "")


def test_few_pictures():
    grade, findings, lines = judged(fitted(count=7, reach=1.2))
    assert grade is not Grade.GOOD
    assert "7 pictures: an error in one of them" in findings
    assert any("take 8 more pictures" in line for line in lines)


def test_boards_that_are_hardly_tilted():
    """Boards all nearly parallel, in a lens of 34 degrees."""
    rng = np.random.default_rng(3)
    points, seen = chess_points(7, 5, 0.03), []
    for i in range(24):
        rotation = turn([np.cos(2.4 * i), np.sin(2.4 * i), 0.0], 0.16)
        middle = np.array([0.2 * np.cos(1.1 * i), 0.15 * np.sin(1.7 * i), 0.55])
        pixels = PAPER.pixels(points @ rotation.T + middle)
        inside = ((pixels > -0.5) & (pixels < np.array(PAPER.size) - 0.5)).all(axis=1)
        noisy = pixels[inside] + rng.normal(0.0, 0.05, (inside.sum(), 2))
        seen.append(BoardView(f"{i}.png", points[inside, :2], noisy))
    result = fit_lens(seen, PAPER.size)
    assert isinstance(result, FittedLens), result
    _, findings, lines = judged(result)
    assert "no two boards are tilted against each other by more than 18°" in findings
    assert any("tilt the board by 30° to 45°" in line for line in lines)


def test_corners_that_miss_by_much():
    """Where rays are a degree uncertain, near the fold of this lens, the file ends."""
    result = fitted(noise=1.2)
    grade, findings, lines = judged(result)
    assert grade is Grade.POOR
    assert "the reprojection error is 1.2 px an axis" in findings
    assert lines[0].startswith("verdict: poor: ")
    assert lines[0].endswith("Take these pictures and calibrate again:")
    assert result.accuracy.supported < result.accuracy.reached
    _, rest = result.ray_sigmas(np.array([0.95, 1.1]) * result.accuracy.supported)
    assert np.degrees(rest[0]) < 1.0 < np.degrees(rest[1])
    assert calibration_verdict(result).usable_deg < result.valid_deg


def test_sheets_that_bend_from_picture_to_picture():
    def bent(view, rng):
        x, y = ((view.pixels - view.pixels.mean(axis=0)) / view.pixels.std()).T
        return BoardView(view.name, view.board, view.pixels + 0.3 * np.outer(x * y, rng.normal(size=2)))

    result = fitted(spoil=bent)
    grade, findings, lines = judged(result)
    assert result.accuracy.inflation > 2.0
    assert grade is Grade.USABLE
    assert "pictures disagree by" in findings
    assert lines[0].startswith("verdict: usable up to ")


def test_a_print_that_was_scaled_one_way():
    """By two percent, upright in every picture: pixels seem not to be square."""
    grade, findings, _ = judged(fitted(TrueLens(WIDE.c, WIDE.centre, WIDE.size, 1.02, WIDE.sees)))
    assert "2.0 % off square" in findings
    assert grade is Grade.POOR


@pytest.mark.parametrize(("p", "expected"), [(2e-4, Grade.GOOD), (7e-4, Grade.USABLE), (4e-3, Grade.POOR)])
def test_a_lens_that_is_not_centred(p, expected):
    lens = Decentred(WIDE.c, WIDE.centre, WIDE.size, WIDE.aspect, WIDE.sees, p=p)
    result = fitted(lens)
    edge_px = 3.0 * p * lens.radius(result.accuracy.reached) ** 2 / lens.c[0]
    assert result.decentring.edge_px == pytest.approx(edge_px, abs=max(4.0 * result.decentring.sigma_px, 0.3 * edge_px))
    grade, findings, _ = judged(result)
    assert ("the lens elements are decentred" in findings) == (
        result.decentring.edge_px > 4 * result.decentring.sigma_px
    )
    assert grade is expected
