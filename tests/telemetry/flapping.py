"""Attitudes in closed form, with rates as an autopilot filters them; the oracle is scipy's Rotation."""

from collections.abc import Callable
from math import cos, pi, radians, sin, sqrt

import numpy as np
from scipy.signal import bilinear, lfilter
from scipy.spatial.transform import Rotation

from fwav_companion.geometry.stamps import BootNs
from fwav_companion.telemetry.attitude.history import AttitudeHistory
from fwav_companion.types import AttitudeSample, Unpaired

FINE_S = 1e-4

Euler = tuple[float, float, float]
Motion = Callable[[float], Euler]
"""(roll, pitch, yaw) at a time in seconds."""


def nodding(hz: float, amplitude_deg: float = 5.0) -> Motion:
    """Pitch alone."""
    return lambda t: (0.0, radians(amplitude_deg) * sin(2.0 * pi * hz * t + 0.3), 0.0)


def flying(hz: float, amplitude_deg: float = 5.0) -> Motion:
    """Pitch with its second harmonic, roll, and a turn, about a mean pitch of 37 degrees."""
    a, w = radians(amplitude_deg), 2.0 * pi * hz
    return lambda t: (
        0.3 * a * sin(w * t + 1.0),
        radians(37.0) + a * sin(w * t) + 0.15 * a * cos(2.0 * w * t),
        0.4 * t,
    )


def rotation(motion: Motion, t: float) -> Rotation:
    roll, pitch, yaw = motion(t)
    return Rotation.from_euler("ZYX", [yaw, pitch, roll])


def body_rates(motion: Motion, seconds: float, *, filter_hz: float | None) -> np.ndarray:
    """(n, 3) rad/s every 0.1 ms, after a two-pole Butterworth low-pass, or unfiltered."""
    times = np.arange(0.0, seconds, FINE_S)
    fine = Rotation.from_euler("ZYX", [motion(t)[::-1] for t in np.append(times, times[-1] + FINE_S) - FINE_S / 2])
    rates = (fine[:-1].inv() * fine[1:]).as_rotvec() / FINE_S
    if filter_hz is None:
        return rates
    w = 2.0 * pi * filter_hz
    b, a = bilinear([w * w], [1.0, sqrt(2.0) * w, w * w], 1.0 / FINE_S)
    return lfilter(b, a, rates, axis=0)


def stream(
    motion: Motion, hz: float, seconds: float, *, filter_hz: float | None = 20.0, late_ns: Callable[[], int] = lambda: 0
) -> list[AttitudeSample]:
    """Attitudes at this rate on whole milliseconds; ``late_ns`` is added to a stamp and not to its attitude."""
    rates = body_rates(motion, seconds, filter_hz=filter_hz)
    samples = []
    for k in range(int(seconds * hz)):
        t_ms = round(1000.0 * k / hz)
        x, y, z, w = rotation(motion, t_ms * 1e-3).as_quat()
        p, q, r = rates[t_ms * 10]
        samples.append(AttitudeSample(BootNs(t_ms * 1_000_000 + late_ns()), (w, x, y, z), (p, q, r)))
    return samples


def history_of(samples: list[AttitudeSample]) -> AttitudeHistory:
    history = AttitudeHistory()
    for sample in samples:
        history.insert(sample)
    return history


def angle_error(motion: Motion, boot_ns: int, quaternion: tuple[float, ...]) -> np.ndarray:
    """The rotation vector from truth to answer, rad."""
    w, x, y, z = quaternion
    return (rotation(motion, boot_ns * 1e-9).inv() * Rotation.from_quat([x, y, z, w])).as_rotvec()


def errors_and_claims(
    motion: Motion, samples: list[AttitudeSample], *, from_s: float, readout_s: float = 0.0
) -> tuple[np.ndarray, np.ndarray]:
    """(errors (n, 3), claimed sigmas (n,)) of frames at 29.7 Hz, each evaluated when the history is ready for it."""
    history, pending, errors, claims = AttitudeHistory(), [], [], []
    next_frame_s = from_s
    for sample in samples:
        history.insert(sample)
        while next_frame_s <= sample.boot_ns * 1e-9:
            pending += [round((next_frame_s + share * readout_s) * 1e9) for share in (0.0, 0.35, 1.0)]
            next_frame_s += 1.0 / 29.7
        for instant in [i for i in pending if history.ready_for(BootNs(i))]:
            pending.remove(instant)
            at = history.at(BootNs(instant))
            assert not isinstance(at, Unpaired), at
            errors.append(angle_error(motion, instant, at.ned_from_body))
            claims.append(at.sigma)
    return np.array(errors), np.array(claims)


def rms(values: np.ndarray) -> float:
    return float(np.sqrt(np.mean(np.square(values))))
