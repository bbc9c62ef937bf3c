"""Self-calibration: the camera's delay, its mount and the height, from targets that are seen again and again.

It runs a little behind the frames, so that the vehicle's states around each capture are known. First the delay is
searched for: a bank of joint estimates, one a delay, because a flapping wing is not linear in it. The best of them is
the point of linearization of a pass over all kept glimpses, and passes are repeated while the estimate settles
(``passes``). What the flight has not shown is held at its prior (``answer``).

Immutable but for :class:`CalibrationContext`, which holds what never changes.
"""

from __future__ import annotations

from collections.abc import Collection, Sequence
from math import hypot

import msgspec

from fwav_companion.geometry.stamps import NS_PER_MS, NS_PER_S, HostNs, ns_from_s
from fwav_companion.self_calibration.assessment import Assessment, CalibratedPlace, CalibrationStatus, assessed
from fwav_companion.self_calibration.calibration_context import DELAY_STEP_S, CalibrationContext
from fwav_companion.self_calibration.delay_search import UNEXPLAINED, DelaySearch, FoundDelay, NoDelay, delay_search
from fwav_companion.self_calibration.delayed_poses import DelayedPoses, VehiclePose, vehicle_pose
from fwav_companion.self_calibration.innovation_consistency import InnovationConsistency
from fwav_companion.self_calibration.measurement_queue import DelayedMeasurement, MeasurementQueue, Taken, most_taken
from fwav_companion.self_calibration.mount_check import NAMED, MountCheck
from fwav_companion.self_calibration.observability import MOUNT
from fwav_companion.self_calibration.pixel_measurement import PixelMeasurement, SharedParameter, pixel_measurement
from fwav_companion.self_calibration.prior_inflation import PriorInflation
from fwav_companion.self_calibration.rate_denoiser import SPAN_S, RateDenoiser
from fwav_companion.self_calibration.relinearization import Relinearization
from fwav_companion.self_calibration.report import CalibrationReport, believed, worth_keeping
from fwav_companion.self_calibration.view_geometry import ViewGeometry
from fwav_companion.types import GroundFix, VehicleState
from fwav_companion.types.tracks import GateResult

SEARCH_A_FRAME = 2
"""Glimpses that the search takes of one frame: each costs a step of every hypothesis."""
SEARCH_PAUSE_NS = 20 * NS_PER_S
"""After a search in vain: it costs as much as ten targets do."""
LAG_S = 0.06
"""Behind the newest frame, beside the delays that are asked for: attitudes beyond them must have come."""

JUDGED_EVERY_NS = 300 * NS_PER_MS
"""What a flight has shown changes in seconds; judging it costs as much as ten glimpses."""
PLACED_EVERY_NS = 90 * NS_PER_MS
"""Where a target stands changes by millimetres meanwhile."""


