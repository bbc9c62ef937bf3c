"""The camera's state by the poses of photographs, or of a video's frames. PURE.

A photograph has its own pose. A video's poses are a path over time: its telemetry may be late by a delay that all
frames share, so the state at any instant is needed, with velocity and turn.
"""

from __future__ import annotations

from bisect import bisect_left, bisect_right
from collections.abc import Sequence
from math import degrees, hypot, radians, sqrt

import msgspec

from fwav_companion.config import Config
from fwav_companion.geometry.earth import Geodetic, TangentPlane
from fwav_companion.geometry.rotations import conjugate, exp, log, multiply
from fwav_companion.geometry.stamps import NS_PER_MS, BootNs, HostNs
from fwav_companion.geometry.vectors import ZERO3, add, scale, subtract
from fwav_companion.recording.photograph_poses import SAME_TIME_S, PhotographPose
from fwav_companion.types import AttitudeSample, Frame, RangeSample, Reason, ReportedGimbal, Unpaired, VehicleState

STEP_NS = 20 * NS_PER_MS
"""Interval of a video's attitudes: turns of a gimbal between two poses are even."""
LOOK_AHEAD_NS = 500 * NS_PER_MS
"""Time after a frame up to which its poses count: an interpolation needs three attitudes after the instant."""
LONGEST_GAP_S = 1.0
"""Longest interval of a video's poses that is interpolated, seconds; they come with every frame."""


class UnixClock:
    """Conversion between host clock and autopilot clock where both are Unix time."""

    def host_from_boot(self, boot_ns: BootNs) -> HostNs | Unpaired:
        """The same instant."""
        return HostNs(boot_ns)

    def boot_from_host(self, host_ns: HostNs) -> BootNs | Unpaired:
        """The same instant."""
        return BootNs(host_ns)

    def sigma_s_at(self, host_ns: HostNs) -> float:  # noqa: ARG002
        """0: the offset is exact."""
        return 0.0

    def rate_at(self, host_ns: HostNs) -> float:  # noqa: ARG002
        """1: both clocks are the same."""
        return 1.0


class PoseWorld:
    """The local frame about the origin."""

    relative: bool | None = False


def least_sigmas(poses: Sequence[PhotographPose], config: Config) -> tuple[float, float, float]:
    """The least sigma of position, height and attitude over all pictures, metres and radians."""
    rows = [_sigmas(pose, config) for pose in poses]
    position, height, attitude = (min(column) for column in zip(*rows, strict=True))
    return position, height, attitude


def _own_sigmas(pose: PhotographPose, config: Config) -> tuple[float, float, float]:
    """One sigma of a picture's own errors of position, height and attitude: from its row, else the noise configured."""
    given = config.uncertainty
    by_config = (given.position_noise_m, given.height_noise_m, radians(given.attitude_noise_deg))
    of_row = (pose.position_sigma_m, pose.height_sigma_m, pose.attitude_sigma)
    position, height, attitude = (b if own is None else own for own, b in zip(of_row, by_config, strict=True))
    return position, height, attitude


def _sigmas(pose: PhotographPose, config: Config) -> tuple[float, float, float]:
    """One sigma of position, height and attitude of a picture: from its row, else noise and bias of the
    configuration.
    """
    given = config.uncertainty
    attitude_deg = hypot(max(given.attitude_bias_deg, given.heading_bias_deg), given.attitude_noise_deg)
    by_config = (
        hypot(given.position_sigma_m, given.position_noise_m),
        hypot(given.height_bias_m, given.height_noise_m),
        attitude_deg / degrees(1.0),
    )
    of_row = (pose.position_sigma_m, pose.height_sigma_m, pose.attitude_sigma)
    position, height, attitude = (b if own is None else own for own, b in zip(of_row, by_config, strict=True))
    return position, height, attitude


