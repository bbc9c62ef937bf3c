"""Whole landings: the service, the mock autopilot, and a copter that lands by what it gets, in simulated time."""

from __future__ import annotations

from collections import deque
from collections.abc import Sequence
from dataclasses import dataclass, replace
from math import cos, hypot, pi, sin, sqrt
from random import Random
from typing import Any

import numpy as np
from configured_links import AUTOPILOT
from flying import Companion
from kept import kept

from fwav_companion.recording.lines import Line
from sitl_mock import Options, scenario, simulate
from sitl_mock.lander import Touchdown
from sitl_mock.rotation import apply, minus

CAMERA = '[camera]\ncalibration = "camera.yaml"\nreadout_s = 0.0\n'
LANDING = '[publish]\nlanding_target = true\nlanding_label = "{label}"\n'
ONE_TAG = '[[target]]\nlabel = "tag36h11:0"\nsize_m = 0.2\n'
THREE = """[[pad]]
label = "pad"
landing_offset_m = [0.0, {right_m}]
height_m = {height_m}
tags = [
    {{ label = "tag36h11:0", size_m = 0.4, at_m = [-0.33, 0.0] }},
    {{ label = "tag36h11:1", size_m = 0.12, at_m = [0.13, 0.04], yaw_deg = 90.0 }},
    {{ label = "tag36h11:2", size_m = 0.04 }},
]
"""
BESIDE_TAG = """[[pad]]
label = "pad"
landing_offset_m = [0.0, 2.0]
tags = [{ label = "tag36h11:0", size_m = 0.2 }]
"""
ON_PAD = THREE.format(right_m=0.0, height_m=0.0)
BESIDE_PAD = THREE.format(right_m=2.0, height_m=0.0)
ON_BOAT = THREE.format(right_m=0.0, height_m=0.5) + 'motion = "moving"\n'
AFTER_S = 2.5
"""Time after the touchdown to which a landing is flown: the disarming, and its text."""
LEAST_HEIGHT_M = 0.2
START_M = 1.2
"""Greatest distance from the pad at which a drawn landing begins, metres."""


@dataclass(frozen=True)
class Landing:
    """One landing. Frames are those that show the pad, after the first confirmation and above 0.2 m."""

    touchdown: Touchdown | None
    frames: int
    """Number of those frames whose claim is inside the limit."""
    sent: int
    """Number of them with a LANDING_TARGET before the next frame."""
    squares: float
    """Mean square of the vectors' horizontal errors over their claimed variance, over 2; 1 expected of round claims."""
    withheld: dict[str, int]
    texts: tuple[str, ...]
    """STATUSTEXT of the autopilot and of the service about the landing, in order."""

    @property
    def miss_m(self) -> float:
        """Horizontal distance from the landing point; infinite where it did not land."""
        return float("inf") if self.touchdown is None else self.touchdown.miss_m


class Watched(Companion):
    """The service; keeps the claim of each LANDING_TARGET, and what frames led to one."""

    def __init__(self, *arguments: Any, **how: Any) -> None:
        super().__init__(*arguments, **how)
        self.sigma_of: dict[int, float] = {}
        """Claim by ``time_usec``, metres."""
        self.frames: list[tuple[int, bool]] = []
        """Arrival of each frame, and whether it showed a tag."""
        self.uncertain_at: list[int] = []
        """Instants of refusals because of the claim."""
        self._uncertain = 0

    def on_frame(self, frame: Any, now_ns: int) -> list[bytes]:
        self.frames.append((now_ns, bool(frame["detections"])))
        return super().on_frame(frame, now_ns)

    def _flushed(self, now: Any) -> list[bytes]:
        before = len(self.sent)
        out = super()._flushed(now)
        landing = self.pipeline._components.publisher.landing
        for _, each in self.sent[before:]:
            if each.name == "LANDING_TARGET":
                self.sigma_of[each.fields["time_usec"]] = landing._sigma_m
        uncertain = landing.withheld["too_uncertain"]
        if uncertain > self._uncertain:
            self._uncertain = uncertain
            self.uncertain_at.append(now)
        return out


def drawn(name: str, seed: int, **changes: Any) -> Options:
    """A scenario's landing that begins at a drawn place with a drawn heading; pads turn with it."""
    options = scenario(name)
    rng = Random(f"{seed}/start")
    turn, far_m, heading_deg = rng.uniform(0.0, 2.0 * pi), START_M * sqrt(rng.random()), rng.uniform(0.0, 360.0)
    by_deg = heading_deg - options.flight.fixed_heading_deg
    pads = tuple(replace(each, heading_deg=each.heading_deg + by_deg) for each in options.targets)
    start = {"flight.offset_m": (far_m * cos(turn), far_m * sin(turn)), "flight.fixed_heading_deg": heading_deg}
    return options.but({"seed": seed, "targets": pads, **start, **changes})


