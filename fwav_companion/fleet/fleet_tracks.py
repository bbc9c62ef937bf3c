"""Messages of a vehicle's tracks: each covariance is split into its own biases, possibly common errors, and noise.

PURE. The smoother knows the errors that targets share. By another filter, the position part of a track is the
difference of its covariance and that of the target relative to the vehicle, and the sensitivities to heading and
terrain are the means over the fixes, as in the track's own average.
"""

from __future__ import annotations

from collections.abc import Iterable, Mapping, Sequence
from math import degrees, isfinite, sqrt

import msgspec

from fwav_companion.fleet.options import FleetTable
from fwav_companion.fleet.payloads import (
    BIAS_NAMES,
    MAX_TRACKS,
    MAX_TRACKS_A_PART,
    LocalPlace,
    LocalTrack,
    SharedTrack,
    StateMessage,
    TracksMessage,
    VehicleBias,
    shortened,
    triangle,
)
from fwav_companion.geometry.earth import TangentPlane
from fwav_companion.geometry.rotations import euler_from_quaternion
from fwav_companion.geometry.stamps import HostNs, s_from_ns
from fwav_companion.geometry.vectors import ZERO3, Matrix3, Vector3, add_matrices, outer, scale
from fwav_companion.types import Bias, ErrorPriors, Situation, Track
from fwav_companion.types.tracks import CommonErrors

MOST_COUNTED = 300
"""Number of fixes after which the mean forgets: by then, the track's own average has long settled."""
LARGEST_SHARE = 0.9
"""Largest share of a covariance for heading or terrain: the rest is noise, which every track has."""


class MeanColumns(msgspec.Struct, gc=False):
    """Mean sensitivities of one track."""

    count: int = 0
    heading: Vector3 = (0.0, 0.0, 0.0)
    terrain: Vector3 = (0.0, 0.0, 0.0)
    level_m: float = 0.0

    def add(self, heading: Vector3, terrain: Vector3, level_m: float) -> None:
        """Add the sensitivities of a further fix to the means."""
        self.count = min(self.count + 1, MOST_COUNTED)
        share = 1.0 / self.count
        self.heading = _toward(self.heading, heading, share)
        self.terrain = _toward(self.terrain, terrain, share)
        self.level_m = level_m


