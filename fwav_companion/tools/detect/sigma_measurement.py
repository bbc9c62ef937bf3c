"""Measures the accuracy of a detector's boxes: against labelled pictures, or by standing things in a video.

Each residual of a centre is divided by the sigma of the prior, so that one factor for it is measured, over things of
all sizes. Without truth, second differences of the centres of standing things give the jitter: they cancel place and
drift, and their variance is six times that of one centre. They show no bias. Jitter of neighbouring frames is
correlated; so differences over one second are taken too (as an Allan variance does), and the larger result counts.
"""

from __future__ import annotations

from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass, field
from math import isfinite, sqrt
from pathlib import Path
from typing import Any, Final, TypeAlias

import msgspec
import numpy as np

from fwav_companion.errors import InputFileError
from fwav_companion.on_disk import content
from fwav_companion.vision.detectors.model.box_sigma import CUT_PX, PRIOR
from fwav_companion.vision.images import Found

Box: TypeAlias = tuple[float, float, float, float]
"""Left, top, right, bottom, pixels; 0 is the centre of the first pixel."""
LEAST_IOU: Final = 0.3
"""Least overlap of a detection with the truth, or with itself in the frame before, for one thing: a shift by half of
the side along one axis."""
FEWEST: Final = 30
"""Least number of residuals: the relative error of a sigma is 1 / sqrt(2 N), here 13 %."""
SLOW_S: Final = 1.0
"""Longest time over which second differences are taken, seconds."""


class MeasuredSigma(msgspec.Struct, frozen=True):
    """The accuracy of a detector's boxes."""

    residuals: int
    """Number of residuals, both axes."""
    factor: float
    """One sigma over the prior's."""
    bias: tuple[float, float] | None
    """Mean displacement of the centres, shares of width and height; None without truth."""
    slow_factor: float | None = None
    """The factor by differences over SLOW_S; None where the video is shorter, or with truth."""
    lower_edge: tuple[float, float] | None = None
    """Of the lower edge, which shows the foot: one sigma over that of the centre, and mean displacement downward as a
    share of the height; None without truth."""

    @property
    def model_sigma(self) -> tuple[float, float]:
        """The value of [vision] model_sigma."""
        factor = max(self.factor, self.slow_factor or 0.0)
        return round(factor * PRIOR[0], 3), round(factor * PRIOR[1], 4)

    def lines(self) -> str:
        """The lines for the configuration."""
        lines = f"model_sigma = [{self.model_sigma[0]:g}, {self.model_sigma[1]:g}]"
        return lines if self.bias is None else f"{lines}\nmodel_bias = [{self.bias[0]:.4f}, {self.bias[1]:.4f}]"


class TruthFile:
    """True boxes by picture, of a COCO JSON file or a folder of YOLO text files."""

    def __init__(self, path: Path) -> None:
        """InputFileError where the path is neither."""
        self._folder = path if path.is_dir() else None
        self._boxes: Mapping[str, list[Box]] = {} if self._folder is not None else _coco(path)

    def boxes(self, file: str, size: tuple[int, int]) -> list[Box] | None:
        """The true boxes of a picture of this size; None where it is not labelled."""
        if self._folder is None:
            return self._boxes.get(Path(file).name)
        text = self._folder / f"{Path(file).stem}.txt"
        return _yolo(text, size) if text.is_file() else None


class TruthResiduals:
    """Residuals of centres against true boxes."""

    def __init__(self) -> None:
        self._displacements: list[tuple[float, float]] = []
        self._by_prior: list[tuple[float, float]] = []
        self._lower: list[tuple[float, float]] = []

    def add(self, found: Sequence[Found], truth: Sequence[Box], size: tuple[int, int]) -> None:
        """Match the detections of one picture with its true boxes, the best overlap first, and keep the residuals."""
        pairs = sorted(
            ((iou(each["box"], box), i, j) for i, each in enumerate(found) for j, box in enumerate(truth)), reverse=True
        )
        used: set[tuple[str, int]] = set()
        for overlap, i, j in pairs:
            if overlap < LEAST_IOU or ("found", i) in used or ("truth", j) in used:
                continue
            used |= {("found", i), ("truth", j)}
            if _is_whole(found[i]["box"], size):
                self._keep(found[i], truth[j])

    def _keep(self, found: Found, truth: Box) -> None:
        left, top, right, bottom = found["box"]
        du, dv = found["u"] - 0.5 * (truth[0] + truth[2]), found["v"] - 0.5 * (truth[1] + truth[3])
        sides, sigma = (right - left, bottom - top), found["sigma"]
        self._displacements.append((du / sides[0], dv / sides[1]))
        self._by_prior.append((sides[0] / sigma[0], sides[1] / sigma[1]))
        self._lower.append(((bottom - truth[3]) / (truth[3] - truth[1]), (bottom - truth[3]) / sigma[1]))

    def result(self) -> MeasuredSigma:
        """The factor of the prior about the mean displacement. InputFileError with too few residuals."""
        _require(2 * len(self._displacements), "matched a true box; accepted: labels of these very pictures")
        shares = np.array(self._displacements)
        bias = shares.mean(axis=0)
        normal = (shares - bias) * np.array(self._by_prior)
        factor = sqrt(float((normal**2).sum()) / max(1, normal.size - 2))
        lower = np.array(self._lower)
        edge_factor = float(lower[:, 1].std(ddof=1))
        return MeasuredSigma(
            normal.size,
            factor,
            (float(bias[0]), float(bias[1])),
            lower_edge=(edge_factor / factor if factor > 0.0 else 1.0, float(lower[:, 0].mean())),
        )


