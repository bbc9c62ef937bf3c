"""Self-calibration: the camera's delay, its mount and the height, from targets that are seen repeatedly.

It runs a little behind the frames, so that the vehicle's states around each capture are known. First the delay is
searched with a bank of joint filters, one for each hypothesis of the delay, because the motion of a flapping wing is
not linear in the delay. The best hypothesis is the linearization point of a pass over all kept measurements. Passes are
repeated while the estimate settles (``relinearization``). Parameters that are not observable in the flight stay at
their priors (``assessment``).

Immutable except for :class:`CalibrationContext`, which holds the constants.
"""

from __future__ import annotations

from collections.abc import Collection, Mapping, Sequence

import msgspec
import numpy as np

from fwav_companion.geometry.stamps import NS_PER_MS, NS_PER_S, HostNs, ns_from_s, s_from_ns
from fwav_companion.self_calibration.assessment import Assessment, assessed
from fwav_companion.self_calibration.calibration_context import DELAY_STEP_S, CalibrationContext
from fwav_companion.self_calibration.calibration_report import (
    CalibrationReport,
    SharedParameter,
)
from fwav_companion.self_calibration.calibration_state import CalibrationState
from fwav_companion.self_calibration.delay_search import UNEXPLAINED, FoundDelay, NoDelay, delay_search
from fwav_companion.self_calibration.filter_pass import FilterPass
from fwav_companion.self_calibration.measurement_batch import MeasurementBatch
from fwav_companion.self_calibration.measurement_queue import (
    BATCH_NS,
    SEARCH_NS,
    DelayedMeasurement,
    Frames,
    samples_of,
)
from fwav_companion.self_calibration.present_report import report_of
from fwav_companion.self_calibration.relinearization import STEP, steps_within
from fwav_companion.self_calibration.vehicle_motion import in_motion
from fwav_companion.types import GroundFix

MOST_TARGETS = 30
"""Most targets in the joint estimate. Three targets determine everything that ten do, and a search keeps 20 covariances
of all of them."""
GAP_NS = 500 * NS_PER_MS
"""Age of the estimate beyond which it is predicted to the capture of a frame. Measurements are used 0.2 to 0.45 s late.
Within that time a first-order position error of 1 m and 60 s moves by 0.12 m along an axis, a third of the noise of a
fix. Predicting the gate for every frame cost a tenth of the CPU of ten targets (three pairs: 1.00, 1.11, 1.18)."""
SEARCH_PAUSE_NS = 20 * NS_PER_S
"""Pause after a search without result, because a search costs as much CPU as ten targets do."""


