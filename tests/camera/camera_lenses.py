"""Lenses of many shapes, by name, and rays all over what they see."""

from math import cos, pi, radians, sin

from hypothesis import strategies as st

from fwav_companion.camera import BrownConrady, KannalaBrandt
from fwav_companion.camera.sphere_lens import SphereLens
from fwav_companion.camera.sphere_models import DoubleSphere, ExtendedUnified, RayPolynomial, Unified

PAPER = KannalaBrandt((3.55, 0.03, 0.0, 0.0, 0.0), (188.0, 188.0), (320.0, 240.0), (640, 480))
LENSES = {
    "paper": PAPER,
    "limited": KannalaBrandt((1.0, 0.02), (300.0, 301.0), (500.0, 510.0), (1000, 1000), max_angle=radians(75.0)),
    "beyond 90 degrees": KannalaBrandt((1.0, 0.02, -0.004, 0.0008), (300.0, 301.0), (512.3, 510.2), (1200, 1200)),
    "folds inside the image": KannalaBrandt((1.0, -0.1), (600.0, 600.0), (700.3, 690.2), (1400, 1400)),
    "skewed": KannalaBrandt((1.0, 0.03, 0.001), (400.0, 402.0), (330.0, 235.0), (640, 480), skew=-0.002),
    "whole sphere": KannalaBrandt((1.0,), (100.0, 100.0), (399.5, 399.5), (800, 800)),
    "pinhole": BrownConrady((500.0, 501.0), (320.0, 240.0), (0.0, 0.0, 0.0, 0.0), (640, 480)),
    "barrel": BrownConrady((461.6, 460.2), (362.7, 246.0), (-0.283, 0.0739, 0.00019, 1.76e-05), (752, 480)),
    "rational": BrownConrady(
        (610.0, 609.0), (640.0, 360.0), (8.1, 2.9, 1e-4, -2e-4, 0.1, 8.4, 5.1, 0.7), (1280, 720), skew=0.001
    ),
    "barrel that folds inside the image": BrownConrady(
        (300.0, 300.0), (320.0, 240.0), (-0.4, 0.0, 0.0, 0.0), (640, 480)
    ),
    "omni with radtan": SphereLens(
        Unified(0.80065662),
        BrownConrady((833.006, 830.345), (373.85, 253.749), (-0.335, 0.132, 0.00056, 0.00058), (752, 480)),
    ),
    "omni of a whole mirror": SphereLens(
        Unified(1.2), BrownConrady((420.0, 421.0), (512.0, 509.0), (0.0,) * 4, (1024, 1024))
    ),
    "double sphere": SphereLens(
        DoubleSphere(-0.172, 0.593), BrownConrady((158.28, 158.27), (254.96, 256.88), (0.0,) * 4, (512, 512))
    ),
    "extended unified": SphereLens(
        ExtendedUnified(0.631, 1.04), BrownConrady((380.0, 379.0), (320.0, 240.0), (0.0,) * 4, (640, 480))
    ),
    "OCamCalib": SphereLens(
        RayPolynomial((0.0, -0.456, 0.208, -0.1642)),
        BrownConrady((206.5, 206.6), (394.55, 241.8), (0.0,) * 4, (752, 480), skew=0.0003),
        roll=-0.0002,
    ),
}


def ray_at(angle: float, direction: float) -> tuple[float, float, float]:
    return (sin(angle) * cos(direction), sin(angle) * sin(direction), cos(angle))


fractions = st.one_of(st.floats(0.0, 1.0), st.sampled_from([0.0, 1e-12, 1e-6, 0.5, 1.0]))
directions = st.floats(-pi, pi)
