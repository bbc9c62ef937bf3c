"""Fuses a fleet's messages to one picture, shows it, and makes the message that publishes it. Pure."""

from __future__ import annotations

from collections.abc import Callable, Generator, Mapping

import numpy as np

from fwav_companion.fleet.payloads import (
    FusedMessage,
    FusedTrack,
    LocalTrack,
    SharedTrack,
    VehicleBias,
    encoded,
    triangle,
)
from fwav_companion.geometry.earth import Geodetic, TangentPlane
from fwav_companion.geometry.ellipses import radius_95
from fwav_companion.geometry.vectors import Matrix3
from fwav_companion.ground.covariances import ellipse_of, from_triangle
from fwav_companion.ground.fleet_intake import FleetIntake, WholeReport
from fwav_companion.ground.fusion.fleet_fusion import FRESH_S, FleetFusion
from fwav_companion.ground.fusion.fused_targets import FusedTarget
from fwav_companion.ground.fusion.reported_tracks import BIASES, Array, ReportedTrack
from fwav_companion.ground.picture import GroundPicture, readiness_fields, targets_of
from fwav_companion.ground.views import LocalTargetView, TargetView

TURN_S = 0.008
"""CPU time of a turn, seconds, after which a step waits for the next call: with the slice that is begun then, 20 ms."""
STEP_S = 0.5
USED_BIASES = {"position_north": 0, "position_east": 1, "heading": 2}
"""Columns of the fusion by the name of a bias; the effects of all other biases count as noise."""
LEAST_VARIANCE_M2 = 1e-4
LARGEST_REACH_M = 200_000.0
"""Largest distance from the first place, metres: one tangent plane does not reach farther."""
WARNING, NOTICE = 4, 5
"""MAV_SEVERITY."""


