"""From a camera's stamp to the vehicle's attitude, through the whole chain: clocks, the wire, cut stamps.

The error of a target straight below, from 10 m, while the body nods by 5 degrees at 5 Hz.
"""

import random

import flapping
import pytest
from telemetry_messages import Autopilot, message

from fwav_companion.geometry.stamps import BootNs, HostNs
from fwav_companion.types import ClockExchange, Unpaired

MS = 1_000_000
HEIGHT_MM = 10_000.0


def errors_mm(
    *, hz: int, delay_s: float, jitter_s: float, seconds: float = 40.0, from_s: float = 21.0, drift: float = 50e-6
) -> list[float]:
    """Errors along the pitch axis, of frames at 20 Hz after ``from_s``."""
    rng = random.Random(11)
    motion = flapping.nodding(5.0)
    rates = flapping.body_rates(motion, seconds, filter_hz=20.0)
    autopilot = Autopilot(attitude_stamp_delay_s=0.0025)

    def host(t: float) -> HostNs:
        return HostNs(autopilot.host_at_boot + round(t * (1.0 + drift) * 1e6) * 1000)

    def wire() -> float:
        return 0.002 + rng.expovariate(1.0 / jitter_s)

    # (time at which it is known, kind, time of the event): attitudes, exchanges, frames
    sent = [k / hz + rng.uniform(0.0, 0.0025) for k in range(int(seconds * hz) - 1)]  # when the loop processes it
    arrivals = [(t + wire(), 0, t) for t in sent]
    arrivals += [(0.1 * k + 0.2, 1, 0.1 * k) for k in range(int(seconds * 10) - 3)]
    arrivals += [(0.05 * k + 0.15, 2, 0.05 * k + rng.uniform(0.0, 0.04)) for k in range(int(seconds * 20) - 5)]
    errors = []
    for arrival, kind, t in sorted(arrivals):
        if kind == 0:
            of = max(0.0, t - rng.uniform(0.0, delay_s))
            roll, pitch, yaw = motion(of)
            p, q, r = rates[min(len(rates) - 1, int(of * 1e4))]
            fields = {"roll": roll, "pitch": pitch, "yaw": yaw, "rollspeed": p, "pitchspeed": q, "yawspeed": r}
            reported = message("ATTITUDE", time_boot_ms=int(t * 1e3), **fields)
            autopilot.telemetry.on_message(reported, host(arrival))
        elif kind == 1:
            up, down = wire(), wire()
            told_ns = BootNs(round((t + up) * 1e6) * 1000)
            autopilot.telemetry.on_exchange(ClockExchange(host(t), host(t + up + down), told_ns))
        elif t > from_s:
            boot_ns = autopilot.telemetry.clock.boot_from_host(host(t))
            state = autopilot.telemetry.state_at(boot_ns)
            assert not isinstance(state, Unpaired)
            errors.append(HEIGHT_MM * flapping.angle_error(motion, round(t * 1e9), state.ned_from_body)[1])
    return errors


@pytest.mark.parametrize(("hz", "most_mm"), [(50, 20.0), (100, 20.0)])
def test_with_millisecond_stamps_their_delay_and_the_estimated_clock(hz, most_mm):
    errors = errors_mm(hz=hz, delay_s=0.0025, jitter_s=0.003)
    assert len(errors) > 300
    assert flapping.rms(errors) < most_mm
    assert abs(sum(errors) / len(errors)) < 0.3 * flapping.rms(errors)
