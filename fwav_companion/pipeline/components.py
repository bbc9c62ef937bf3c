"""The components that a pipeline joins, and the answers that need several of them. Pure."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from functools import partial
from math import inf

from fwav_companion.acting.acting import Acting
from fwav_companion.geometry.earth import Geodetic
from fwav_companion.geometry.stamps import HostNs, s_from_ns
from fwav_companion.mavlink.client.commands import Commands
from fwav_companion.mavlink.client.identity import Identity
from fwav_companion.mavlink.client.rates import Rates
from fwav_companion.mavlink.client.timesync import Timesync
from fwav_companion.pipeline.camera_pipeline import CameraPipeline
from fwav_companion.pipeline.clicked_spots import ClickedSpots
from fwav_companion.pipeline.predicted_accuracy import PredictedAccuracy
from fwav_companion.pipeline.target_log import TargetLog
from fwav_companion.pipeline.track_marks import track_marks
from fwav_companion.publishing.publisher import Publisher
from fwav_companion.publishing.readiness import Readiness, obstacle
from fwav_companion.recording.line_types import ClockEstimateLine
from fwav_companion.recording.lines import clock_line
from fwav_companion.telemetry import Telemetry
from fwav_companion.types import (
    Autopilot,
    ClockEstimate,
    Frame,
    Notice,
    Reason,
    Situation,
    Track,
    Unpaired,
    VehicleState,
)
from fwav_companion.types.board import BoardReport
from fwav_companion.types.flight_status import AutopilotReport, ClockReport, OriginReport
from fwav_companion.types.spots import SpotRefused, SpotViews
from fwav_companion.types.status import PipelineStatus
from fwav_companion.types.track_marks import TrackMarks
from fwav_companion.types.tracks import CommonErrors


@dataclass(slots=True)
class Components:
    """All rooms of a pipeline; :mod:`fwav_companion.pipeline.pipeline_factory` makes them from a configuration."""

    identity: Identity
    timesync: Timesync
    rates: Rates
    commands: Commands
    telemetry: Telemetry
    publisher: Publisher
    camera: CameraPipeline | None
    """None in a relay without a camera."""
    acting: Acting | None = None
    """None where [act] is absent, or asks for nothing."""
    spots: ClickedSpots | None = None
    """None where clicks only select tracks."""
    adopted_ns: HostNs | None = None
    """Instant of the adoption of the autopilot."""
    board: BoardReport | None = None
    """The newest report of the board's load."""

    def situation(self, now: HostNs) -> Situation:
        """State of autopilot, vehicle and clock for publishing."""
        telemetry = self.telemetry
        return Situation(
            now_ns=now,
            autopilot=self.identity.autopilot,
            plane=telemetry.world.plane,
            newest_state=self._vehicle,
            clock_estimate=partial(telemetry.clock.estimate, now),
            undulation_m=telemetry.undulation_m,
            utc_minus_host_s=self.utc_minus_host_s(),
            autopilot_age_s=self.identity.heard_age_s(now),
            frame_age_s=None if self.camera is None else self.camera.frame_age_s(now),
            board=self.board,
        )

    def _vehicle(self) -> VehicleState | None:
        state = self.telemetry.newest_state()
        return None if isinstance(state, Unpaired) else state

    def utc_minus_host_s(self) -> float | None:
        """UTC minus host clock by the autopilot, else by the board's synchronised wall clock; None where unknown."""
        by_autopilot_s = self.telemetry.utc_minus_host_s
        return by_autopilot_s if by_autopilot_s is not None or self.board is None else self.board.utc_minus_host_s

    def readiness(self, camera: CameraPipeline, now: HostNs) -> Readiness:
        """The conditions for localization at this instant: rates, clock, frames and the accuracy to expect."""
        expected = camera.look.expected()
        return Readiness(
            attitude_hz=self.telemetry.attitude_hz(now),
            wanted_attitude_hz=self.rates.wanted_attitude_hz,
            rate_trouble=self.rates.trouble,
            attitude_pending=self.rates.attitude_pending,
            clock_sigma_s=self.telemetry.clock.sigma_s_at(now),
            frames_hz=camera.frames_hz(now),
            frame_age_s=camera.frame_age_s(now),
            refused=camera.refused,
            no_fix=expected if isinstance(expected, Reason) else None,
            within95_m=expected.within95_m if isinstance(expected, PredictedAccuracy) else None,
            height_m=expected.height_m if isinstance(expected, PredictedAccuracy) else None,
            had_position=self.telemetry.world.plane is not None or self.telemetry.world.local,
            autopilot_silent=self.identity.heartbeat_overdue(now),
        )

    def shared(self, now: HostNs) -> tuple[tuple[Track, ...], Situation, str | None]:
        """The confirmed and coasting tracks, the vehicle, and why the service is not ready; None where it is ready."""
        trouble = self.obstacle(now)
        why = "no camera is configured" if trouble is None else trouble
        return self.publisher.reported_tracks, self.situation(now), why or None

    def common_errors(self) -> Mapping[int, CommonErrors]:
        """Errors that targets share with others, by track; empty without a smoother."""
        return {} if self.camera is None else self.camera.tracker.common_errors()

    def obstacle(self, now: HostNs) -> str | None:
        """Why the service is not ready; "" where it is; None without a camera."""
        if self.camera is None:
            return None
        found = obstacle(self.readiness(self.camera, now))
        return "" if found is None else found.text

    def spot_views(self, frame: Frame) -> SpotViews:
        """Predicted views of the clicked spots in a picture that the camera process has just taken."""
        return SpotViews(frame.picture or 0, {}) if self.spots is None else self.spots.views(frame)

    def on_spot_refused(self, refused: SpotRefused) -> list[Notice]:
        """Forget a clicked spot that the camera process cannot follow; returns the notices."""
        if self.spots is not None:
            self.spots.on_refused(refused.spot)
        self.publisher.on_spot_refused(refused)
        return self.publisher.notices()

    def track_marks(self, frame: Frame) -> TrackMarks:
        """Pixels of the confirmed and coasting tracks in a picture of the preview."""
        if self.camera is None:
            return TrackMarks(frame.picture or 0, ())
        return track_marks(self.camera.look, frame, self.publisher.reported_tracks, self.publisher.selected)

    def footprint(self, now: HostNs) -> tuple[tuple[float, float], ...]:
        """Corners of the camera's footprint on the ground, latitude and longitude, degrees; empty where unknown."""
        plane = self.telemetry.world.plane
        if plane is None or self.camera is None:
            return ()
        places = [plane.geodetic_from_ned(each) for each in self.camera.footprint(self.publisher.image_size, now)]
        return tuple((round(place.lat_deg, 7), round(place.lon_deg, 7)) for place in places)

    def clock_line(self, at: HostNs, unix_offset_ns: int) -> ClockEstimateLine | None:
        """Clock line of the recording at this instant; None while the clock is unknown."""
        boot_ns = self.telemetry.clock.boot_from_host(at)
        if isinstance(boot_ns, Unpaired):
            return None
        utc_minus_host_s = self.telemetry.utc_minus_host_s
        utc_minus_unix_s = None if utc_minus_host_s is None else utc_minus_host_s - unix_offset_ns / 1e9
        return clock_line(at, self.telemetry.clock.estimate(at), boot_ns, utc_minus_unix_s)

    def status(self, now: HostNs, log: TargetLog) -> PipelineStatus:
        """The pipeline's part of the status. ``log``: counts frames, fixes and refusals."""
        plane, report = self.telemetry.world.plane, None if self.camera is None else self.camera.calibration
        return PipelineStatus(
            autopilot=_autopilot_report(self.identity.autopilot, self.identity.heard_age_s(now)),
            autopilot_lost=self.identity.autopilot_lost,
            obstacle=self.obstacle(now),
            adopted_s=inf if self.adopted_ns is None else s_from_ns(now - self.adopted_ns),
            clock=_clock_report(self.telemetry.clock.estimate(now)),
            timesync=self.timesync.status(),
            rates=self.rates.status(),
            parameters=dict(self.rates.parameters),
            origin=None if plane is None else _origin_report(plane.origin),
            telemetry=self.telemetry.status(now),
            sight=None if self.camera is None else self.camera.status(),
            calibration=None if self.camera is None or report is None else self.camera.calibration_news.status(report),
            publishing=self.publisher.status(now),
            acting=None if self.acting is None else self.acting.status(),
            tracks=self.publisher.track_reports(plane, now),
            footprint=list(self.footprint(now)),
            frames=log.frames,
            detections=log.detections,
            fixes=log.fixes,
            dropped=log.refusals(),
            dropped_frames=log.refused_frames(),
            dropped_detections=log.refused_detections(),
        )


def _autopilot_report(autopilot: Autopilot | None, age_s: float | None) -> AutopilotReport | None:
    if autopilot is None:
        return None
    return AutopilotReport(
        system=autopilot.system,
        component=autopilot.component,
        kind=autopilot.kind.value,
        vehicle_type=autopilot.vehicle_type,
        armed=autopilot.armed,
        link=autopilot.link,
        age_s=age_s,
    )


def _clock_report(estimate: ClockEstimate) -> ClockReport:
    return ClockReport(
        at_ns=estimate.at_ns,
        host_from_autopilot_ns=estimate.host_from_autopilot_ns,
        skew=estimate.skew,
        sigma_s=estimate.sigma_s,
        bound_s=estimate.bound_s,
        round_trip_s=estimate.round_trip_s,
        status=estimate.status.value,
        rate_differs=estimate.rate_differs,
    )


def _origin_report(origin: Geodetic) -> OriginReport:
    return OriginReport(lat=origin.lat_deg, lon=origin.lon_deg, alt_amsl=origin.alt_amsl_m)
