"""Calibration files of lenses by sphere models: Kalibr's omni, ds and eucm, camodocal's MEI, Basalt, OCamCalib."""

from __future__ import annotations

from math import atan2, cos, sin
from typing import Any, Final

from fwav_companion.camera.brown_conrady import BrownConrady
from fwav_companion.camera.fields import Fields
from fwav_companion.camera.lens_numbers import require_lens_numbers
from fwav_companion.camera.plausible_lens import require_monotonic
from fwav_companion.camera.sphere_lens import SphereLens
from fwav_companion.camera.sphere_models import DoubleSphere, ExtendedUnified, RayPolynomial, SphereModel, Unified
from fwav_companion.camera.tool_files import CameraMatrix, distorted_lens, require_inside
from fwav_companion.types import Lens

SPHERE_COUNTS: Final = {"omni": 5, "ds": 6, "eucm": 6}
"""Numbers of Kalibr's intrinsics by camera_model: the model's own, then fu, fv, pu, pv."""


def kalibr_sphere_lens(fields: Fields) -> SphereLens:
    """The lens of a Kalibr camera of camera_model omni, ds or eucm."""
    name = fields.text("camera_model")
    *own, fu, fv, pu, pv = fields.numbers("intrinsics", SPHERE_COUNTS[name])
    distortion = fields.text("distortion_model").lower() if "distortion_model" in fields else "none"
    if distortion not in ("none", "radtan") or (distortion != "none" and name != "omni"):
        raise fields.refusal("distortion_model", "radtan or none of omni, none of ds and eucm")
    d = fields.numbers("distortion_coeffs", 4) if distortion == "radtan" else (0.0,) * 4
    size = fields.size("resolution")
    return _lens(fields, "intrinsics", name=name, own=own, camera=(fu, fv, pu, pv), d=d, size=size)


def camodocal_mei_lens(fields: Fields, size: tuple[int, int]) -> SphereLens:
    """The lens of a camodocal file of model_type MEI."""
    terms, numbers = fields.below("distortion_parameters"), fields.below("projection_parameters")
    xi = fields.below("mirror_parameters").number("xi")
    d = tuple(terms.number(key) for key in ("k1", "k2", "p1", "p2"))
    camera = (numbers.number("gamma1"), numbers.number("gamma2"), numbers.number("u0"), numbers.number("v0"))
    return _lens(numbers, "gamma1", name="omni", own=[xi], camera=camera, d=d, size=size)


def basalt_lens(fields: Fields, wanted: str) -> Lens:
    """The lens of one camera of a Basalt calibration. ``wanted``: its place, as cam1; "" for the only one."""
    cameras, sizes = (_as_list(fields.plain(key)) for key in ("intrinsics", "resolution"))
    if sizes and not isinstance(sizes[0], list):
        sizes = [sizes]
    number = int(wanted.removeprefix("cam")) if wanted else 0
    if not cameras or len(sizes) != len(cameras) or number >= len(cameras) or (len(cameras) > 1 and not wanted):
        names = ", ".join(f"cam{i}" for i in range(len(cameras)))
        file = fields.name.rpartition("/")[2]
        raise fields.refusal("intrinsics", f'one camera: name it, as [camera] calibration = "{file}#cam0", of {names}')
    camera = Fields({"resolution": sizes[number], "camera": cameras[number]}, fields.name)
    size, camera = camera.size("resolution"), camera.below("camera")
    name, numbers = camera.text("camera_type"), camera.below("intrinsics")
    values = (numbers.number("fx"), numbers.number("fy"), numbers.number("cx"), numbers.number("cy"))
    if name in ("kb4", "pinhole"):
        keys = ("k1", "k2", "k3", "k4") if name == "kb4" else ()
        d = tuple(numbers.number(key) for key in keys)
        matrix = CameraMatrix(values[:2], values[2:], size)
        require_inside(numbers, "cx", values[2:], size)
        model = "fisheye" if name == "kb4" else "none"
        return distorted_lens(numbers, model, keys=("camera_type", "fx"), d=d, matrix=matrix)
    own = {"ds": ("xi", "alpha"), "eucm": ("alpha", "beta"), "ucm": ("alpha",)}.get(name)
    if own is None:
        raise camera.refusal("camera_type", "ds, eucm, ucm, kb4 or pinhole")
    parts = [numbers.number(key) for key in own] + ([1.0] if name == "ucm" else [])
    model = "eucm" if name == "ucm" else name
    return _lens(numbers, "fx", name=model, own=parts, camera=values, d=(0.0,) * 4, size=size)


def ocamcalib_lens(fields: Fields) -> SphereLens:
    """The lens of OCamCalib's tables. Its x runs down the rows, its z backward: a ray is (y, x, -p(radius)).

    ``row = xc + c x + d y``, ``column = yc + e x + y``. That map is a turn about the axis, then one without d.
    """
    a0, *others = fields.numbers("polynomial", *range(4, 12))[1:]
    if a0 >= 0.0:
        raise fields.refusal("polynomial", "a number of coefficients, then a negative first one: the scale, pixels")
    scale = -a0
    require_lens_numbers((scale,), others)
    model = RayPolynomial(tuple(-a * scale**n for n, a in enumerate(others)))
    row, column = fields.numbers("center", 2)
    c, d, e = fields.numbers("affine", 3)
    height, width = fields.numbers("size", 2)
    size = (int(width), int(height))
    if c <= 0.0 or min(size) <= 0:
        raise fields.refusal("affine" if c <= 0.0 else "size", "positive numbers")
    require_inside(fields, "center", (column, row), size)
    roll = atan2(-d, c)
    across = cos(roll) + e * sin(roll)
    skew = (e * cos(roll) - sin(roll)) / across
    focal = (scale * across, scale * (c * cos(roll) - d * sin(roll)))
    plane = BrownConrady(focal, (column, row), (0.0,) * 4, size, skew=skew)
    lens = SphereLens(model, plane, roll=roll)
    require_monotonic(fields, "polynomial", lens)
    return lens


def _lens(
    fields: Fields,
    key: str,
    *,
    name: str,
    own: list[float],
    camera: tuple[float, float, float, float],
    d: tuple[float, ...],
    size: tuple[int, int],
) -> SphereLens:
    """The lens of a model's own numbers and its plane. ``key``: that of the focal lengths, for refusals."""
    fu, fv, pu, pv = camera
    if min(fu, fv) <= 0.0:
        raise fields.refusal(key, "positive focal lengths")
    require_inside(fields, key, (pu, pv), size)
    require_lens_numbers((), own)
    model: SphereModel
    if name == "omni":
        (xi,) = own
        model, sound, accepted = Unified(xi), xi >= 0.0, "xi of at least 0"
    elif name == "ds":
        xi, alpha = own
        model, sound = DoubleSphere(xi, alpha), -1.0 < xi < 1.0 and 0.0 <= alpha <= 1.0
        accepted = "xi in (-1, 1) and alpha in [0, 1]"
    else:
        alpha, beta = own
        model, sound = ExtendedUnified(alpha, beta), 0.0 <= alpha <= 1.0 and beta > 0.0
        accepted = "alpha in [0, 1] and a positive beta"
    if not sound:
        raise fields.refusal(key, accepted)
    lens = SphereLens(model, BrownConrady((fu, fv), (pu, pv), d, size))
    require_monotonic(fields, key, lens)
    return lens


def _as_list(found: Any) -> list[Any]:
    return found if isinstance(found, list) else [found]
