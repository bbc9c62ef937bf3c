"""When the clock's rate is reported: beyond three sigmas and beyond 200 ppm, by the texts and by `check` alike."""

import msgspec
import pytest
from wires import Wire, constant

from fwav_companion.geometry.stamps import HostNs
from fwav_companion.telemetry.clock.clock_line import ClockLine
from fwav_companion.telemetry.clock.clock_news import ClockRate, ClockReports
from fwav_companion.telemetry.clock.exchange_clock import ExchangeClock

SIGMA = 30e-6
REPORTED = [
    pytest.param(250e-6, SIGMA, True, id="beyond both"),
    pytest.param(-250e-6, SIGMA, True, id="fast, beyond both"),
    pytest.param(150e-6, 1e-6, False, id="certain, within 200 ppm"),
    pytest.param(250e-6, 100e-6, False, id="beyond 200 ppm, within three sigmas"),
    pytest.param(5e-3, 2e-3, False, id="a large one within three sigmas"),
]


def line_of(skew: float, sigma: float) -> ClockLine:
    return ClockLine(ref_host_ns=HostNs(0), offset_ns=0, skew=skew, var_offset=1e-8, var_skew=sigma**2)


class Settled(ExchangeClock):
    """A clock of a segment that has lasted for a minute, on a line of any rate."""

    def __init__(self, line: ClockLine) -> None:
        super().__init__()
        self.line, self.accepted = line, 100

    changed = in_doubt = False
    segment_ns = HostNs(0)


@pytest.mark.parametrize(("skew", "sigma", "reported"), REPORTED)
def test_rate_is_news_beyond_three_sigmas_and_200_ppm_alone(skew: float, sigma: float, reported: bool):
    news = ClockReports().on_exchange(Settled(line_of(skew, sigma)), None, HostNs(60 * 10**9))
    assert news == (ClockRate(1.0 - skew) if reported else None)


@pytest.mark.parametrize(("skew", "sigma", "reported"), REPORTED)
def test_check_is_given_a_rate_beyond_three_sigmas_and_200_ppm_alone(skew: float, sigma: float, reported: bool):
    wire = Wire(up=constant(0.001), down=constant(0.001)).run(20.0)
    used = wire.clock._used
    line = msgspec.structs.replace(used.line, skew=skew, var_skew=sigma**2)
    used.line = used.exchanges.line = line
    estimate = wire.clock.estimate(line.ref_host_ns)
    assert estimate.rate_differs is reported


@pytest.mark.parametrize(("ppm", "reported"), [(150, False), (400, True)])
def test_rate_of_a_quiet_wire_is_in_the_news_beyond_200_ppm_alone(ppm: float, reported: bool):
    wire = Wire(up=constant(0.001), down=constant(0.001), drift=lambda t: ppm * 1e-6 * t)
    news = [found for k in range(80) if (found := wire.exchange(0.5 * k)) is not None]
    assert len(news) == reported
    assert wire.error_s(40.0)[1].rate_differs is reported
