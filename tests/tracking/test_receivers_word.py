"""[uncertainty] position_bias_m = "auto": a fix and a track claim what the receiver itself says."""

from math import inf
from types import SimpleNamespace

import numpy as np
import pytest
from flying import fly

from fwav_companion.recording.line_types import TargetLine
from fwav_companion.telemetry.position_bias import PositionBias
from sitl_mock import scenario

ALL_WELL = {"flags": 0b1111111, "pos_horiz_variance": 0.1}


@pytest.mark.parametrize(
    ("fix_type", "h_acc_m", "sigma_m"),
    [
        (6, 0.014, 0.02),
        (6, 0.0, 0.02),
        (6, 0.3, 0.3),
        (5, 0.11, 0.3),
        (5, 0.7, 1.0),
        (4, 0.2, 1.0),
        (3, 0.5, 1.0),
        (3, 3.2, 5.0),
        (1, 0.0, 1.0),
        (3, 4_294_967.295, 1.0),
        (3, 4000.0, 50.0),
    ],
)
def test_the_sigma_by_fix_type_and_accuracy(fix_type, h_acc_m, sigma_m):
    bias = PositionBias()
    assert bias.sigma_m is None
    bias.on_gps(SimpleNamespace(fix_type=fix_type, h_acc=round(h_acc_m * 1000)))
    assert bias.sigma_m == sigma_m


@pytest.mark.parametrize(
    ("change", "sigma_m"),
    [
        ({}, 0.02),
        ({"pos_horiz_variance": 1.2}, 1.0),
        ({"pos_horiz_variance": float("nan")}, 1.0),
        ({"flags": 0b0001111}, 1.0),
        ({"flags": 0b1111111 | 32768}, 1.0),
        ({"flags": 0b11111111}, 1.0),
    ],
)
def test_an_ardupilot_that_does_not_use_its_receiver(change, sigma_m):
    bias = PositionBias()
    bias.on_gps(SimpleNamespace(fix_type=6, h_acc=14))
    bias.on_ardupilot_filter(SimpleNamespace(**ALL_WELL | change))
    assert bias.sigma_m == sigma_m


@pytest.mark.parametrize(
    ("accuracy_m", "ratio", "flags", "sigma_m"),
    [(0.4, 0.1, 0b111111, 0.02), (3.0, 0.1, 0b111111, 5.0), (0.4, 1.5, 0b111111, 1.0), (inf, 0.1, 1024 | 16, 1.0)],
)
def test_a_px4_that_does_not_use_its_receiver(accuracy_m, ratio, flags, sigma_m):
    bias = PositionBias()
    bias.on_gps(SimpleNamespace(fix_type=6, h_acc=14))
    bias.on_px4_filter(SimpleNamespace(flags=flags, pos_horiz_ratio=ratio, pos_horiz_accuracy=accuracy_m))
    assert bias.sigma_m == sigma_m


def flown(fix_type, settings=()):
    truth = {"autopilot.fix_type": fix_type, "autopilot.h_acc_m": 0.0, "biases.position_m": 0.02, "seconds": 10.0}
    lines = fly(scenario("unbiased").but({**truth, "seed": 3}), settings=settings).companion.lines
    return [line for line in lines if isinstance(line, TargetLine) and line.fix is not None]


def larger(cov):
    return np.sqrt(np.linalg.eigvalsh(np.array(cov)[:2, :2])[-1])


def test_a_flight_claims_what_its_receiver_says():
    usual, fixed = flown(3), flown(6)
    for key, find in {"fix": lambda line: line.fix.cov, "track": lambda line: line.cov}.items():
        before, after = np.array(find(usual[-1])), np.array(find(fixed[-1]))
        gain = np.trace((before - after)[:2, :2])
        assert gain == pytest.approx(2 * (1.0**2 - 0.02**2), rel=0.3 if key == "track" else 1e-6), key


def test_a_configured_sigma_counts_whatever_the_receiver_says():
    lines = flown(6, ["uncertainty.position_bias_m=1.0"])
    assert lines[-1].fix.cov == flown(3, ["uncertainty.position_bias_m=1.0"])[-1].fix.cov
    assert larger(lines[-1].fix.cov) > 1.0
