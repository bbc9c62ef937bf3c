"""Clicks on rendered flights: the whole pipeline, the mock's pictures, and the truth of the mock's own geometry."""

from __future__ import annotations

import pytest
from click_flights import final_error_m, fly_with_a_click
from draws import slow_of

from fwav_companion.geometry.ellipses import circle_radius
from fwav_companion.types.spots import CLICK_LABEL


@pytest.mark.slow
def test_a_click_on_the_ground_becomes_the_selected_target():
    companion, _ = fly_with_a_click(2, seconds=13.0, fps=10.0, sets=["flight.speed_m_s=1.0"])
    assert companion.seen["found"] >= 0.95 * companion.seen["in view"] > 8
    assert max(companion.pixel_errors) < 3.0
    error_m = final_error_m(companion)
    last = [line for line in companion.targets(CLICK_LABEL) if line.is_confirmed][-1]
    assert error_m is not None
    assert error_m < circle_radius(last.cov, 0.999)
    selected = companion.pipeline._components.publisher.selected
    assert selected is not None
    assert selected.label == CLICK_LABEL


@pytest.mark.timeout(1200)
@pytest.mark.parametrize("number", slow_of(3, 8, few=1))
def test_clicks_of_many_flights_are_tracked_through_each_pass_and_end_on_nothing_else(number):
    """Figures of eight of 60 s: the spot leaves the picture and returns, seen from another side."""
    flights = [fly_with_a_click(seed, seconds=60.0, fps=10.0) for seed in range(1, number + 1)]
    sharp = sum(companion.seen["sharp"] for companion, _ in flights)
    found = sum(companion.seen["sharp found"] for companion, _ in flights)
    assert found >= 0.95 * sharp > 2.5 * number
    for companion, mock in flights:
        assert companion.place is not None
        height_m = mock.options.flight.height_m
        errors_m = sorted(error / 667.0 * height_m for error in companion.pixel_errors)
        assert not errors_m or errors_m[round(0.95 * (len(errors_m) - 1))] < 0.2
        assert not errors_m or errors_m[-1] < 0.5, "another thing"
