"""The verdict on a followed click: right flights pass, each kind of mistake is named."""

from __future__ import annotations

import msgspec
import pytest

from fwav_companion.tools.click_flight.click_report import click_page
from fwav_companion.tools.click_flight.click_score import ClickScore, is_whole, sample, with_troubles

COV = ((1.0, 0.0, 0.0), (0.0, 1.0, 0.0), (0.0, 0.0, 1.0))


def samples(found=(True,) * 10, error_px=1.0, blur_px=0.5):
    return tuple(
        sample(
            number,
            at_s=0.1 * number + (5.0 if number > 5 else 0.0),
            true=(100.0, 200.0),
            blur_px=blur_px,
            scale=0.02,
            found=(100.0 + error_px, 200.0) if each else None,
        )
        for number, each in enumerate(found)
    )


def score(error_m=1.0, **how):
    made = ClickScore(samples=samples(**how), confirmed=True, error_m=error_m, claimed95_m=2.45)
    return with_troubles(made, COV, right_picture=True, strays=())


def test_a_followed_click_is_right_and_its_figures_are_those_of_the_samples():
    right = score()
    assert right.troubles == ()
    assert (right.sharp, right.sharp_found, right.passes) == (10, 10, 2)
    assert right.added95_m == pytest.approx(0.02)
    assert right.as_json()["ok"] is True


def test_blurred_frames_need_not_be_found():
    assert score(found=(False,) * 10, blur_px=3.0).troubles == ()


@pytest.mark.parametrize(
    ("wrong", "words"),
    [
        (lambda: score(found=(True,) * 7 + (False,) * 3), "found in 7 of the 10"),
        (lambda: score(error_px=26.0), "another thing was taken for the spot in frame 0"),
        (lambda: score(error_m=3.8), "its place is wrong by 3.80 m"),
        (
            lambda: with_troubles(ClickScore(samples=samples()), None, right_picture=True, strays=()),
            "never became",
        ),
        (lambda: with_troubles(score(), COV, right_picture=False, strays=()), "another picture"),
        (lambda: with_troubles(score(), COV, right_picture=True, strays=[17]), "in frame 17"),
    ],
)
def test_each_mistake_is_named(wrong, words):
    (trouble,) = wrong().troubles
    assert words in trouble
    assert wrong().as_json()["ok"] is False


def test_a_place_within_99_9_percent_is_right():
    """Of a circular Gaussian of 1 m: 3.717 m."""
    assert score(error_m=3.70).troubles == ()


def test_the_patch_must_be_whole_to_be_in_view():
    assert is_whole((41.0, 41.0), (640, 480))
    assert not is_whole((39.0, 41.0), (640, 480))
    assert not is_whole((320.0, 440.0), (640, 480))


def test_the_page_shows_figures_pictures_and_troubles_and_escapes_them():
    right = msgspec.structs.replace(score(), troubles=("a <b> trouble",))
    page = click_page(right, [("The picture that was clicked on.", b"\xff\xd8jpeg")], command="demo --click")
    assert "10 of 10" in page
    assert "A &lt;b&gt; trouble." in page
    assert "data:image/jpeg;base64," in page
    assert page.count('class="estimate"') == 10


def test_the_page_of_a_flight_without_a_click_says_why():
    assert "No click was taken: no_texture." in click_page(
        ClickScore(troubles=("no click was taken: no_texture",)), [], command="demo --click"
    )