class FleetTracks:
    """Makes the messages of one vehicle."""

    def __init__(self, options: FleetTable, priors: ErrorPriors, session: str) -> None:
        """``session``: random name of this run."""
        self._options, self._priors, self._session = options, priors, session
        self._columns: dict[int, MeanColumns] = {}
        self._seq = 0

    def messages(
        self,
        tracks: Iterable[Track],
        situation: Situation,
        obstacle: str | None,
        common: Mapping[int, CommonErrors] | None = None,
    ) -> tuple[TracksMessage, StateMessage] | None:
        """Tracks and state; None without UTC, a known vehicle, or a position, global or in a local world.

        ``obstacle``: why the vehicle is not ready; None if it is ready. ``common``: by the smoother, by track.
        """
        autopilot, plane = situation.autopilot, situation.plane
        if autopilot is None or situation.utc_minus_host_s is None or (plane is None and not _is_local(situation)):
            return None
        utc_s = situation.now_ns / 1e9 + situation.utc_minus_host_s
        name = self._options.vehicle or str(autopilot.system)
        believed = list(tracks)[:MAX_TRACKS]
        self._seq += 1
        if plane is None:
            local = tuple(_local_track(track, situation.now_ns) for track in believed[:MAX_TRACKS_A_PART])
            bias = VehicleBias(names=(), time_constant_s=self._priors.position_bias_time_s)
            message = TracksMessage(
                vehicle=name, time_unix=utc_s, seq=self._seq, session=self._session, bias=bias, local_tracks=local
            )
            return message, self._state(name, utc_s, situation, obstacle)
        if common:
            sigmas, shared = self._by_smoother(believed, common, plane=plane, now_ns=situation.now_ns)
        else:
            sigmas, shared = self._by_fixes(believed, plane=plane, now_ns=situation.now_ns)
        bias = VehicleBias(
            names=BIAS_NAMES,
            sigma=tuple(shortened(sigma) for sigma in sigmas),
            time_constant_s=self._priors.position_bias_time_s,
        )
        message = TracksMessage(
            vehicle=name, time_unix=utc_s, seq=self._seq, session=self._session, bias=bias, tracks=tuple(shared)
        )
        return message, self._state(name, utc_s, situation, obstacle)

    def _by_smoother(
        self, tracks: Sequence[Track], common: Mapping[int, CommonErrors], *, plane: TangentPlane, now_ns: HostNs
    ) -> tuple[tuple[float, ...], list[SharedTrack]]:
        """One sigma of the vehicle's own biases, and its tracks. A track that the smoother does not hold shares none.

        All tracks have the same errors of the vehicle. What other vehicles near it may have in common of the position's
        goes to ``cov_shared``; the column of the rest is the same.
        """
        north_m, east_m, heading = next(iter(common.values())).sigmas
        near_m = [min(self._options.gnss_shared_m, sigma_m) for sigma_m in (north_m, east_m)]
        own_m = [sqrt(sigma**2 - near**2) for sigma, near in zip((north_m, east_m), near_m, strict=True)]
        share = sqrt(LARGEST_SHARE)
        shared = []
        for track in tracks:
            by = common.get(track.id)
            north, east = (ZERO3, ZERO3) if by is None else (by.north, by.east)
            columns = [(share * n, share * e, 0.0) for n, e in zip(north, east, strict=True)]
            of_height = (0.0, 0.0) if by is None else by.height
            displaced = [scale(c, m) for c, m in zip(columns, near_m, strict=False)]
            displaced.append((share * of_height[0], share * of_height[1], 0.0))
            level_m2 = 0.0 if track.fix is None else track.fix.level_sigma_m**2
            level = min(level_m2, LARGEST_SHARE * track.cov[2][2])
            cov_shared: Matrix3 = (ZERO3, ZERO3, (0.0, 0.0, level))
            for each in displaced:
                cov_shared = add_matrices(cov_shared, outer(each, each))
            shared.append(self._shared_track(track, columns, cov_shared, plane=plane, now_ns=now_ns))
        return (*own_m, self._priors.sigma(Bias.HEIGHT), heading), shared

    def _by_fixes(
        self, tracks: Sequence[Track], *, plane: TangentPlane, now_ns: HostNs
    ) -> tuple[tuple[float, ...], list[SharedTrack]]:
        """The same by the covariances of the tracks and the sensitivities of their fixes."""
        self._learn(tracks)
        splits = [self._position_share(track) for track in tracks]
        position_m = sqrt(max((own for own, _ in splits), default=0.0))
        shared = []
        for track, (own, near) in zip(tracks, splits, strict=True):
            share = sqrt(own) / position_m if position_m > 0.0 else 0.0
            columns = [(share, 0.0, 0.0), (0.0, share, 0.0), self._heading_column(track, own + near)]
            shared.append(self._shared_track(track, columns, self._shared(track, near), plane=plane, now_ns=now_ns))
        return (position_m, position_m, self._priors.sigma(Bias.HEIGHT), self._priors.sigma(Bias.HEADING)), shared

    def _shared_track(
        self, track: Track, columns: Sequence[Vector3], cov_shared: Matrix3, *, plane: TangentPlane, now_ns: HostNs
    ) -> SharedTrack:
        """A track in the form for fusion. ``columns``: d(position)/d(bias) of position north, position east, heading.

        ``cov_shared``: covariance of what other vehicles may share, m^2.
        """
        place = plane.geodetic_from_ned(track.position_ned)
        north, east, heading = ([shortened(value) for value in column] for column in columns)
        return SharedTrack(
            track=track.id,
            label=track.label[:64],
            state=track.state.value,
            lat=place.lat_deg,
            lon=place.lon_deg,
            alt_amsl=round(place.alt_amsl_m, 3),
            cov=triangle(track.cov),
            cov_shared=triangle(cov_shared),
            bias_jacobian=(
                (north[0], east[0], 0.0, heading[0]),
                (north[1], east[1], 0.0, heading[1]),
                (0.0, 0.0, self._down_share(track), 0.0),
            ),
            vel=track.velocity_ned,
            vel_cov=None if track.velocity_cov is None else triangle(track.velocity_cov),
            last_seen_s=_seen_s(track, now_ns),
        )

    def _state(self, name: str, utc_s: float, situation: Situation, obstacle: str | None) -> StateMessage:
        vehicle, plane, autopilot = situation.vehicle, situation.plane, situation.autopilot
        state = StateMessage(
            vehicle=name,
            time_unix=utc_s,
            session=self._session,
            armed=autopilot is not None and autopilot.armed,
            ready=obstacle is None,
            trouble=(obstacle or "")[:300],
            autopilot_age_s=_age(situation.autopilot_age_s),
            frame_age_s=_age(situation.frame_age_s),
        )
        if vehicle is None or vehicle.position_ned is None:
            return state
        state = msgspec.structs.replace(
            state,
            heading_deg=round(degrees(euler_from_quaternion(vehicle.ned_from_body)[2]) % 360.0, 1),
            position_age_s=_age(s_from_ns(HostNs(situation.now_ns - situation.host_ns_of(vehicle)))),
        )
        if plane is None:
            north, east, down = (round(each, 3) for each in vehicle.position_ned)
            return msgspec.structs.replace(state, local=LocalPlace(north=north, east=east, down=down))
        place = plane.geodetic_from_ned(vehicle.position_ned)
        return msgspec.structs.replace(
            state,
            lat=place.lat_deg,
            lon=place.lon_deg,
            alt_amsl=round(place.alt_amsl_m, 2),
        )

    def _learn(self, tracks: Iterable[Track]) -> None:
        """Add the sensitivities of the newest fixes; forget tracks that ended."""
        alive = {}
        for track in tracks:
            columns = alive[track.id] = self._columns.get(track.id) or MeanColumns()
            if track.fix is not None:
                jacobian = track.fix.bias_jacobian
                columns.add(jacobian[Bias.HEADING], jacobian[Bias.TERRAIN], track.fix.level_sigma_m)
        self._columns = alive

    def _position_share(self, track: Track) -> tuple[float, float]:
        """Variance of the position's error in a track, m^2 an axis: its own part, and the part others may share."""
        cov, relative = track.cov, track.relative_cov
        position = 0.5 * (cov[0][0] + cov[1][1] - relative[0][0] - relative[1][1])
        position = min(max(position, 0.0), LARGEST_SHARE * min(cov[0][0], cov[1][1]))
        common = min(self._options.gnss_shared_m**2, position)
        return position - common, common

    def _heading_column(self, track: Track, position: float) -> Vector3:
        """d(position)/d(heading), metres a radian, limited by the covariance without the position part."""
        column = self._columns[track.id].heading
        return scale(column, _room(track.cov, position, column, self._priors.sigma(Bias.HEADING)))

    def _down_share(self, track: Track) -> float:
        sigma = self._priors.sigma(Bias.HEIGHT)
        return shortened(min(1.0, sqrt(LARGEST_SHARE * track.cov[2][2]) / sigma)) if sigma > 0.0 else 0.0

    def _shared(self, track: Track, common: float) -> Matrix3:
        """Covariance of the errors that vehicles may share: GNSS, terrain and the ground's level, m^2."""
        columns = self._columns[track.id]
        sigma = self._priors.sigma(Bias.TERRAIN)
        terrain = scale(columns.terrain, sigma * _room(track.cov, common, columns.terrain, sigma))
        level = min(columns.level_m**2, LARGEST_SHARE * track.cov[2][2])
        gnss = ((common, 0.0, 0.0), (0.0, common, 0.0), (0.0, 0.0, level))
        return add_matrices(gnss, outer(terrain, terrain))


