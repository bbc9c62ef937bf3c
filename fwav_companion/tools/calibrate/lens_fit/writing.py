"""A fitted lens as a camera file, in the form that :mod:`fwav_companion.camera.native` reads."""

from __future__ import annotations

from collections.abc import Iterable
from math import degrees, floor

from fwav_companion.tools.calibrate.lens_fit.fit import Fitted, image_angle
from fwav_companion.tools.calibrate.lens_fit.projection import RADIAL, STRETCH, U0, V0

GAUGE = "k1 is 1: only the products of k_mm and pixels_per_mm mean anything, here pixels a radian"


def limit_deg(fitted: Fitted) -> float:
    """The file's max_angle_deg: where the fit ends to be believed, or the image does."""
    corner = image_angle(fitted)
    end = fitted.claim.supported if corner is None else min(fitted.claim.supported, corner)
    return floor(100.0 * degrees(end)) / 100.0


def camera_file(fitted: Fitted, comments: Iterable[str]) -> str:
    """Its text; ``comments`` stand above the numbers. Ten digits: of a thousand pixels a millionth."""
    focal = fitted.lens[RADIAL]
    k = [c / focal for c in fitted.lens[RADIAL:]] + [0.0] * (5 - fitted.coefficients)
    lines = [
        *(f"# {comment}".rstrip() for comment in comments),
        "model: kannala_brandt",
        f"image_size: [{fitted.image_size[0]}, {fitted.image_size[1]}]",
        f"k_mm: {_listed(k)}  # {GAUGE}",
        f"pixels_per_mm: {_listed([focal, focal * fitted.lens[STRETCH]])}",
        f"principal_point: {_listed([fitted.lens[U0], fitted.lens[V0]])}",
        f"max_angle_deg: {limit_deg(fitted):.2f}  # from the optical axis: rays beyond are refused",
    ]
    return "\n".join(lines) + "\n"


def _listed(numbers: Iterable[float]) -> str:
    return f"[{', '.join(_number(number) for number in numbers)}]"


def _number(number: float) -> str:
    """With a point, as YAML 1.1 wants it of a number with an exponent."""
    text = f"{number:.10g}"
    mantissa, e, exponent = text.partition("e")
    return f"{mantissa}{'' if '.' in mantissa else '.0'}{e}{exponent}"