class FleetPicture:
    """Takes messages, steps the fusion, and keeps the picture up to date."""

    def __init__(self, picture: GroundPicture, cpu_s: Callable[[], float] = lambda: 0.0) -> None:
        """``cpu_s``: CPU time of the caller's thread, seconds, by which a step ends its turn."""
        self._picture, self._cpu_s = picture, cpu_s
        self._running: Generator[None] | None = None
        self._intake = FleetIntake()
        self._fusion = FleetFusion()
        self._plane: TangentPlane | None = None
        self._outside: dict[str, float] = {}
        """Instant of the newest report of each vehicle whose tracks are all out of the plane's reach."""
        self._due_unix = 0.0
        self._seq = 0

    def knows(self, vehicle: str) -> bool:
        """Whether a message of this vehicle has been accepted, and its place not given to another one since."""
        return self._intake.knows(vehicle)

    def on_message(self, vehicle: str, kind: str, data: bytes, now: float) -> None:
        """Take one message of a vehicle."""
        if kind == "state":
            self._on_state(vehicle, data, now)
            return
        report = self._intake.on_tracks(vehicle, data, now)
        if report is None:
            return
        self._picture.on_vehicle(vehicle, now, heard={"companion": now}, local_targets=self._local_targets(report))
        sigmas = _sigmas(report.bias)
        tracks = self._tracks(report)
        if report.tracks and not tracks and self._moves_to(report, now):
            tracks = self._tracks(report)
        self._fusion.on_tracks(vehicle, tracks, sigmas, now)

    def on_alive(self, vehicle: str, there: bool, now: float) -> None:
        """Process a change of a vehicle's liveliness token on the bus."""
        if not there and vehicle in self._picture.vehicles:
            self._picture.say(vehicle, "left the fleet, or its network was cut", now, severity=WARNING)

    def step(self, now: float) -> list[bytes] | None:
        """Fuse and show the result twice a second; returns the message to publish, None between two steps.

        A step goes on at the next call where it has taken TURN_S of this one: meanwhile the page is served.
        """
        if self._running is None:
            if now < self._due_unix:
                return None
            self._due_unix = now + STEP_S
            self._running = self._fusion.slices(now)
        ends_s = self._cpu_s() + TURN_S
        try:
            for _ in self._running:
                if self._cpu_s() >= ends_s:
                    return None
        except Exception:
            self._start_anew()  # what it holds may be the cause, and it would fail at each step
            raise
        self._running = None
        for vehicle, text in self._intake.take_texts():
            self._picture.say(vehicle, text, now, severity=WARNING)
        for vehicle, text, warning in self._fusion.take_report().texts:
            self._picture.say(vehicle, text, now, severity=WARNING if warning else NOTICE)
        self._show(now)
        return self._message(now)

    @property
    def is_stepping(self) -> bool:
        """Whether a step is not done."""
        return self._running is not None

    def _start_anew(self) -> None:
        self._running, self._fusion, self._plane = None, FleetFusion(), None

    def _local_targets(self, report: WholeReport) -> tuple[LocalTargetView, ...]:
        """The targets in the vehicle's local world; each keeps the instant of its first report."""
        known = self._picture.vehicles.get(report.vehicle)
        first = {} if known is None else {each.id: each.first_unix for each in known.local_targets}
        views = (_local_target(report, track, first) for track in report.local_tracks)
        return tuple(view for view in views if view is not None)

    def _tracks(self, report: WholeReport) -> list[ReportedTrack]:
        """The tracks of a report that are within the plane's reach."""
        tracks = [self._reported(report.vehicle, track, report.bias, report.at_unix) for track in report.tracks]
        return [track for track in tracks if track is not None]

    def _moves_to(self, report: WholeReport, now: float) -> bool:
        """Report a vehicle all of whose tracks are out of reach, and move the plane there if most vehicles are.

        The first place that was ever reported may be a wrong one.
        """
        is_new = report.vehicle not in self._outside
        self._outside[report.vehicle] = now
        self._outside = {name: at for name, at in self._outside.items() if now <= at + FRESH_S}
        inside = [name for name in self._fusion.vehicles if name not in self._outside]
        if len(self._outside) > len(inside):
            self._start_anew()
            self._outside = {}
            return True
        text = (
            f"its targets are over {LARGEST_REACH_M / 1000.0:.0f} km from the others and left out. Check its position"
        )
        if is_new:
            self._picture.say(report.vehicle, text, now, severity=WARNING)
        return False

    def _on_state(self, vehicle: str, data: bytes, now: float) -> None:
        received = self._intake.on_state(vehicle, data, now)
        if received is None:
            return
        state, at_unix = received
        known = self._picture.vehicles.get(vehicle)
        fields: dict[str, object] = {"companion": "healthy", "armed": state.armed, "footprint": state.footprint}
        fields |= readiness_fields(known, ready=state.ready, trouble=state.trouble)
        if known is None or not known.kind:
            fields["kind"] = "fleet"
        fields["local_ned"] = None if state.local is None else (state.local.north, state.local.east, state.local.down)
        ages = {"autopilot": state.autopilot_age_s, "detector": state.frame_age_s}
        if state.local is not None:  # the instant of a place on the earth, which may be older, stays
            fields["heading_deg"] = state.heading_deg
            ages |= dict.fromkeys(("local", "attitude"), state.position_age_s or 0.0)
        if state.lat is not None and state.lon is not None:
            fields |= {"lat": state.lat, "lon": state.lon, "alt_amsl": state.alt_amsl}
            fields["heading_deg"] = state.heading_deg
            ages |= dict.fromkeys(("position", "attitude"), state.position_age_s or 0.0)
        heard = {name: at_unix - age_s for name, age_s in ages.items() if age_s is not None}
        self._picture.on_vehicle(vehicle, now, heard={"companion": now, "readiness": now, **heard}, **fields)

    def _reported(self, vehicle: str, track: SharedTrack, bias: VehicleBias, at_unix: float) -> ReportedTrack | None:
        """The track in the common plane with its covariance split; None if it is out of reach."""
        place = Geodetic.from_degrees(track.lat, track.lon, track.alt_amsl or 0.0)
        if self._plane is None:
            self._plane = TangentPlane(place)
        north, east, down = self._plane.ned_from_geodetic(place)
        if not abs(north) + abs(east) < LARGEST_REACH_M:
            return None
        total, shared = _square(track.cov), _square(track.cov_shared)
        rows = np.array(track.bias_jacobian[:2], float).reshape(2, len(bias.names))
        jacobian = np.zeros((2, BIASES))
        for index, name in enumerate(bias.names):
            if name in USED_BIASES:
                jacobian[:, USED_BIASES[name]] = rows[:, index]
        own = jacobian @ np.diag(_sigmas(bias) ** 2) @ jacobian.T
        velocity = None
        if track.vel is not None:
            velocity = np.array(track.vel[:2], float)
        return ReportedTrack(
            vehicle=vehicle,
            track=track.track,
            label=track.label,
            confirmed=track.state in ("confirmed", "coasting"),
            position=np.array([north, east]),
            velocity=velocity,
            noise=_positive(total - shared - own),
            shared=_positive(shared),
            jacobian=jacobian,
            down_m=down,
            down_variance=max(track.cov[5], LEAST_VARIANCE_M2),
            at_unix=at_unix,
            seen_unix=at_unix - max(track.last_seen_s, 0.0),
        )

    def _show(self, now: float) -> None:
        """Add the fused targets to the picture, and remove those that ended."""
        targets = self._fusion.targets
        shown = {f"fleet/{target.id}" for target in targets}
        for old in targets_of(self._picture, "fused"):
            if old.id not in shown:
                self._picture.remove_target(old.id)
        self._picture.cover(
            frozenset(f"{name}/{track}" for target in targets for name, track in target.members.items())
        )
        for target in targets:
            self._picture.on_target(self._view(target), now)

    def _view(self, target: FusedTarget) -> TargetView:
        place, cov = self._place(target), _cov3(target)
        return TargetView(
            id=f"fleet/{target.id}",
            vehicle="fleet",
            track=str(target.id),
            label=target.label,
            state="confirmed" if target.confirmed else "coasting",
            lat=place.lat_deg,
            lon=place.lon_deg,
            alt_amsl=place.alt_amsl_m,
            ellipse=ellipse_of(cov),
            radius95_m=radius_95(cov),
            first_unix=target.first_unix,
            seen_unix=target.seen_unix,
            source="fused",
            vehicles={name: str(track) for name, track in target.members.items()},
            left_out=dict(target.left_out),
            contradicted=self._contradiction(target),
        )

    def _contradiction(self, target: FusedTarget) -> str:
        """What contradicts the claim of a fused target; "": nothing that is known."""
        for vehicle, reason in target.left_out.items():
            return f"vehicle {vehicle} sees it {reason}"
        for pair in self._fusion.disagreements:
            if not pair.isdisjoint(target.members):
                return f"vehicles {' and '.join(sorted(pair))} disagree about what both see"
        return ""

    def _message(self, now: float) -> list[bytes]:
        """The fused picture for the bus."""
        self._seq += 1
        tracks = []
        for target in self._fusion.targets:
            place = self._place(target)
            tracks.append(
                FusedTrack(
                    track=target.id,
                    label=target.label,
                    state="confirmed" if target.confirmed else "coasting",
                    lat=place.lat_deg,
                    lon=place.lon_deg,
                    alt_amsl=round(place.alt_amsl_m, 3),
                    cov=triangle(_cov3(target)),
                    last_seen_s=round(max(now - target.seen_unix, 0.0), 2),
                    vehicles=dict(target.members),
                    left_out=dict(target.left_out),
                )
            )
        return encoded(FusedMessage(time_unix=now, seq=self._seq, tracks=tuple(tracks)))

    def _place(self, target: FusedTarget) -> Geodetic:
        if self._plane is None:  # a target exists only after a track, which has made the plane
            raise AssertionError
        north, east = (float(each) for each in target.position)
        return self._plane.geodetic_from_ned((north, east, target.down_m))


