"""Shifts an elevation model by a landmark, and undoes the shift where that landmark is left out. Pure."""

from __future__ import annotations

from collections.abc import Sequence

from fwav_companion.localization.ground import Ground
from fwav_companion.localization.terrain_ground import TerrainGround
from fwav_companion.types import Landmark, LandmarkAltitude, LandmarkRecord, LandmarkState


class LandmarkShift:
    """Shifts the elevation model by landmarks, and keeps which landmark shifted it."""

    def __init__(self, landmarks: Sequence[Landmark]) -> None:
        self._landmarks = tuple(landmarks)
        self._by: int | None = None

    def applied(self, ground: Ground, altitude: LandmarkAltitude | None, records: Sequence[LandmarkRecord]) -> str:
        """Shift an uncertainly placed model by a landmark's altitude, or undo such a shift; the notice, or ""."""
        if not isinstance(ground, TerrainGround) or ground.shift is None or not ground.shift.sigma_m:
            return ""
        if self._by is not None and records[self._by].state is LandmarkState.LEFT_OUT:
            self._by = None
            return ground.taken_back()
        if altitude is None:
            return ""
        text = ground.shown(self._landmarks[altitude.landmark].place, altitude.too_high_m, altitude.sigma_m)
        self._by = altitude.landmark if text else self._by
        return text
