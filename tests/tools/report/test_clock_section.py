"""Statements about the two clocks: drift by a line fit over the settled clock, uncertainty with 95 %."""

import random
import re

import pytest
from msgspec.structs import replace
from report_lines import Markup, approach, clock, header, summary

from fwav_companion.recording.line_types import ClockEstimateLine
from fwav_companion.tools.report import diagnostics, flight_data, page
from fwav_companion.tools.report.clock_section import clock_drift, settled_clock

DRIFT = -15e-6
"""The autopilot's clock runs 15 ppm fast: the offset host minus autopilot falls."""


def settled(seconds=30, sigma_s=1e-5, seed=3):
    noise = random.Random(seed)
    return [clock(float(at_s), 600.0 + DRIFT * at_s + noise.gauss(0.0, sigma_s), sigma_s) for at_s in range(seconds)]


def text_of(lines):
    return Markup(diagnostics([header(), *lines])[1]).text


def test_the_drift_is_fitted_to_the_settled_clock_alone():
    """The first estimates, before the clock is settled, are off by milliseconds: first minus last says -134 us/s."""
    begin = [clock(float(at_s), 600.0035 - 0.0004 * at_s, 3e-4, status="settling") for at_s in (-2, -1)]
    assert 1e6 * (settled()[-1].host_from_autopilot_s - begin[0].host_from_autopilot_s) / 31.0 < -130.0
    slow = [replace(line, host_from_autopilot_s=1200.0 - line.host_from_autopilot_s) for line in settled()]
    for lines, verb in (([*begin, *settled()], "gains"), (slow, "loses")):
        words = rf"clock {verb} ([\d.]+) ± ([\d.]+) µs per second \(95 %, line fit\)"
        ((drift, width),) = re.findall(words, text_of(lines))
        assert abs(float(drift) - 15.0) < float(width) < 2.0


def test_an_estimate_of_an_unsettled_clock_does_not_count_however_certain_it_says_to_be():
    lines = [clock(-1.0, 600.0015, 1e-5, status="settling"), *settled()]
    drift, width = clock_drift(settled_clock(lines))
    assert abs(drift - DRIFT) < width
    assert settled_clock(lines) == settled()


def test_an_estimate_that_is_less_certain_counts_less():
    lines = settled()
    lines[0] = clock(0.0, 600.0005, 1e-3)
    drift, width = clock_drift(lines)
    assert drift == pytest.approx(DRIFT, abs=0.5e-6)
    assert width < 2e-6


@pytest.mark.parametrize("seed", range(20))
def test_the_drift_is_inside_its_interval(seed):
    drift, width = clock_drift(settled(12, 4e-5, seed))
    assert abs(drift - DRIFT) < width


def test_a_drift_that_cannot_be_seen_is_not_claimed():
    text = text_of([clock(float(at_s), 600.0, 1e-4) for at_s in range(20)])
    assert "0 ± 15 µs per second (95 %, line fit)." in text
    assert "per second" not in text_of(settled(4))
    assert text_of(settled()[:1]) == ""


def test_only_the_time_since_a_restart_of_the_autopilot_counts():
    restarted = [clock(at_s + 30.0, 620.0 + DRIFT * at_s) for at_s in range(20)]
    lines = [*settled(), *restarted]
    assert settled_clock(lines) == restarted
    assert "gains 15 ± 1 µs" in text_of(lines)


def test_uncertainty_is_95_percent_and_never_beyond_the_hard_bound():
    lines = [header(), *approach([0.0]), *[clock(float(at_s), 600.0, 2e-4) for at_s in range(9)], summary()]
    text = Markup(page(flight_data(lines, title=""))).text
    assert "was known to 0.39 ms (95 %); its hard bound was 1 ms." in text
    wide = [replace(line, sigma_s=9e-4) if isinstance(line, ClockEstimateLine) else line for line in lines]
    assert "was known to 1 ms (95 %)" in Markup(page(flight_data(wide, title=""))).text
