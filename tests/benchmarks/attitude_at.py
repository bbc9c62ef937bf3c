"""The attitude at one instant: ours, in a history of three seconds, against scipy's Slerp between the two neighbours.

Slerp is built and called for each instant, as single detections need it; its rotations come as quaternions, as in
messages. ``python -m tests.benchmarks.attitude_at``
"""

from __future__ import annotations

from math import cos, pi, sin

from scipy.spatial.transform import Rotation, Slerp

from fwav_companion.geometry.rotations import quaternion_from_euler
from fwav_companion.geometry.stamps import BootNs
from fwav_companion.telemetry.attitude.history import AttitudeHistory
from fwav_companion.types import AttitudeSample
from tests.benchmarks.figure import Figure, interleaved

STEP_NS = 10_000_000
SAMPLES = 300
INSTANTS = 400


def samples() -> list[AttitudeSample]:
    """Three seconds at 100 Hz of a body that nods by five degrees at 5 Hz."""
    phases = [2.0 * pi * 5.0 * k * STEP_NS * 1e-9 for k in range(SAMPLES)]
    return [
        AttitudeSample(
            BootNs(k * STEP_NS),
            quaternion_from_euler(0.02 * cos(phase), 0.65 + 0.087 * sin(phase), 0.3),
            (0.0, 0.087 * 10.0 * pi * cos(phase), 0.0),
        )
        for k, phase in enumerate(phases)
    ]


def measure() -> list[Figure]:
    """The ratio of CPU times."""
    reported = samples()
    history = AttitudeHistory()
    for sample in reported:
        history.insert(sample)
    # Ten detections a frame lie within its readout: the instants come in groups, over the last second.
    instants = [BootNs(1_900_000_000 + 33_000_000 * (k // 10 % 30) + 2_900_000 * (k % 10)) for k in range(INSTANTS)]
    pairs = [reported[t // STEP_NS : t // STEP_NS + 2] for t in instants]

    def ours() -> None:
        for t in instants:
            history.quaternion_at(t)

    def scipys() -> None:
        for t, (a, b) in zip(instants, pairs, strict=True):
            rotations = Rotation.from_quat([(*s.ned_from_body[1:], s.ned_from_body[0]) for s in (a, b)])
            Slerp([a.boot_ns * 1e-9, b.boot_ns * 1e-9], rotations)(t * 1e-9)

    ours_s, scipys_s = interleaved(ours, scipys)
    detail = f"ours {1e6 * ours_s / INSTANTS:.2f} us, Slerp {1e6 * scipys_s / INSTANTS:.0f} us"
    ratio = scipys_s / ours_s
    return [Figure("attitude at an instant, against scipy Slerp", ratio, 100.0, at_least=True, detail=detail)]


if __name__ == "__main__":
    print(*measure(), sep="\n")
