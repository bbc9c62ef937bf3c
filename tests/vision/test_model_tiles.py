"""Tiles: a thing anywhere in a large picture is one detection, in its place, with honest edges."""

import numpy as np
import pytest

from fwav_companion.vision.detectors import make_detector
from fwav_companion.vision.detectors.model.box_sigma import centre_sigmas, with_unknown_edges
from fwav_companion.vision.detectors.model.boxes import Boxes
from fwav_companion.vision.detectors.model.tiles import PassBoxes, cut_edges, merged, tiles_of
from fwav_companion.vision.task import VisionTask

WIDTH, HEIGHT = 1000, 700
INPUT = 320


def seen_in(tile, thing):
    """What an ideal detector sees of a thing in a tile, in the tile's pixels; None where nothing of it is there."""
    left, top, right, bottom = thing
    edges = np.array(
        [
            max(left, tile.left - 0.5),
            max(top, tile.top - 0.5),
            min(right, tile.right - 0.5),
            min(bottom, tile.bottom - 0.5),
        ]
    )
    if edges[2] - edges[0] < 3.0 or edges[3] - edges[1] < 3.0:
        return None
    return edges - np.tile([tile.left, tile.top], 2)


def passes_over(things, columns, rows, *, whole=True):
    """Detections of all tiles, and of the pass over the whole picture unless the things are too small for it."""
    edges, scores, scale, cut = [], [], [], []
    tiles = tiles_of(WIDTH, HEIGHT, columns, rows)
    for tile in tiles if whole else tiles[:-1]:
        px_per_input = max(tile.right - tile.left, tile.bottom - tile.top) / INPUT
        for thing in things:
            seen = seen_in(tile, thing)
            if seen is not None:
                edges.append(seen + np.tile([tile.left, tile.top], 2))
                scores.append(0.6 + 0.01 * len(scores) % 0.3)
                scale.append(px_per_input)
                cut.append(cut_edges(seen[None], tile, (WIDTH, HEIGHT), px_per_input)[0])
    boxes = Boxes(np.array(edges), np.array(scores), np.zeros(len(edges), np.int64))
    return PassBoxes(boxes, np.array(scale), np.array(cut))


def test_tiles_cover_the_picture_and_overlap_by_a_fifth():
    *tiles, whole = tiles_of(WIDTH, HEIGHT, 3, 2)
    assert len(tiles) == 6
    assert (whole.left, whole.top, whole.right, whole.bottom) == (0, 0, WIDTH, HEIGHT)
    covered = np.zeros((HEIGHT, WIDTH), int)
    for tile in tiles:
        covered[tile.top : tile.bottom, tile.left : tile.right] += 1
    assert covered.min() == 1
    first, second = tiles[0], tiles[1]
    assert (first.right - second.left) / (first.right - first.left) == pytest.approx(0.2, abs=0.01)
    assert tiles_of(WIDTH, HEIGHT, 1, 1) == [whole]


def borders(columns, rows):
    """Every place at which a border of a tile passes: all crossings, and the middle of each border."""
    tiles = tiles_of(WIDTH, HEIGHT, columns, rows)[:-1]
    us = sorted({edge for tile in tiles for edge in (tile.left, tile.right)} | {WIDTH // 2})
    vs = sorted({edge for tile in tiles for edge in (tile.top, tile.bottom)} | {HEIGHT // 2})
    return [(min(max(u, 60), WIDTH - 60), min(max(v, 60), HEIGHT - 60)) for u in us for v in vs]


@pytest.mark.parametrize("side", [12.0, 50.0])
@pytest.mark.parametrize("grid", [(2, 1), (3, 2), (4, 4)])
def test_a_thing_on_every_border_is_one_detection_with_its_true_box(grid, side):
    for u, v in borders(*grid):
        for shift in (-0.45 * side, 0.0, 0.3 * side):
            thing = (u + shift - side / 2, v - side / 2, u + shift + side / 2, v + side / 2)
            found = merged(passes_over([thing], *grid, whole=side > 20.0), iou=0.45)
            assert len(found.boxes.scores) == 1, (u, v, shift)
            assert found.boxes.edges[0] == pytest.approx(thing, abs=1e-9)
            assert not found.cut.any()


def test_a_thing_longer_than_the_overlap_is_joined_from_its_parts():
    """A train across three tiles that the pass over the whole picture misses."""
    train = (60.0, 300.0, 940.0, 330.0)
    found = merged(passes_over([train], 3, 1, whole=False), iou=0.45)
    assert len(found.boxes.scores) == 1
    assert found.boxes.edges[0] == pytest.approx(train, abs=1e-9)
    assert not found.cut.any()


def test_a_part_whose_rest_no_pass_shows_has_an_unknown_edge():
    tile = tiles_of(WIDTH, HEIGHT, 2, 1)[0]
    part = np.array([[tile.right - 30.5, 100.0, tile.right - 0.5, 140.0]])
    flags = cut_edges(part, tile, (WIDTH, HEIGHT), 1.0)
    assert flags.tolist() == [[False, False, True, False]]
    (sigma,) = with_unknown_edges(centre_sigmas(part, np.array([0.9]), np.array([1.0]), (0.5, 0.03)), part, flags)
    assert sigma[0] > 40.0, "at least the longer side of what is seen"
    assert sigma[1] == pytest.approx(np.hypot(0.5, 0.03 * 40.0))


def test_two_neighbours_of_one_kind_stay_two():
    things = [(480.0, 300.0, 500.0, 340.0), (505.0, 300.0, 525.0, 340.0)]
    for grid in [(2, 1), (3, 2), (4, 4)]:
        found = merged(passes_over(things, *grid), iou=0.45)
        assert sorted(found.boxes.edges[:, 0].tolist()) == pytest.approx([480.0, 505.0])


def test_the_tile_shows_a_thing_more_exactly_than_the_whole_picture():
    tile = passes_over([(100.0, 100.0, 120.0, 120.0)], 3, 2)
    whole_places = tile.px_per_input == tile.px_per_input.max()
    boxes = tile.boxes
    boxes.edges[whole_places] += 3.0
    boxes.scores[whole_places] = 0.99
    found = merged(tile, iou=0.45)
    assert found.boxes.edges[0] == pytest.approx([100.0, 100.0, 120.0, 120.0])


def test_a_light_of_two_pixels_is_found_in_tiles_at_its_place(tmp_path):
    """The model sees 64 x 64: in the whole picture of 640 x 640 the light falls between the samples."""
    from model_graphs import brightest_pixel_model

    path = brightest_pixel_model(tmp_path / "m.onnx", channel=0)
    picture = np.zeros((640, 640, 3), np.uint8)
    picture[400:402, 300:302] = 255

    def found(tiles):
        task = VisionTask("x", detector="onnx", model=path, model_tiles=tiles, model_confidence=0.5)
        return make_detector(task).detect(picture)

    assert found((1, 1)) == []
    best = found((10, 10))[0]
    assert (best["u"], best["v"]) == pytest.approx((300.5, 400.5), abs=1.0)