class PhotographSource:
    """Source of the camera's state: the pose of the picture that :meth:`take` selected last."""

    def __init__(
        self,
        poses: Sequence[PhotographPose],
        origin: Geodetic,
        config: Config | None = None,
        *,
        sigmas_are_total: bool = False,
        moves: bool = False,
    ) -> None:
        """``config``: None where poses are only looked up. ``moves``: the poses are those of a video."""
        self.clock = UnixClock()
        self.world = PoseWorld()
        self.plane = TangentPlane(origin)
        self._by_frame = {pose.frame: pose for pose in poses if pose.frame is not None}
        self._by_file = {pose.file: pose for pose in poses if pose.file}
        timed = [(pose.time_unix, pose) for pose in poses if pose.frame is None and pose.time_unix is not None]
        self._poses_by_time = sorted(timed, key=lambda each: each[0])
        self._config = config
        self._shared = (0.0, 0.0, 0.0) if config is None or not sigmas_are_total else least_sigmas(poses, config)
        self._sigmas = _sigmas if sigmas_are_total else _own_sigmas
        self._pose: PhotographPose | None = None
        path = sorted((p for p in poses if p.time_unix is not None), key=lambda p: p.time_unix or 0.0) if moves else []
        self._path = path
        self._times = [pose.time_unix or 0.0 for pose in path]
        self._until_ns = BootNs(0)

    def pose_of(self, frame: Frame) -> PhotographPose | None:
        """The pose of a frame: by its file where the poses have files alone, else by its number or its time."""
        if self._by_file and frame.file:
            return self._by_file.get(frame.file.replace("\\", "/").rpartition("/")[2])
        if frame.number in self._by_frame:
            return self._by_frame[frame.number]
        time_s = frame.stamp_ns * 1e-9
        after = bisect_left(self._poses_by_time, time_s, key=lambda each: each[0])
        near = min(
            self._poses_by_time[max(0, after - 1) : after + 1], key=lambda each: abs(each[0] - time_s), default=None
        )
        return near[1] if near is not None and abs(near[0] - time_s) <= SAME_TIME_S else None

    def take(self, frame: Frame) -> None:
        """Select the picture of this frame."""
        self._pose = self.pose_of(frame)

    def ready_for(self, boot_ns: BootNs) -> bool:  # noqa: ARG002
        """True: a pose is complete."""
        return True

    def newest_state(self) -> VehicleState | Unpaired:
        """NO_POSE: there is no vehicle now."""
        return Unpaired(Reason.NO_POSE)

    def state_at(self, boot_ns: BootNs) -> VehicleState | Unpaired:
        """State of the camera in the selected picture, the same for every row; of a video, at this instant."""
        if self._path and self._config is not None:
            return self._on_path(boot_ns, self._config)
        pose = self._pose
        if pose is None or self._config is None:
            return Unpaired(Reason.NO_POSE)
        return self._state(boot_ns, pose, self._config)

    def _on_path(self, boot_ns: BootNs, config: Config) -> VehicleState | Unpaired:
        """Interpolated between the two poses around the instant, or extrapolated from the nearest two."""
        at_s = boot_ns * 1e-9
        after = min(max(1, bisect_left(self._times, at_s)), len(self._path) - 1)
        if after < 1:
            return Unpaired(Reason.NO_POSE)
        first, second = self._path[after - 1], self._path[after]
        span_s = self._times[after] - self._times[after - 1]
        part = (at_s - self._times[after - 1]) / span_s if span_s > 0.0 else 0.0
        outside_s = max(0.0, -part, part - 1.0) * span_s
        if span_s > LONGEST_GAP_S or outside_s > LONGEST_GAP_S or span_s <= 0.0:
            return Unpaired(Reason.NO_POSE)
        here, there = (self.plane.ned_from_geodetic(pose.place) for pose in (first, second))
        turn = log(multiply(conjugate(first.ned_from_carrier), second.ned_from_carrier))
        state = self._state(boot_ns, first if part < 0.5 else second, config)
        return msgspec.structs.replace(
            state,
            ned_from_body=multiply(first.ned_from_carrier, exp(scale(turn, part))),
            rates=scale(turn, 1.0 / span_s),
            position_ned=add(here, scale(subtract(there, here), part)),
            velocity_ned=scale(subtract(there, here), 1.0 / span_s),
            spacing_s=span_s,
        )

    def _state(self, boot_ns: BootNs, pose: PhotographPose, config: Config) -> VehicleState:
        own = self._sigmas(pose, config)
        position, height, attitude = (
            sqrt(max(0.0, sigma * sigma - shared * shared)) for sigma, shared in zip(own, self._shared, strict=True)
        )
        return VehicleState(
            boot_ns=boot_ns,
            ned_from_body=pose.ned_from_carrier,
            rates=ZERO3,
            attitude_sigma=attitude,
            gap_s=0.0,
            position_ned=self.plane.ned_from_geodetic(pose.place),
            velocity_ned=ZERO3,
            position_sigma_m=position,
            height_above_home_m=None,
            height_sigma_m=height,
        )


class VideoPoses(PhotographSource):
    """The poses of a video as a vehicle's telemetry, up to the frame that :meth:`take` selected last."""

    def take(self, frame: Frame) -> None:
        """Select the frame."""
        super().take(frame)
        self._until_ns = BootNs(frame.stamp_ns + LOOK_AHEAD_NS)

    def attitudes_after(self, boot_ns: BootNs) -> list[AttitudeSample]:
        """Attitudes later than the instant, interpolated in steps finer than the poses, which come with every frame."""
        first_ns = max(boot_ns + STEP_NS, round(self._times[0] * 1e9)) if self._times else self._until_ns
        last_ns = min(self._until_ns, round(self._times[-1] * 1e9)) if self._times else 0
        states = [self.state_at(BootNs(t)) for t in range(first_ns, last_ns + 1, STEP_NS)]
        return [
            AttitudeSample(state.boot_ns, state.ned_from_body, state.rates)
            for state in states
            if isinstance(state, VehicleState)
        ]

    def positions_after(self, boot_ns: BootNs) -> list[tuple[BootNs, bool]]:
        """Instants of poses later than the instant, in order; none jumps."""
        after = bisect_right(self._times, boot_ns * 1e-9)
        instants = [BootNs(round(t * 1e9)) for t in self._times[after:]]
        return [(t, False) for t in instants if boot_ns < t <= self._until_ns]

    def ranges_after(self, boot_ns: BootNs) -> list[RangeSample]:  # noqa: ARG002
        """None: there is no rangefinder."""
        return []

    def gimbal_at(self, boot_ns: BootNs) -> ReportedGimbal | Reason:  # noqa: ARG002
        """NO_GIMBAL: the camera is its own carrier."""
        return Reason.NO_GIMBAL