def land(options: Options, target: str, settings: Sequence[str] = ()) -> Landing:
    """The landing by the service's LANDING_TARGET. ``target``: TOML of the pad or target. Flown once in a run."""
    return kept(repr(("land", options, target, tuple(settings))), lambda: _landed(options, target, settings))


def land_exactly(options: Options) -> Touchdown | None:
    """The landing by exact angles and ranges of the frames that show the pad, from the camera as if it were where it
    is configured.
    """
    mock = simulate(options)
    lander, pad = mock.lander, mock.scene[0]
    assert lander is not None
    for frame in range(int(options.seconds * options.camera.fps)):
        seen_s = mock.camera.row0_s(frame)
        state = mock.flight.at(seen_s)
        if mock.camera._pad_tags.detections(pad, seen_s):
            lever_m = apply(state.ned_from_body, mock.biases.lever_arm_m)
            lander.hear(minus(minus(pad.at(seen_s), state.position), lever_m), frame, seen_s)
        if lander.touchdown is not None:
            break
    return lander.touchdown


def _landed(options: Options, target: str, settings: Sequence[str]) -> Landing:
    label = "pad" if "[[pad]]" in target else "tag36h11:0"
    mock = simulate(options)
    lander = mock.lander
    assert lander is not None
    text = AUTOPILOT + CAMERA + LANDING.format(label=label) + target
    companion = Watched(settings, unix_minus_host_s=mock.unix_minus_host_s, text=text, camera=_camera_file(options))
    for now_ns, _ in mock.drive(companion):
        if lander.touchdown is not None and mock.flight_s(now_ns) > lander.touchdown.at_s + AFTER_S:
            break
    companion.finish()
    end_s = options.seconds if lander.touchdown is None else lander.touchdown.at_s
    frames, sent = _shares(mock, companion, companion.targets(label), end_s)
    return Landing(
        touchdown=lander.touchdown,
        frames=frames,
        sent=sent,
        squares=_squares(mock, companion),
        withheld={
            str(reason): n
            for reason, n in companion.pipeline.status(companion._now).publishing.landing.withheld.items()
        },
        texts=tuple(text for text in companion.notices if "pad" in text or "LANDING" in text),
    )


def _shares(mock: Any, companion: Watched, lines: Sequence[Line], end_s: float) -> tuple[int, int]:
    first_unix = next((line.time_unix for line in lines if line.state == "confirmed"), None)
    if first_unix is None:
        return 0, 0
    first_ns = round(first_unix * 1e9) - companion.unix_offset_ns + 100_000_000
    left_ns = deque(now for now, each in companion.sent if each.name == "LANDING_TARGET")
    uncertain_ns = np.array(companion.uncertain_at)
    seen = sent = 0
    for at_ns, shows in companion.frames:
        t = mock.flight_s(at_ns)
        if not shows or at_ns < first_ns or t > end_s or -mock.flight.at(t).position[2] < LEAST_HEIGHT_M:
            continue
        until_ns = at_ns + round(2e9 / mock.options.camera.fps)  # a frame waits for attitudes after its capture
        if ((uncertain_ns >= at_ns) & (uncertain_ns < until_ns)).any():
            continue
        seen += 1
        while left_ns and left_ns[0] < at_ns:
            left_ns.popleft()
        if left_ns and left_ns[0] < until_ns:
            left_ns.popleft()
            sent += 1
    return seen, sent


def _squares(mock: Any, companion: Watched) -> float:
    squares = []
    for each in mock.vehicle.precland.accepted:
        if mock.lander.touchdown is not None and each["flight_s"] > mock.lander.touchdown.at_s:
            continue
        seen_s, north, east, _ = each["followed"]
        true = minus(mock.scene[0].at(seen_s), mock.flight.at(seen_s).position)
        sigma_m = companion.sigma_of[each["time_usec"]]
        squares.append(hypot(north - true[0], east - true[1]) ** 2 / sigma_m**2 / 2.0)
    return float(np.mean(squares)) if squares else float("nan")


def _camera_file(options: Options) -> str:
    keys = ("image_size", "k_mm", "pixels_per_mm", "principal_point")
    return "model: kannala_brandt\n" + "".join(f"{key}: {list(getattr(options.camera, key))}\n" for key in keys)