class Calibrator(CalibrationState, frozen=True):
    """The self-calibration state with its update steps. Immutable: each step returns a new calibrator."""

    def predicted(self, host_ns: HostNs) -> Calibrator:
        """The calibrator predicted to the capture of a frame, before the fixes of that frame are used.

        While no target was in view, the error of the vehicle's position has wandered, and with it the places relative
        to the vehicle. Gated by an estimate that was 9 s old, three of ten targets 5 m apart were refused by their own
        tracks and initiated new ones.
        """
        if self.present is None or host_ns - self.present.joint.host_ns <= GAP_NS:
            return self
        present = self.present.predicted(host_ns)
        if present is self.present:
            return self
        return msgspec.structs.replace(self, present=present, assessment=self._assessment_of(present))

    def updated(
        self,
        host_ns: HostNs,
        seen: Sequence[GroundFix],
        fixes: Sequence[tuple[int, GroundFix]],
        alive: Collection[int],
    ) -> Calibrator:
        """The calibrator after one frame.

        ``seen``: all fixes of the frame. ``fixes``: the associated ones, with their tracks. ``alive``: the live tracks
        that self-calibration uses.
        """
        mount_check = self.mount_check.seen(seen, self._state_at_capture, self._shown_delay_s, self.context.priors)
        if mount_check.text and not self._explained:
            return self._afresh(host_ns=host_ns, mount_check=mount_check)
        queue = self.queue.with_frame(DelayedMeasurement(host_ns, tuple(fixes)))
        state = msgspec.structs.replace(self, queue=queue, mount_check=mount_check)
        return state.caught_up(host_ns, alive)

    def caught_up(self, host_ns: HostNs, alive: Collection[int]) -> Calibrator:
        """The calibrator after all measurements that are due were used. ``alive``: the live tracks to use."""
        span_ns = SEARCH_NS if self.delay_s is None else BATCH_NS
        due, queue = self.queue.due(HostNs(host_ns - ns_from_s(self._lag_s())), span_ns)
        state = msgspec.structs.replace(self, queue=queue, host_ns=host_ns)._only(alive)
        if not due and state.search is None and state.passes.coming is None:
            return state
        teaching = state._teaching(alive)
        for frames in due:
            if frames[0].host_ns >= state.idle_until_ns:
                state = state._with_frames(frames, teaching)
        steps = steps_within(host_ns - self.host_ns)
        return state._searched(steps)._passed(steps)._assessed()

    def report(self) -> CalibrationReport:
        """Report of the present state of self-calibration."""
        return report_of(self)

    def restarted(self) -> Calibrator:
        """The calibrator after all targets were dropped. The calibration so far stays as a prior."""
        keep = None if self.assessment is None else self.assessment.keep
        old = self.context
        context = old if keep is None else CalibrationContext(old.priors, old.state_at, keep)
        return self._afresh(context=context)

    # Each of the following steps returns the next calibrator.

    def _only(self, alive: Collection[int]) -> Calibrator:
        """The calibrator without the tracks that ended."""
        gone = self.passes.tracks.difference(alive)
        if not gone:
            return self
        search = None if self.search is None else self.search.without(gone, self.passes.kept)
        return msgspec.structs.replace(self, search=search, passes=self.passes.only(alive))

    def _teaching(self, alive: Collection[int]) -> set[int]:
        """The tracks whose fixes are used: those known already, then the oldest others, up to MOST_TARGETS."""
        known = self.passes.tracks.intersection(alive)
        return {*known, *sorted(set(alive) - known)[: max(0, MOST_TARGETS - len(known))]}

    def _with_frames(self, frames: Frames, alive: Collection[int]) -> Calibrator:
        """The calibrator after a few frames as one batch. Attitudes that distinguish no delay contribute nothing."""
        context, found, queue, motions = self.context, self.delay_s, self.queue, [self.motion]
        fixes, since_s, sample = list[tuple[int, GroundFix]](), list[float](), list[int]()
        for each in samples_of(frames):
            own, since, queue = queue.taken(each, alive)
            if own:
                middle = own[len(own) // 2][1].sighting.state
                delay_s = context.delay_s if found is None else found
                motions.append(motions[-1].after(middle, delay_s, context.state_at, context.priors))
                sample += [len(motions) - 2] * len(own)
            fixes += own
            since_s += since
        if not fixes:
            return self
        if middle.stamp_sigma_s > DELAY_STEP_S:
            rate_hz = 1.0 / middle.spacing_s if middle.spacing_s > 0.0 else 0.0
            return msgspec.structs.replace(self, slow_attitude_hz=rate_hz)
        captures_s = np.array([s_from_ns(fix.sighting.boot_ns) for _, fix in fixes])
        batch = in_motion(context.batch(fixes, found, since_s), captures_s, motions[1:], sample)
        return msgspec.structs.replace(
            self,
            queue=queue,
            motion=motions[-1],
            slow_attitude_hz=None,
            stamp_sigma_s=middle.stamp_sigma_s,
            axes=self.axes.with_batch(middle, batch),
        )._measured(batch.nearest_to(found), {track: fix.sighting.detection.label for track, fix in fixes})

    def _measured(self, batch: MeasurementBatch, kinds: Mapping[int, str]) -> Calibrator:
        state = msgspec.structs.replace(self, passes=self.passes.with_batch(batch, kinds))
        if state.delay_s is not None:
            return state
        if not self.context.searches:
            return state._found(FoundDelay(self.context.means))
        return msgspec.structs.replace(state, search=(state.search or delay_search(self.context)).fed(batch))

    def _searched(self, steps: int) -> Calibrator:
        """The calibrator after one step of the search, or all steps between photographs; a delay begins a pass."""
        if self.search is None:
            return self
        kept, kinds = self.passes.kept, self.passes.kinds
        search = self.search.advanced(kept, steps, kinds)
        while steps > STEP and search.round and not search.complete(kept):
            search = search.advanced(kept, steps, kinds)
        match search.result(kept):
            case FoundDelay() as found:
                return self._found(found)
            case NoDelay() as no_delay:
                return self._given_up(no_delay)
            case None:
                return msgspec.structs.replace(self, search=search)

    def _given_up(self, no_delay: NoDelay) -> Calibrator:
        """The calibrator after a search without result. The next search begins after a pause."""
        if self.context.kept is not None:
            return self._begun_again()
        idle_until_ns = HostNs(self.host_ns + SEARCH_PAUSE_NS)
        return self._afresh(queue=self.queue, idle_until_ns=idle_until_ns, no_delay=no_delay)

    def _found(self, found: FoundDelay) -> Calibrator:
        passes = self.passes.begun(self.context, found.point, found.places)
        return msgspec.structs.replace(self, search=None, no_delay=None, passes=passes)

    def _passed(self, steps: int) -> Calibrator:
        passes = self.passes.advanced(self.context, steps, settled=self.is_calibrated)
        return self if passes is self.passes else msgspec.structs.replace(self, passes=passes)

    def _assessed(self) -> Calibrator:
        """The calibrator with an assessment of the served estimate."""
        served = self.passes.served
        if served is None or served is self.judged:
            return self
        if not served.fits[served.chosen]:
            return self._given_up(UNEXPLAINED)
        assessment = self._assessment_of(served)
        moved = any(each.parameter != SharedParameter.HEIGHT for each in assessment.denied)
        if self.context.kept is not None and moved:
            return self._begun_again()
        return msgspec.structs.replace(self, judged=served, present=served, assessment=assessment)

    def _assessment_of(self, estimate: FilterPass) -> Assessment:
        return assessed(
            estimate.best,
            self.context.shared_priors,
            axes=(self.axes.down, self.axes.sight),
            drift=estimate.drift,
            before=self.assessment,
            stamp_sigma_s=self.stamp_sigma_s,
            photographs=estimate.photographs,
        )

    def _begun_again(self) -> Calibrator:
        """The calibrator restarted from the configuration, because the camera was moved since it was calibrated."""
        return self._afresh(context=self.context.without_kept(), queue=self.queue, replaced=True)

    def _afresh(self, **changes: object) -> Calibrator:
        """A calibrator without any estimate, with these fields changed."""
        state = Calibrator(self.context, host_ns=self.host_ns, mount_check=self.mount_check, replaced=self.replaced)
        return msgspec.structs.replace(state, **changes)
