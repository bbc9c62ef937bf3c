"""Initiation of targets: by one sighting, and by clusters of the ground points of detections that no target explains.

Clusters are formed for mounts that are wrong by quarter turns: an image that is rotated, a camera that is turned round.
The hypothesis that explains most detections with the fewest clusters is used.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from fwav_companion.estimation.array_rotations import rotation_and_jacobian
from fwav_companion.estimation.errors import CAMERA_DELAY, READOUT, Array, Bools, Ints
from fwav_companion.estimation.frame_linearisation import linearise
from fwav_companion.estimation.kept_sightings import Sightings
from fwav_companion.estimation.live_filter import LiveFilter
from fwav_companion.estimation.measurement import Poses, feet, project
from fwav_companion.estimation.path_samples import Carrier
from fwav_companion.estimation.problem import Model, attitude_shift, error_processes, in_solution
from fwav_companion.estimation.smoother import common_noise
from fwav_companion.estimation.wander import SMOOTH

LEAST_FRAMES = 4  # of a cluster that is a target
_GATE2 = 9.0  # squared distance of a ground point from its cluster, by the covariance of both
_CLUSTER_COST = 3.0  # detections that one more cluster must explain
_TURN_COST = 6.0  # detections by which a turned mount must explain more than the configured one
_MOST_CLUSTERS = 64
_CURVED = 2  # unknowns of the delay's displacements beyond its derivative
_SEARCHED_S, _SEARCHED_SIGMAS, _REACH_SIGMAS = 0.08, 8.0, 2.5  # of the delay's first search
_LEAST_DETERMINANT = 1e-9  # of the derivative by a place: a smaller one has no inverse
QUARTER_TURNS_RAD = tuple(np.pi / 2 * k for k in range(4))


def filter_before_solves(model: Model, carrier: Carrier, t: float) -> LiveFilter:
    """The live filter by the priors alone, without targets.

    The delay may be as far off as the first search will look: else its sightings of one target would not meet.
    """
    wanders = in_solution(error_processes(model, carrier, SMOOTH), carrier, t)
    level, up = (float(w.covariance(np.zeros(1))[0]) for w in wanders)
    mean = np.concatenate([model.priors.mean, np.zeros(_CURVED + 3)])
    sigma = model.priors.sigma.copy()
    if not model.consider:
        reach = min(_SEARCHED_S, _SEARCHED_SIGMAS * float(sigma[CAMERA_DELAY]))
        sigma[CAMERA_DELAY] = max(float(sigma[CAMERA_DELAY]), reach / _REACH_SIGMAS)
    variance = np.concatenate([sigma**2, np.ones(_CURVED), [level, level, up]])
    return LiveFilter(model, carrier, wanders, t, mean, np.diag(variance), np.zeros(0, np.int64), curved=_CURVED)


def begin_target(live: LiveFilter, target: int, s: Sightings, *, moving: bool) -> bool:
    """Begin a target from one sighting (N = 1) at the present calibration; False where its ray has no foot.

    The place is the ground point; its error is that of the detection and of all that the base state does not know.
    """
    model, one, error = live.model, np.zeros(1, np.int64), live.mean[live.error :, None]
    poses, prior = live.poses.of(s, one), model.target(target)
    place = poses.position[:2]
    for _ in range(2):
        ground = float(model.ground.height(place)[0][0])
        place, meets = feet(poses, s.rays, live.mean[: live.size], error, ground + prior.height_m)
    if not meets[0]:
        return False
    ground_height, slope = model.ground.height(place)
    point = np.append(place[:, 0], ground_height + prior.height_m)[:, None]
    found, h = linearise(live, s, one, point)
    own = found.point[..., 0].copy()
    own[:, :2] += found.point[:, 2:, 0] * slope[:, 0]
    if not found.visible[0] or abs(np.linalg.det(own[:, :2])) < _LEAST_DETERMINANT:
        return False
    g = common_noise(found, model.noise, s.own_noise)[..., 0]
    noise = g @ g.T + np.eye(2)
    if s.own_noise is not None:
        moved = found.point[..., 0] * s.own_noise[[1, 1, 2], 0]
        noise += moved @ moved.T
    mean = np.array([point[0, 0], point[1, 0], prior.height_m])
    variance = prior.precision()[2] ** -1.0
    live.others.begin(target, mean, own, h[..., 0], live.covariance, noise, variance, moving=moving)
    live.version += 1
    return True


@dataclass(frozen=True)
class Cluster:
    """Detections of one target to be."""

    place: Array  # (2,) m north, east
    covariance: Array  # (2, 2) m^2
    members: Ints  # indices of the sightings


@dataclass(frozen=True)
class Clustering:
    """Clusters under one hypothesis of the mount."""

    clusters: tuple[Cluster, ...]
    turn: Array  # (3,) rad, rotation vector by which the configured mount is wrong; zero: it is right
    score: float  # explained detections, each by how well it fits, minus the costs
    places: Array  # (2, N) m ground points of all detections
    meets: Bools  # (N,) which rays meet the ground


def quarter_turns(camera_axis: Array) -> list[Array]:
    """Rotation vectors (3,) in carrier axes of mounts that are often confused with the configured one.

    camera_axis: (3,) the optical axis. Turns of 90, 180 and 270 degrees about it (a rotated image), and of 90, 180 and
    270 degrees about each carrier axis (a camera that looks elsewhere).
    """
    found = [np.zeros(3)]
    for axis in (camera_axis, *np.eye(3)):
        for angle in QUARTER_TURNS_RAD[1:]:
            v = axis * angle
            matrix = rotation_and_jacobian(v)[0]
            if all(np.abs(matrix - rotation_and_jacobian(w)[0]).max() > 1e-6 for w in found):
                found.append(v)
    return found


def sight_poses(carrier: Carrier, s: Sightings, shared: Array) -> Poses:
    """Poses (N) of sightings at the shared parameters (S,): those of all turns of the mount."""
    instants, shift = s.t - shared[CAMERA_DELAY] - s.row * shared[READOUT], attitude_shift(shared)
    return carrier.poses(instants, carrier.live_rates(instants, shift), shift)


def cluster(
    model: Model, poses: Poses, s: Sightings, shared: Array, covariance: Array, error: Array,
    turn: Array | None = None, *, wander_m: float = 0.0, beats: float = -np.inf,
) -> Clustering:  # fmt: skip
    """Clusters of sightings (N) at the shared parameters (S,) with their covariance (S, S), and the error (3,).

    wander_m: one sigma of the error's change between two sightings, of sightings that are long apart. beats: a score;
    the clustering ends without clusters where its own cannot be greater.
    """
    turn = np.zeros(3) if turn is None else turn
    back = rotation_and_jacobian(-turn)[0]
    rays = back @ s.rays
    tangents = np.einsum("ian,ba->ibn", s.tangents, back)
    ground = float(model.ground.height(poses.position[:2, :1])[0][0])
    place, meets = feet(poses, rays, shared, error[:, None], ground)
    spread = _foot_covariances(model, poses, rays, tangents, shared, covariance, place, ground, error, s)
    spread[[0, 1], [0, 1]] += 0.5 * wander_m**2
    best = float(meets.sum()) - (_TURN_COST if turn.any() else 0.0)
    # Each cluster costs a detection at least: that of a small one is not explained.
    clusters = _greedy(place, spread, meets, s.frame, min(float(_MOST_CLUSTERS), best - beats))
    explained = sum(_fit(c, place, spread) for c in clusters)
    score = explained - _CLUSTER_COST * len(clusters) - (_TURN_COST if turn.any() else 0.0)
    return Clustering(tuple(clusters), turn, score, place, meets)


def _foot_covariances(
    model: Model, poses: Poses, rays: Array, tangents: Array, shared: Array, covariance: Array, place: Array,
    ground: float, error: Array, s: Sightings,
) -> Array:  # fmt: skip
    """Covariances (2, 2, N) of ground points: the detection's noise, the frame's, and the shared parameters'."""
    point = np.concatenate([place, np.full((1, place.shape[1]), ground)])
    found = project(poses, rays, tangents, shared, point, error[:, None], s.row)
    g = common_noise(found, model.noise, s.own_noise)
    known = np.tensordot(covariance, found.shared, (1, 1)).swapaxes(0, 1)  # (2, S, N)
    noise = np.einsum("ian,jan->ijn", g, g) + np.einsum("ian,jan->ijn", found.shared, known)
    noise[0, 0] += 1.0
    noise[1, 1] += 1.0
    j = found.point[:, :2].transpose(2, 0, 1)  # (N, 2, 2)
    regular = np.abs(np.linalg.det(j)) > 1e-9
    inverse = np.zeros_like(j)
    inverse[regular] = np.linalg.inv(j[regular])
    out = np.einsum("nij,jkn,nlk->iln", inverse, noise, inverse)
    out[0, 0, ~regular] = out[1, 1, ~regular] = 1e6
    return np.asarray(out)


