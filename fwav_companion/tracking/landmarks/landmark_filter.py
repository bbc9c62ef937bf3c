"""The estimate of the errors that all targets share, by sights of landmarks.

A sight is a fix of a known place: measured minus known is ``H s + noise`` with the shared errors s (``state_vector``).
The survey of each landmark is among them, so that many sights do not average its error away. A landmark that all else
contradicts is left out: its prior is taken back, which is exact for a linear filter, and undoes what it had moved.

Immutable. A frame gives the next state twice: at its instant, and after its sights. Each has the steps that the places
of the targets take with it.
"""

from __future__ import annotations

from collections.abc import Sequence
from math import hypot, sqrt
from typing import TypeAlias

import msgspec
import numpy as np
from msgspec.structs import replace

from fwav_companion.geometry.stamps import NS_PER_S, HostNs, s_from_ns
from fwav_companion.geometry.vectors import scale
from fwav_companion.self_calibration.arrays import Array
from fwav_companion.tracking.filters.linearization import SENSITIVE, level_columns
from fwav_companion.tracking.filters.standing import FRESH_SHARE
from fwav_companion.tracking.landmarks.joint_place import Correction, Transition
from fwav_companion.tracking.landmarks.state_vector import ALTITUDE_SHARE, SharedErrors
from fwav_companion.tracking.landmarks.turned_fix import rotation_error, turned_point
from fwav_companion.tracking.landmarks.view_line import Sequel, continued
from fwav_companion.types import Bias, FrameView, LandmarkAltitude, LandmarkRecord, LandmarkSight, LandmarkState

GATE = 25.0
"""Squared Mahalanobis distance of a sight beyond which it is not used: a right one exceeds it once in 300 000."""
IN_A_ROW = 5
"""Refused sights in a row after which the landmark, and not the detector, is in doubt."""
LEFT_OUT = 30.0
"""Squared Mahalanobis distance of a landmark from where all else shows it, beyond which it is left out: it is examined
once a second, and a right one exceeds this once in three million."""
DOUBTED = 16.3
"""The same distance beyond which it is left out when it stays there, and all others are clearly nearer: a right one
exceeds it once in a thousand. Of three, one that is off by 0.4 m seldom reaches it: 0 of 12 flights of 45 s."""
DOUBTED_TIMES = 10
"""Examinations in a row."""
CLEAR = 9.0
"""Landmarks whose distances differ by less contradict one another, and the flight does not show which is wrong."""
ALL_LEFT_OUT = 2.0 * LEFT_OUT
"""The same distance where the flight does not show which of several is wrong: later sights may."""
UNKNOWN_M = 100.0
"""One sigma of the place of a landmark that is left out: hardly any information, and no loss by rounding."""
EXAMINED_EVERY_NS = NS_PER_S
SENSITIVITY_SHARE = 0.25
"""Relative error of the sensitivities to the biases, one sigma, as for targets. What sights show by small differences
of sensitivities has the noise of the telemetry in it, and what the first sights showed was about wrong rotations: with
0.05 and 0.1 targets were claimed to 0.12 m and off by 0.2 m after 45 s, at mean squares of 3.2 and 2.7."""
SENSITIVITY_STEP_S = 6.0
"""Twice the correlation time of that error, as for targets."""
LEAST_HEIGHT_M = 0.3
"""Least height above a landmark at which sensitivities are taken, metres."""
FIRST_S = 1e9
"""Interval before a first sight: it repeats no telemetry."""

Step: TypeAlias = Transition | Correction


class PreparedSight(msgspec.Struct, frozen=True, gc=False):
    """A sight, ready to be used."""

    sequel: Sequel
    correction: Correction
    nis: float
    """Normalised innovation squared, two degrees of freedom."""