def _is_local(situation: Situation) -> bool:
    """Whether the vehicle has a place in a local world that has none on the earth; a relative world gives it none."""
    return situation.plane is None and situation.vehicle is not None and situation.vehicle.position_ned is not None


def _local_track(track: Track, now_ns: HostNs) -> LocalTrack:
    north, east, down = (round(each, 3) for each in track.position_ned)
    return LocalTrack(
        track=track.id,
        label=track.label[:64],
        state=track.state.value,
        north=north,
        east=east,
        down=down,
        cov=triangle(track.cov),
        last_seen_s=_seen_s(track, now_ns),
    )


def _seen_s(track: Track, now_ns: HostNs) -> float:
    """Time since the last fix, seconds."""
    return round(s_from_ns(HostNs(now_ns - track.last_seen_host_ns)), 2)


def _room(cov: Matrix3, taken: float, column: Vector3, sigma: float) -> float:
    """The share of a column, at most one, that fits into a covariance after ``taken`` has been used."""
    nn, ne, ee = cov[0][0] - taken, cov[0][1], cov[1][1] - taken
    determinant = nn * ee - ne * ne
    north, east = column[0] * sigma, column[1] * sigma
    if determinant <= 0.0 or nn <= 0.0:
        return 0.0
    filled = (ee * north * north - 2.0 * ne * north * east + nn * east * east) / determinant
    return 1.0 if filled <= LARGEST_SHARE else sqrt(LARGEST_SHARE / filled)


def _age(age_s: float | None) -> float | None:
    """The age as it is sent; None for an infinite one: there was nothing yet."""
    return None if age_s is None or not isfinite(age_s) else round(max(age_s, 0.0), 2)


def _toward(mean: Vector3, value: Vector3, share: float) -> Vector3:
    return (
        mean[0] + share * (value[0] - mean[0]),
        mean[1] + share * (value[1] - mean[1]),
        mean[2] + share * (value[2] - mean[2]),
    )