def _greedy(place: Array, spread: Array, meets: Bools, frame: Ints, below: float) -> list[Cluster]:
    """Each ground point, in order of time, joins the nearest cluster in its gate that its frame has not used.

    Plain floats: a point has few clusters about it. below: number of clusters at which it ends with none.
    """
    members: list[list[int]] = []
    means: list[list[float]] = []  # north, east; covariance of one ground point: nn, ne, ee
    last_frame: list[int] = []
    points = np.stack([*place, spread[0, 0], spread[0, 1], spread[1, 1]], -1).tolist()
    for i in np.flatnonzero(meets).tolist():
        best, best2, now, (north, east, nn, ne, ee) = -1, _GATE2, int(frame[i]), points[i]
        for c, (n, e, nn_c, ne_c, ee_c) in enumerate(means):
            if last_frame[c] == now:
                continue
            u, v, a, b, d = north - n, east - e, nn + nn_c, ne + ne_c, ee + ee_c
            distance2 = (u * u * d - 2.0 * u * v * b + v * v * a) / (a * d - b * b)
            if distance2 < best2:
                best, best2 = c, distance2
        if best < 0:
            members.append([i])
            means.append(points[i])
            last_frame.append(now)
            if len(means) >= below:
                return []
            continue
        members[best].append(i)
        # The shared errors do not average out: the mean moves, its covariance is that of one ground point.
        share = 1.0 / len(members[best])
        means[best] = [m + (x - m) * share for m, x in zip(means[best], points[i], strict=True)]
        last_frame[best] = now
    return [
        Cluster(np.array([n, e]), np.array([[nn, ne], [ne, ee]]), np.array(which, np.int64))
        for (n, e, nn, ne, ee), which in zip(means, members, strict=True)
        if len(np.unique(frame[which])) >= LEAST_FRAMES
    ]


def _fit(c: Cluster, place: Array, spread: Array) -> float:
    """Number of a cluster's detections, each by how well it fits: 1 at the cluster's place, 0 at its gate.

    Gates are as wide as what is not known, and most of that is common to a cluster's detections: wrong hypotheses pass
    them, too, but scatter more.
    """
    off = (place[:, c.members] - c.place[:, None]).T  # (M, 2)
    both = spread[..., c.members].transpose(2, 0, 1) + c.covariance  # (M, 2, 2)
    distance2 = np.einsum("mi,mi->m", off, np.linalg.solve(both, off[..., None])[..., 0])
    return float((1.0 - distance2 / _GATE2).clip(0.0).sum())