class Calibrator(msgspec.Struct, frozen=True):
    """The state of self-calibration. Immutable: each frame gives a new one."""

    shop: CalibrationContext
    lessons: MeasurementQueue = MeasurementQueue()
    search: DelaySearch | None = None
    """While the delay is searched for."""
    vain: NoDelay | None = None
    """How the last search ended, if it found nothing."""
    replaced: bool = False
    """What an earlier flight found was denied by this one, and dropped."""
    passes: Relinearization = Relinearization()
    views: ViewGeometry = ViewGeometry()
    turning: RateDenoiser = RateDenoiser()
    stamp_sigma_s: float = 0.0
    """One sigma of the instant that the stamps of attitudes leave open, by the newest."""
    idle_until_ns: HostNs = HostNs(0)
    """After a search that found nothing."""
    verdict: Assessment | None = None
    """What of the served estimate may be believed."""
    judged_ns: HostNs = HostNs(0)
    """When that was last asked."""
    places: dict[int, CalibratedPlace] = {}
    """By it, by track."""
    placed_ns: HostNs = HostNs(0)
    """When they were last worked out."""
    suspicion: MountCheck = MountCheck()
    host_ns: HostNs = HostNs(0)

    def learned(
        self,
        host_ns: HostNs,
        seen: Sequence[GroundFix],
        fixes: Sequence[tuple[int, GroundFix]],
        alive: Collection[int],
    ) -> Calibrator:
        """After a frame with all that was ``seen``; ``fixes`` by track; ``alive``: all tracks there are."""
        suspicion = self.suspicion.seen(seen, self._stood)
        if suspicion.text and not self._explained:
            return Calibrator(self.shop, host_ns=host_ns, suspicion=suspicion, replaced=self.replaced)
        due, lessons = self.lessons.with_frame(host_ns, fixes).due(HostNs(host_ns - ns_from_s(self._lag_s())))
        state = msgspec.structs.replace(self, lessons=lessons, host_ns=host_ns, suspicion=suspicion)._forgotten(alive)
        for lesson in due:
            if lesson.host_ns >= state.idle_until_ns:
                state = state._taught(lesson, alive)
        return state._searched_on()._passed_on()._judged()

    @property
    def delay_s(self) -> float | None:
        """The delay about which glimpses are taken, once it was found."""
        return self.passes.delay_s

    def placed(self, track: int) -> CalibratedPlace | None:
        """Where a target stands; None while that is not known here."""
        return self.places.get(track)

    @property
    def mistake(self) -> str:
        """What is grossly wrong with the mount, as a sentence; empty: nothing. Nothing is estimated then."""
        return "" if self._explained else self.suspicion.text

    @property
    def misplaced_m(self) -> float:
        """How far off all places may be told, by a mount that explains what was seen better: one sigma an axis."""
        found = self.suspicion.mistake
        return 0.0 if found is None or self._explained else found.misplaced_m

    @property
    def _explained(self) -> bool:
        """Self-calibration explains the flight by a mount not grossly off: a large delay scatters sights, too."""
        if self.verdict is None or self.verdict.status is not CalibrationStatus.CALIBRATED:
            return False
        return not self.suspicion.text or hypot(*(self.verdict.told[i][0] for i in MOUNT)) < NAMED

    @property
    def denied(self) -> tuple[PriorInflation, ...]:
        """Priors of the configuration that this flight denies."""
        return () if self.verdict is None else self.verdict.denied

    @property
    def mount_off(self) -> float:
        """How far from the configured mount the true one may be, rad: what was found, and two sigma of the rest."""
        means, sigmas = believed(self.verdict, self.shop.means, self.shop.sigmas, self.stamp_sigma_s)
        return hypot(*(means[i] for i in MOUNT)) + 2.0 * max(sigmas[i] for i in MOUNT)

    def gate(self, track: int, fix: GroundFix) -> GateResult | None:
        """How little a fix was expected of a target that stands in the joint estimate; None: it does not."""
        served = self.passes.served
        if served is None or self.delay_s is None:
            return None
        comparison = self.shop.compared(fix, self.delay_s, served.joint)
        return None if comparison is None else comparison.gate(track)

    def report(self) -> CalibrationReport:
        """What is known now."""
        means, sigmas = believed(self.verdict, self.shop.means, self.shop.sigmas, self.stamp_sigma_s)
        return CalibrationReport(
            host_ns=self.host_ns,
            time_offset_s=means[SharedParameter.DELAY],
            time_offset_sigma_s=sigmas[SharedParameter.DELAY],
            mount=(means[1], means[2], means[3]),
            mount_sigma=(sigmas[1], sigmas[2], sigmas[3]),
            height_m=means[SharedParameter.HEIGHT],
            height_sigma_m=sigmas[SharedParameter.HEIGHT],
            status=self._status(),
            rivals=() if self.vain is None else self.vain.rivals,
            mistake=self.mistake,
            denied=self.denied,
            replaced=self.replaced,
            keep=worth_keeping(self.verdict, self.stamp_sigma_s),
        )

    def _status(self) -> CalibrationStatus:
        if self.verdict is not None:
            return self.verdict.status
        return CalibrationStatus.WAITING if self.vain is None else self.vain.status

    def restarted(self) -> Calibrator:
        """After every target was dropped: what the flight has taught is kept, as a prior."""
        keep = worth_keeping(self.verdict, self.stamp_sigma_s)
        shop = self.shop if keep is None else CalibrationContext(self.shop.priors, self.shop.state_at, keep)
        return Calibrator(shop, host_ns=self.host_ns, suspicion=self.suspicion, replaced=self.replaced)

    # Each step returns the next state.

    def _lag_s(self) -> float:
        earliest = min(self.shop.delays) if self.delay_s is None else self.delay_s
        return LAG_S + 0.5 * SPAN_S + max(0.0, -earliest)

    def _forgotten(self, alive: Collection[int]) -> Calibrator:
        """Without the tracks that ended."""
        gone = self.passes.gone(alive)
        if not gone:
            return self
        search = None if self.search is None else self.search.without(gone, self.passes.kept)
        return msgspec.structs.replace(self, search=search, passes=self.passes.only(alive))

    def _course(self, nominal: VehicleState) -> DelayedPoses:
        return self.shop.course(nominal, self.shop.delays if self.delay_s is None else (self.delay_s,))

    def _stood(self, nominal: VehicleState) -> VehiclePose:
        """The vehicle at a capture, by the delay that was found, if one was."""
        if self.delay_s is None:
            return vehicle_pose(nominal, 0.0)
        return self.shop.course(nominal, (self.delay_s,)).at(self.delay_s)

    def _taught(self, lesson: DelayedMeasurement, alive: Collection[int]) -> Calibrator:
        """With one frame's fixes."""
        fixes, lessons = self._chosen(lesson, alive)
        if not fixes:
            return self
        first = fixes[0][1].sighting
        if first.state.stamp_sigma_s > DELAY_STEP_S:  # attitudes that tell no delay from another
            return self
        slow = self.shop.slow(
            first.state, self.shop.means[SharedParameter.DELAY] if self.delay_s is None else self.delay_s
        )
        turning = self.turning.with_state(first.state, slow, self.shop.priors.attitude_noise)
        sigma_s = first.state.stamp_sigma_s
        state = msgspec.structs.replace(self, lessons=lessons, turning=turning, stamp_sigma_s=sigma_s)
        for track, fix, since_s in fixes:  # each with a course of its own: rows are captured one after another
            course = turning.freed_of_noise(self._course(fix.sighting.state), slow)
            state = state._glimpsed(pixel_measurement(track, fix, course, since_s), state.views.with_fix(fix))
        return state

    def _chosen(self, lesson: DelayedMeasurement, alive: Collection[int]) -> tuple[list[Taken], MeasurementQueue]:
        """As many of a frame's fixes as it may cost; a search goes on with the targets that it began with."""
        if self.delay_s is None:
            known = {glimpse.track for glimpse in self.passes.kept}
            return self.lessons.taken(lesson, SEARCH_A_FRAME, alive, known)
        served = self.passes.served
        most = len(lesson.fixes) if served is None else most_taken(len(served.joint.mean))
        return self.lessons.taken(lesson, most, alive)

    def _glimpsed(self, glimpse: PixelMeasurement, views: ViewGeometry) -> Calibrator:
        state = msgspec.structs.replace(self, passes=self.passes.with_glimpse(glimpse), views=views)
        if state.delay_s is not None:
            return state
        if not self.shop.searches:
            return state._found(self.shop.means)
        search = state.search or delay_search(self.shop)
        return msgspec.structs.replace(state, search=search.fed(glimpse))

    def _searched_on(self) -> Calibrator:
        """A frame further with the search; a delay that is found is where the first pass begins."""
        if self.search is None:
            return self
        search = self.search.advanced(self.passes.kept)
        match search.result(self.passes.kept):
            case FoundDelay(around):
                return self._found(around)
            case NoDelay() as vain:
                return self._given_up(vain)
            case None:
                return msgspec.structs.replace(self, search=search)

    def _given_up(self, vain: NoDelay) -> Calibrator:
        """What was kept decides nothing; it says why, and another search is begun after a pause."""
        if self.shop.kept is not None:
            return self._begun_anew()
        pause_ns = HostNs(self.host_ns + SEARCH_PAUSE_NS)
        return Calibrator(
            self.shop,
            host_ns=self.host_ns,
            lessons=self.lessons,
            idle_until_ns=pause_ns,
            suspicion=self.suspicion,
            vain=vain,
            replaced=self.replaced,
        )

    def _found(self, around: tuple[float, ...]) -> Calibrator:
        """The delay is settled enough for the first pass."""
        return msgspec.structs.replace(self, search=None, vain=None, passes=self.passes.begun(self.shop, around))

    def _passed_on(self) -> Calibrator:
        """A few glimpses further with a pass, if there is one."""
        passes = self.passes.advanced(self.shop)
        return self if passes is self.passes else msgspec.structs.replace(self, passes=passes)

    def _judged(self) -> Calibrator:
        """Let go what is shown, hold the rest."""
        served = self.passes.served
        if served is None:
            return self
        if not served.fits:
            return self._given_up(UNEXPLAINED)
        joint, shop, verdict, judged_ns = served.joint, self.shop, self.verdict, self.judged_ns
        if verdict is None or self.host_ns - judged_ns >= JUDGED_EVERY_NS:
            views, drift = self.views, served.drift or InnovationConsistency()
            verdict = assessed(joint, shop.means, shop.sigmas, various=views.various, down=views.down, drift=drift)
            judged_ns = self.host_ns
        elif joint is not verdict.free.joint and self.host_ns - self.placed_ns >= PLACED_EVERY_NS:
            verdict = verdict.about(joint, shop.means)
        else:
            return self
        if self.shop.kept is not None and any(each.unknown != SharedParameter.HEIGHT for each in verdict.denied):
            return self._begun_anew()
        places, placed_ns = verdict.places(), self.host_ns
        return msgspec.structs.replace(self, verdict=verdict, places=places, judged_ns=judged_ns, placed_ns=placed_ns)

    def _begun_anew(self) -> Calibrator:
        """Somebody moved the camera since it was calibrated: the configuration is a better beginning."""
        return Calibrator(
            self.shop.unlearned(), host_ns=self.host_ns, lessons=self.lessons, suspicion=self.suspicion, replaced=True
        )