class LandmarkFilter(msgspec.Struct, frozen=True):
    """Mean and covariance of the shared errors, and what each landmark showed."""

    model: SharedErrors
    mean: Array
    cov: Array
    sigma_m: float
    """One sigma of the vehicle's position by its receiver, metres an axis."""
    records: tuple[LandmarkRecord, ...]
    sequels: tuple[Sequel | None, ...]
    host_ns: HostNs | None = None
    examined_ns: HostNs = HostNs(0)
    doubted: tuple[int, int] = (-1, 0)
    """The landmark beyond DOUBTED, and the number of examinations in a row that found it there."""
    steps: tuple[Step, ...] = ()
    """The newest steps, in order, for the places of the targets."""

    @property
    def shows(self) -> bool:
        """Whether any landmark was seen and is used."""
        return any(record.state is LandmarkState.USED for record in self.records)

    @property
    def altitude(self) -> LandmarkAltitude | None:
        """The vehicle's altitude by sights of the landmark that was used most; None before :data:`IN_A_ROW` of them.

        The prior is taken back, with its information: an altitude above sea level may be worse than twice the place.
        """
        used = max(range(len(self.records)), key=lambda i: self.records[i].used * self._is_used(i))
        if not self._is_used(used) or self.records[used].used < IN_A_ROW:
            return None
        index, prior = self.model.altitude, (ALTITUDE_SHARE * self.sigma_m) ** 2
        variance = float(self.cov[index, index])
        if not variance < prior:
            return None
        shown = 1.0 / (1.0 / variance - 1.0 / prior)
        sigma_m = hypot(sqrt(shown), self.model.landmarks[used].sigma_m)
        return LandmarkAltitude(used, float(self.mean[index]) * shown / variance, sigma_m)

    def _is_used(self, landmark: int) -> bool:
        return self.records[landmark].state is LandmarkState.USED

    @property
    def shared(self) -> tuple[Array, Array]:
        """Mean and covariance of the shared errors."""
        return self.mean, self.cov

    def predicted(self, view: FrameView) -> LandmarkFilter:
        """The state at the instant of a frame."""
        state = replace(self, steps=())
        fixes = (*view.fixes, *(sight.fix for sight in view.landmarks))
        if fixes:
            state = state._by_receiver(self.model.sigma_at(fixes[0]))
        if self.host_ns is None or view.host_ns <= self.host_ns:
            return replace(state, host_ns=self.host_ns or view.host_ns)
        state = state._later(view.host_ns)
        return state.position_jumped(view.jumped_m**2) if view.jumped_m else state

    def seen(self, sights: Sequence[LandmarkSight]) -> LandmarkFilter:
        """The state after the sights of this instant, at most one of each landmark."""
        state = replace(self, steps=())
        for sight in sights:
            if state.records[sight.landmark].state is not LandmarkState.LEFT_OUT:
                state = state._with_sight(sight)
        now_ns = self.host_ns or HostNs(0)
        if sights and now_ns - state.examined_ns >= EXAMINED_EVERY_NS:
            state = replace(state._examined(), examined_ns=now_ns)
        return state

    def position_jumped(self, variance: float) -> LandmarkFilter:
        """The state with the vehicle's position free to have moved by ``variance``, m^2 an axis."""
        first, last = self.model.wander.start, self.model.wander.stop
        count = (last - first) // 4
        cov = self.cov.copy()
        errors = np.arange(first, last, 2)
        cov[errors, errors] += variance / count
        return replace(self, cov=cov)

    # Time.

    def _later(self, host_ns: HostNs) -> LandmarkFilter:
        model, wander = self.model, self.model.wander
        step = model.transition(self.host_ns or host_ns, host_ns)
        matrix = np.eye(model.size)
        matrix[wander, wander] = step
        stationary = np.diag(model.stationary(self.sigma_m))
        cov = matrix @ self.cov @ matrix.T
        cov[wander, wander] += stationary - step @ stationary @ step.T
        steps = (*self.steps, Transition(matrix))
        return replace(self, mean=matrix @ self.mean, cov=cov, host_ns=host_ns, steps=steps)

    def _by_receiver(self, sigma_m: float) -> LandmarkFilter:
        """The state by a receiver of another accuracy: a better one has errors of its own, a worse one's grow."""
        if sigma_m == self.sigma_m:
            return self
        if not sigma_m <= FRESH_SHARE * self.sigma_m and self.host_ns is not None:
            return replace(self, sigma_m=sigma_m)
        keep = np.ones(self.model.size)
        keep[self.model.altitude : self.model.wander.stop] = 0.0
        matrix = np.diag(keep)
        prior = np.diag((1.0 - keep) * np.diag(self.model.prior(sigma_m)))
        return replace(
            self,
            mean=matrix @ self.mean,
            cov=matrix @ self.cov @ matrix + prior,
            sigma_m=sigma_m,
            steps=(*self.steps, Transition(matrix)),
        )

    # Sights.

    def _with_sight(self, sight: LandmarkSight) -> LandmarkFilter:
        landmark, prepared = sight.landmark, self._prepared(sight)
        sequel, correction, record = prepared.sequel, prepared.correction, self.records[landmark]
        if prepared.nis <= GATE:
            after = replace(record, state=LandmarkState.USED, used=record.used + 1)
            return self._corrected(correction)._recorded(landmark, after, replace(sequel, in_a_row=0))
        off_m = hypot(*map(float, correction.innovation))
        record = replace(record, refused=record.refused + 1, off_m=off_m)
        if sequel.in_a_row + 1 < IN_A_ROW:
            return self._recorded(landmark, record, replace(sequel, in_a_row=sequel.in_a_row + 1))
        state = self._recorded(landmark, record, replace(sequel, in_a_row=0))
        if record.used >= IN_A_ROW:  # what agreed has not moved: the vehicle's position has
            return replace(state.position_jumped(off_m**2), records=state._with(landmark, replace(record, used=0)))
        used = replace(record, state=LandmarkState.USED)
        examined = state._corrected(correction)._recorded(landmark, used, sequel)._examined()
        decided = any(
            now.state is not before.state
            for now, before in zip(examined.records, state.records, strict=True)
            if before.state is LandmarkState.USED or now.state is LandmarkState.LEFT_OUT
        )
        return examined if decided else state

    def _prepared(self, sight: LandmarkSight) -> PreparedSight:
        """The sight with its sensitivities, taken where the landmark appears without the noise of this sight.

        The height is the estimated one: the altitude above sea level may be wrong by a sixth of it, and every
        sensitivity with it.
        """
        fix, errors, model = sight.fix, self.model.errors, self.model
        before, host_ns = self.sequels[sight.landmark], fix.sighting.frame_host_ns
        since_s = FIRST_S if before is None else max(s_from_ns(host_ns - before.smooth.at_ns), 1e-3)
        (camera_n, camera_e, camera_d), fix_d = fix.sighting.camera_ned, fix.position_ned[2]
        too_high, reported_m = self._too_high(), fix_d - camera_d
        lift_m = float(too_high @ self.mean)
        turn = scale(rotation_error(model, fix, self.mean), -1.0)
        seen_n, seen_e = turned_point(fix, turn, reported_m - lift_m)
        off_n, off_e = seen_n - sight.north_m, seen_e - sight.east_m
        vector = (seen_n - camera_n, seen_e - camera_e, reported_m)
        sequel, (north_m, east_m, down_m) = continued(before, vector, host_ns)
        toward, height_m = (north_m, east_m), max(down_m - lift_m, LEAST_HEIGHT_M)
        columns = level_columns(fix, *toward, height_m)
        measurement = errors.with_columns(errors.decorrelated(fix, since_s), columns)
        rows = model.rows(measurement, fix)
        model.with_heading(rows, toward)
        by_height, survey = np.array(columns[SENSITIVE.index(Bias.HEIGHT)]), model.survey(sight.landmark)
        rows[:, model.altitude] = by_height
        rows[0, survey.start] = rows[1, survey.start + 1] = 1.0
        rows[:, survey.start + 2] = by_height
        share2 = SENSITIVITY_SHARE**2 + float(too_high @ self.cov @ too_high) / height_m**2
        turning = rows[:, model.biases]
        noise = np.array(measurement.noise)[:2, :2]
        noise = noise + share2 * max(1.0, SENSITIVITY_STEP_S / since_s) * turning @ turning.T
        crossed = rows @ self.cov
        inverse = np.linalg.inv(crossed @ rows.T + noise)
        taken_out = np.outer(by_height, too_high)
        innovation = np.array((off_n, off_e)) + model.turning(rows, self.mean) - (rows - taken_out) @ self.mean
        correction = Correction(rows, crossed, inverse, innovation)
        return PreparedSight(sequel, correction, float(innovation @ inverse @ innovation))

    def _too_high(self) -> Array:
        """(size) d(height of the camera above a landmark)/d(shared errors)."""
        row = np.zeros(self.model.size)
        row[self.model.altitude] = 1.0
        if self.model.height is not None:
            row[self.model.height] = self.model.height_sigma_m
        return row

    # Steps.

    def _corrected(self, correction: Correction) -> LandmarkFilter:
        """The state after an update that leaves the considered biases as they are, in Joseph's form."""
        gain = self.model.estimated[:, None] * (correction.crossed.T @ correction.inverse)
        moved = gain @ correction.crossed
        cov = self.cov - moved - moved.T + gain @ np.linalg.inv(correction.inverse) @ gain.T
        return replace(
            self,
            mean=self.mean + gain @ correction.innovation,
            cov=0.5 * (cov + cov.T),
            steps=(*self.steps, correction),
        )

    def _with(self, landmark: int, record: LandmarkRecord) -> tuple[LandmarkRecord, ...]:
        return (*self.records[:landmark], record, *self.records[landmark + 1 :])

    def _recorded(self, landmark: int, record: LandmarkRecord, sequel: Sequel | None) -> LandmarkFilter:
        sequels = (*self.sequels[:landmark], sequel, *self.sequels[landmark + 1 :])
        return replace(self, records=self._with(landmark, record), sequels=sequels)

    # Landmarks that disagree.

    def _examined(self) -> LandmarkFilter:
        """The state without the landmark that all else contradicts the most; without all that it contradicts alike."""
        used = [i for i, record in enumerate(self.records) if record.state is LandmarkState.USED]
        released = {i: self._released(i) for i in used}
        distances = {i: released[i]._distance2(i) for i in used}
        worst = max(distances.values(), default=0.0)
        wrong = [i for i in used if distances[i] > worst - CLEAR]
        state = self._doubting(wrong, worst)
        stays = state.doubted[1] >= DOUBTED_TIMES
        if worst <= (LEFT_OUT if len(wrong) == 1 else ALL_LEFT_OUT) and not stays:
            return state
        for i in wrong:
            state = state._released(i)
            record = replace(
                state.records[i], state=LandmarkState.LEFT_OUT, off_m=hypot(*map(float, released[i]._off(i)))
            )
            state = replace(state, records=state._with(i, record))
        return state

    def _doubting(self, wrong: Sequence[int], worst: float) -> LandmarkFilter:
        """The state with one more examination that found the same single landmark beyond DOUBTED, or without any."""
        if len(wrong) != 1 or worst <= DOUBTED:
            return replace(self, doubted=(-1, 0))
        landmark, times = self.doubted
        return replace(self, doubted=(wrong[0], times + 1 if landmark == wrong[0] else 1))

    def _released(self, landmark: int) -> LandmarkFilter:
        """The state without the claim of one landmark: its place is as good as unknown.

        The prior is taken back by an update with a negative variance.
        """
        rows = np.zeros((3, self.model.size))
        rows[:, self.model.survey(landmark)] = np.eye(3)
        claimed = self.model.landmarks[landmark].sigma_m ** 2
        negative = -claimed * UNKNOWN_M**2 / (UNKNOWN_M**2 - claimed)
        crossed = rows @ self.cov
        inverse = np.asarray(np.linalg.inv(crossed @ rows.T + negative * np.eye(3)))
        return self._corrected(Correction(rows, crossed, inverse, -rows @ self.mean))

    def _off(self, landmark: int) -> Array:
        """(3) where the sights show a landmark whose claim is taken back, minus its known place, metres."""
        return -self.mean[self.model.survey(landmark)]

    def _distance2(self, landmark: int) -> float:
        """Squared Mahalanobis distance between the two."""
        survey = self.model.survey(landmark)
        cov = self.cov[survey, survey] + self.model.landmarks[landmark].sigma_m ** 2 * np.eye(3)
        off = self._off(landmark)
        return float(off @ np.linalg.solve(cov, off))


def landmark_filter(model: SharedErrors) -> LandmarkFilter:
    """The state before the first frame."""
    return LandmarkFilter(
        model=model,
        mean=np.zeros(model.size),
        cov=model.prior(model.position_sigma_m),
        sigma_m=model.position_sigma_m,
        records=tuple(LandmarkRecord(landmark.label) for landmark in model.landmarks),
        sequels=(None,) * len(model.landmarks),
    )
