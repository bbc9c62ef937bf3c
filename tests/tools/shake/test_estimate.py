"""Planted delays, mounts and mistakes, found by shaking; values that are not observable are reported as such."""

from functools import cache

import msgspec
import numpy as np
import pytest
from draws import first_of
from hands import BELLY, FORWARD_DOWN, Hands, correction_deg

from fwav_companion.tools.shake.corner_fit import BLOCK, MEMORY_S, _correlated_products

PLAIN = Hands(seed=4)
SHORT = PLAIN.but(seconds=10.0)
QUARTER = np.array([[0, -1], [1, 0]])


def errors_and_sigmas(hands):
    """(errors, sigmas) of delay (ms) and mount (deg, each axis)."""
    shaken = hands.found()
    assert (shaken.sign_errors, shaken.not_shown) == ((), ())
    errors = [1e3 * (shaken.delay.value - hands.delay_s), *(correction_deg(shaken) - hands.mount_deg)]
    sigmas = [1e3 * shaken.delay.sigma, *np.degrees([known.sigma for known in shaken.mount])]
    return np.array(errors), np.array(sigmas)


@pytest.mark.parametrize(
    "hands",
    first_of(
        PLAIN.but(delay_s=0.21, mount_deg=(-2.0, 1.5, -6.0)),
        PLAIN.but(configured=FORWARD_DOWN),
        PLAIN.but(readout_s=0.02, assumed_readout=(1 / 60, 1 / 30 / 12**0.5)),
        PLAIN.but(spoiled=0.05),
        PLAIN.but(reorder=(0, 3, 2, 1)),
        PLAIN,
        PLAIN.but(delay_s=-0.012, seconds=24.0),
        PLAIN.but(slope_deg=(0.5, -0.4)),
        PLAIN.but(readout_s=0.02, assumed_readout=(0.02, 0.0)),
        PLAIN.but(reorder=(2, 3, 0, 1)),
        few=5,
    ),
    ids=["large", "forward", "rows unknown", "spoiled", "backward", "plain", "early", "slope", "rows", "half round"],
)
def test_delay_and_mount_are_found(hands):
    errors, sigmas = errors_and_sigmas(hands)
    assert abs(errors[0]) < 1.0
    assert (abs(errors[1:]) < (0.15, 0.15, 0.6)).all()
    assert (abs(errors) < 3.5 * sigmas).all()
    assert (sigmas < (0.4, 0.1, 0.1, 0.3)).all()


@pytest.mark.parametrize(
    ("sessions", "low", "high", "inside"),
    [
        pytest.param(4, 0.47, 1.61, 11 / 16, marks=pytest.mark.slow),
        pytest.param(12, 0.4, 1.4, 0.85, marks=pytest.mark.slow),
    ],
)
def test_sigmas_are_neither_too_small_nor_too_large(sessions, low, high, inside):
    """Four values a session. For 16 values: the 99.9 % limits of their root mean square, and of the number within
    1.96.
    """
    both = [errors_and_sigmas(Hands(seed=seed)) for seed in range(20, 20 + sessions)]
    normed = np.array([errors / sigmas for errors, sigmas in both])
    assert low < np.sqrt((normed**2).mean()) < high
    assert (abs(normed) < 1.96).mean() >= inside


MISTAKES = {
    "image upside down": {"image": -np.eye(2)},
    "mount turned by 90 deg": {"image": QUARTER},
    "image mirrored left to right": {"image": np.diag([-1, 1])},
    "image mirrored top to bottom": {"image": np.diag([1, -1])},
    "image mirrored and turned by 90 deg": {"image": np.array([[0, 1], [1, 0]])},
    "roll reversed": {"reported_signs": (-1, 1, 1)},
    "pitch reversed": {"reported_signs": (1, -1, 1)},
    "yaw reversed": {"reported_signs": (1, 1, -1)},
    "roll, pitch and yaw reversed": {"reported_signs": (-1, -1, -1)},
}


@pytest.mark.parametrize("name", MISTAKES)
@pytest.mark.parametrize(
    "configured", [BELLY, pytest.param(FORWARD_DOWN, marks=pytest.mark.slow)], ids=["belly", "forward"]
)
def test_a_gross_mistake_is_named(name, configured):
    shaken = SHORT.but(configured=configured, **MISTAKES[name]).found()
    assert [error.name for error in shaken.sign_errors] == [name]
    assert (shaken.mount is None) == (name not in ("image upside down", "mount turned by 90 deg"))


@pytest.mark.parametrize("order", [(0, 1, 3, 2), (1, 0, 2, 3), (0, 2, 1, 3)], ids=["as Z", "as S", "as N"])
@pytest.mark.parametrize("image", [np.eye(2), np.diag([-1, 1])], ids=["", "mirrored"])
def test_corners_that_are_sent_in_rows_are_named(order, image):
    """They are not reported as a tag that was never seen."""
    shaken = SHORT.but(reorder=order, image=image).found()
    assert [error.name for error in shaken.sign_errors] == ["corners sent in another order"]
    assert (shaken.delay, shaken.mount) == (None, None)
    assert not any("seen whole" in reason for reason in shaken.not_shown)