def _local_target(report: WholeReport, track: LocalTrack, first: Mapping[str, float]) -> LocalTargetView | None:
    """The track as a target on its vehicle's grid. ``first``: instants of first reports by id."""
    cov = from_triangle(track.cov)
    if cov is None:
        return None
    identity = f"{report.vehicle}/local/{track.track}"
    return LocalTargetView(
        id=identity,
        track=str(track.track),
        label=track.label,
        state=track.state,
        north_m=track.north,
        east_m=track.east,
        down_m=track.down,
        ellipse=ellipse_of(cov),
        radius95_m=radius_95(cov),
        first_unix=first.get(identity, report.at_unix),
        seen_unix=report.at_unix - max(track.last_seen_s, 0.0),
    )


def _sigmas(bias: VehicleBias) -> Array:
    """One sigma of each bias that the fusion estimates."""
    sigmas = np.zeros(BIASES)
    for name, sigma in zip(bias.names, bias.sigma, strict=True):
        if name in USED_BIASES:
            sigmas[USED_BIASES[name]] = sigma
    return sigmas


def _square(values: tuple[float, ...]) -> Array:
    """The horizontal part of a covariance's upper triangle."""
    return np.array([[values[0], values[1]], [values[1], values[3]]])


def _positive(cov: Array) -> Array:
    """The nearest covariance: an eigenvalue that rounding to three digits made negative becomes the least variance."""
    values, vectors = np.linalg.eigh(cov)
    positive: Array = (vectors * np.maximum(values, LEAST_VARIANCE_M2)) @ vectors.T
    return positive


def _cov3(target: FusedTarget) -> Matrix3:
    (nn, ne), (_, ee) = target.cov.tolist()
    return ((nn, ne, 0.0), (ne, ee, 0.0), (0.0, 0.0, target.down_variance))