@dataclass
class _Thing:
    """One standing thing: its detections by frame."""

    box: Box
    label: str
    centres: dict[int, tuple[float, float]] = field(default_factory=dict)
    sigmas: dict[int, tuple[float, float]] = field(default_factory=dict)


class StandingResiduals:
    """Second differences of the centres of standing things, seen by a standing camera."""

    def __init__(self) -> None:
        self._things: list[_Thing] = []
        self._times: list[float] = []

    def add(self, found: Iterable[Found], time_s: float, size: tuple[int, int]) -> None:
        """Continue the things with the detections of the next frame."""
        frame = len(self._times)
        self._times.append(time_s)
        for each in found:
            if not _is_whole(each["box"], size):
                continue
            same = [thing for thing in self._things if thing.label == each["label"] and frame not in thing.centres]
            thing = max(same, key=lambda thing: iou(thing.box, each["box"]), default=None)
            if thing is None or iou(thing.box, each["box"]) < LEAST_IOU:
                thing = _Thing(tuple(each["box"]), each["label"])
                self._things.append(thing)
            thing.box = tuple(each["box"])
            thing.centres[frame], thing.sigmas[frame] = (each["u"], each["v"]), tuple(each["sigma"])

    def result(self) -> MeasuredSigma:
        """The factor of the prior. InputFileError with too few differences."""
        fast = self._differences(1)
        _require(len(fast), "are second differences of standing things; accepted: a longer video of them")
        interval_s = float(np.median(np.diff(self._times)))
        lag = round(SLOW_S / interval_s) if interval_s > 0.0 else 0
        slow = self._differences(lag) if lag > 1 else []
        return MeasuredSigma(len(fast), _factor(fast), None, _factor(slow) if len(slow) >= FEWEST else None)

    def _differences(self, lag: int) -> list[float]:
        """x[k + lag] - 2 x[k] + x[k - lag] of both axes, over the prior's sigma."""
        found = []
        for thing in self._things:
            for k, (u, v) in thing.centres.items():
                before, after = thing.centres.get(k - lag), thing.centres.get(k + lag)
                if before is not None and after is not None:
                    su, sv = thing.sigmas[k]
                    found += [(after[0] - 2.0 * u + before[0]) / su, (after[1] - 2.0 * v + before[1]) / sv]
        return found


def iou(one: Sequence[float], other: Sequence[float]) -> float:
    """Intersection over union of two boxes."""
    across = min(one[2], other[2]) - max(one[0], other[0])
    along = min(one[3], other[3]) - max(one[1], other[1])
    if across <= 0.0 or along <= 0.0:
        return 0.0
    areas = sum((box[2] - box[0]) * (box[3] - box[1]) for box in (one, other))
    return across * along / (areas - across * along)


def _factor(differences: Sequence[float]) -> float:
    """One sigma of second differences over sqrt 6: the variance of x - 2 y + z is six times that of each."""
    return sqrt(float(np.mean(np.square(differences))) / 6.0)


def _require(count: int, what: str) -> None:
    if count < FEWEST:
        raise InputFileError(f"detect --sigma: {count} residuals {what}, {FEWEST} at least")


def _is_whole(box: Sequence[float], size: tuple[int, int]) -> bool:
    """Whether the picture's border does not cut a box off."""
    inside = min(box[0], box[1]) > CUT_PX - 0.5
    return inside and box[2] < size[0] - 0.5 - CUT_PX and box[3] < size[1] - 0.5 - CUT_PX


def _coco(path: Path) -> Mapping[str, list[Box]]:
    """Boxes by file name: images {id, file_name}, annotations {image_id, bbox [left, top, width, height]} in edges."""
    try:
        document: Any = msgspec.json.decode(content(path))
        boxes: dict[Any, list[Box]] = {image["id"]: [] for image in document["images"]}
        for each in document["annotations"]:
            left, top, width, height = map(float, each["bbox"])
            if not all(map(isfinite, (left, top, width, height))):
                raise ValueError
            boxes[each["image_id"]].append((left - 0.5, top - 0.5, left + width - 0.5, top + height - 0.5))
        return {Path(image["file_name"]).name: boxes[image["id"]] for image in document["images"]}
    except (msgspec.DecodeError, KeyError, TypeError, ValueError, AttributeError, RecursionError):
        raise InputFileError(
            f"{path}: not labels; accepted: COCO JSON with images and annotations, or a folder of YOLO text files"
        ) from None


def _yolo(path: Path, size: tuple[int, int]) -> list[Box]:
    """Lines of class, cx, cy, width, height in shares of the picture."""
    boxes = []
    for number, line in enumerate(content(path).decode("utf-8", "replace").splitlines(), start=1):
        words = line.split()
        if not words:
            continue
        try:
            _, cx, cy, width, height = map(float, words)
        except ValueError:
            raise InputFileError(f"{path}: line {number}: accepted: class cx cy width height in shares") from None
        half_width, half_height = 0.5 * width * size[0], 0.5 * height * size[1]
        u, v = cx * size[0] - 0.5, cy * size[1] - 0.5
        boxes.append((u - half_width, v - half_height, u + half_width, v + half_height))
    return boxes