def test_a_reversed_pitch_is_not_called_a_mirror_where_nothing_turns_about_the_third_axis():
    """The two rotate alike in that case; the order of the corners distinguishes them."""
    flat = SHORT.but(swing_deg=(11.0, 11.0, 0.0), turn_deg=0.0)
    for name in ("pitch reversed", "image mirrored left to right"):
        assert [error.name for error in flat.but(**MISTAKES[name]).found().sign_errors] == [name]


def test_an_image_upside_down_comes_with_the_mount_that_rights_it():
    shaken = PLAIN.but(image=-np.eye(2), mount_deg=(0.0, 0.0, 0.0)).found()
    top = np.array(shaken.body_from_camera) @ (0.0, -1.0, 0.0)
    assert top == pytest.approx((-1.0, 0.0, 0.0), abs=0.02)
    assert shaken.delay.value == pytest.approx(0.035, abs=0.001)


def test_the_distance_follows_from_the_size_of_the_tag():
    assert SHORT.found().distance_m == pytest.approx(0.9, abs=0.06)
    assert SHORT.found(tag_size_m=0.32).distance_m == pytest.approx(1.8, abs=0.12)


def test_never_turned():
    shaken = PLAIN.but(turn_deg=0.0).found()
    assert shaken.mount is None
    assert shaken.delay.value == pytest.approx(0.035, abs=0.0015)
    (reason,) = shaken.not_shown
    assert reason.startswith("mount: never turned by 90 deg")


@pytest.mark.parametrize(
    ("hands", "words"),
    [
        (PLAIN.but(swing_deg=(0.3, 0.3, 0.3), flap_deg=0.0), "too little shaking about two axes"),
        (PLAIN.but(rhythm_hz=2.0, flap_deg=0.0, turn_deg=0.0), "shaken too evenly"),
        (PLAIN.but(tag_m=0.03), "the tag's side is"),
        (PLAIN.but(seconds=4.0), "the tag was seen whole in"),
    ],
    ids=["still", "rhythm", "small", "short"],
)
def test_what_is_not_shown_is_said_with_no_number(hands, words):
    shaken = hands.found()
    assert (shaken.delay, shaken.mount, shaken.sign_errors) == (None, None, ())
    assert any(words in reason for reason in shaken.not_shown)


def test_the_attitude_of_another_vehicle():
    strangers = PLAIN.shaking(attitude_at=PLAIN.but(seed=40).shaking().attitude_at)
    from fwav_companion.tools.shake.estimate import estimate

    shaken = estimate(strangers)
    assert (shaken.delay, shaken.mount) == (None, None)
    assert any("is it on this vehicle" in reason or "too evenly" in reason for reason in shaken.not_shown)


def test_no_attitudes_and_no_frames():
    assert "attitudes are missing" in PLAIN.found(attitude_at=lambda _: None).not_shown[-1]
    assert "seen whole in 0 frames" in PLAIN.found(tags=[]).not_shown[-1]


LEFT_OUT = 150


@cache
def without_one():
    """What is found where the detector sent nothing of one frame."""
    views = SHORT.shaking().tags
    found = SHORT.found(tags=[*views[:LEFT_OUT], *views[LEFT_OUT + 1 :]])
    assert found.delay is not None
    assert found != SHORT.found()
    return found


COLLAPSED = {
    "a point": lambda a, b, c, d: (a, a, a, a),
    "a line": lambda a, b, c, d: (a, (a + b) / 2, b, a),
    "a corner twice": lambda a, b, c, d: (a, a, c, d),
    "crossed": lambda a, b, c, d: (a, c, b, d),
}


@pytest.mark.parametrize("spoilt", COLLAPSED.values(), ids=COLLAPSED.keys())
def test_four_corners_that_are_no_square_are_left_out(spoilt):
    views = SHORT.shaking().tags
    four = [np.array(corner) for corner in views[LEFT_OUT].corners]
    bad = msgspec.structs.replace(views[LEFT_OUT], corners=tuple(map(tuple, spoilt(*four))))
    assert SHORT.found(tags=[*views[:LEFT_OUT], bad, *views[LEFT_OUT + 1 :]]) == without_one()


def test_of_two_frames_at_one_instant_the_first_counts():
    """No hand moves from one pose to the other in no time."""
    views = SHORT.shaking().tags
    again = msgspec.structs.replace(views[LEFT_OUT], boot_ns=views[LEFT_OUT - 1].boot_ns)
    assert SHORT.found(tags=[*views[:LEFT_OUT], again, *views[LEFT_OUT + 1 :]]) == without_one()


def test_pulls_hang_together_as_all_pairs_do():
    rng = np.random.default_rng(5)
    times_s, pulls = np.sort(rng.uniform(0.0, 20.0, 3 * BLOCK + 7)), rng.normal(size=(3 * BLOCK + 7, 4))
    apart_s = np.abs(times_s[:, None] - times_s)
    assert _correlated_products(pulls, times_s) == pytest.approx(
        pulls.T @ np.clip(1.0 - apart_s / MEMORY_S, 0.0, None) @ pulls, abs=1e-9
    )
