"""A detector's own track ids are weak evidence: they help where they persist, and hurt nothing where they do not."""

import numpy as np
import pytest
from draws import first_of
from handmade import a_fix, a_view
from simulated_flight import priors

from fwav_companion.tracking import TrackingOptions, make_tracker

NO_BIAS = priors(time_offset=0, heading=0, mount_x=0, mount_y=0, mount_z=0)
FPS, SECONDS = 10, 12
NOISE_M, SPEED_M_S, ACROSS_M_S = 0.35, 1.2, 0.2
MEET_S = 6.0


def walkers(t):
    """Two walkers side by side whose ways cross slowly after six seconds: for two of them places say little."""
    return np.array([[SPEED_M_S * t, ACROSS_M_S * (t - MEET_S)], [SPEED_M_S * t, -ACROSS_M_S * (t - MEET_S)]])


def own_tracker(rng, swap):
    """Ids of a detector's own tracker: two that persist, exchanged for good with a probability of ``swap`` a frame."""
    ids = [21, 22]
    while True:
        if rng.random() < swap:
            ids.reverse()
        yield tuple(ids)


def none_given(rng):
    while True:
        yield None, None


def jumping(rng):
    while True:
        yield tuple(int(number) for number in rng.integers(1000, size=2))


def repeated(rng):
    while True:
        yield 0, 0


def flown(seed, ids, motion="moving"):
    """The reported tracks of each frame."""
    rng = np.random.default_rng(seed)
    numbers = ids(np.random.default_rng(seed + 1000))
    tracker, reported = make_tracker(TrackingOptions(motion=motion), NO_BIAS), []
    for k in range(FPS * SECONDS):
        t, of_fix = k / FPS, next(numbers)
        noisy = walkers(t) + rng.normal(0.0, NOISE_M, (2, 2))
        fixes = [
            a_fix(t, (*place, 0.0), np.diag([NOISE_M**2, NOISE_M**2, 0.0]), detector_id=number)
            for place, number in zip(noisy, of_fix, strict=True)
        ]
        reported.append(tracker.on_frame(a_view(t, *(fixes if rng.random() < 0.5 else fixes[::-1]))))
    return reported


def owner(track, t):
    return int(np.argmin(np.linalg.norm(walkers(t) - np.array(track.position_ned[:2]), axis=1)))


def swaps(reported):
    """Whether the tracks that were confirmed before the walkers met are on the other walker, or gone, afterwards."""
    last = len(reported) - 1
    before, after = ({track.id: track for track in reported[k]} for k in (FPS, last))
    return sum(
        number not in after or owner(track, 1.0) != owner(after[number], last / FPS)
        for number, track in before.items()
        if track.confirmed_host_ns is not None
    )


SEEDS = range(10)


def test_crossing_walkers_swap_less_with_ids_than_without():
    without = sum(swaps(flown(seed, none_given)) for seed in SEEDS)
    faithful = sum(swaps(flown(seed, lambda rng: own_tracker(rng, 0.0))) for seed in SEEDS)
    seldom_wrong = sum(swaps(flown(seed, lambda rng: own_tracker(rng, 0.002))) for seed in SEEDS)
    assert without >= 6, "the encounter is one in which places alone fail"
    assert faithful <= without / 3
    assert seldom_wrong <= without / 2


def drawn(seed):
    """An encounter of its own: half the closing speed, the noise of places, and how far the walkers miss each other."""
    rng = np.random.default_rng(seed + 5000)
    return {"across_m_s": rng.uniform(0.1, 0.5), "noise_m": rng.uniform(0.15, 0.5), "miss_m": rng.uniform(-0.4, 0.4)}


def drawn_ways(encounter, t):
    across = encounter["across_m_s"] * (t - MEET_S)
    return np.array([[SPEED_M_S * t, across], [SPEED_M_S * t + encounter["miss_m"], -across]])


def is_swapped(seed, exchanged):
    """Whether a drawn encounter ends with a swapped or lost track. ``exchanged``: probability that the detector's
    tracker exchanges its ids within a second of it; None: no ids."""
    encounter, rng, of_ids = drawn(seed), np.random.default_rng(seed), np.random.default_rng(seed + 1000)
    exchange_s = MEET_S + of_ids.uniform(-1.0, 1.0) if of_ids.random() < (exchanged or 0.0) else np.inf
    tracker, noise_m, first = make_tracker(TrackingOptions(motion="moving"), NO_BIAS), encounter["noise_m"], {}

    def owner_of(track, t):
        off = drawn_ways(encounter, t) - np.array(track.position_ned[:2])
        return int(np.argmin(np.linalg.norm(off, axis=1)))

    for k in range(FPS * SECONDS):
        t = k / FPS
        numbers = (None, None) if exchanged is None else (21, 22) if t < exchange_s else (22, 21)
        places = drawn_ways(encounter, t) + rng.normal(0.0, noise_m, (2, 2))
        cov = np.diag([noise_m**2, noise_m**2, 0.0])
        fixes = [a_fix(t, (*at, 0.0), cov, detector_id=number) for at, number in zip(places, numbers, strict=True)]
        tracks = {track.id: track for track in tracker.on_frame(a_view(t, *fixes[:: 1 if rng.random() < 0.5 else -1]))}
        if k == 2 * FPS:
            first = {n: owner_of(track, t) for n, track in tracks.items() if track.confirmed_host_ns is not None}
    return any(n not in tracks or owner_of(tracks[n], t) != owner for n, owner in first.items())


@pytest.mark.slow
def test_ids_exchanged_at_encounters_hurt_nothing_and_those_that_persist_help():
    """Sixty encounters: with ids exchanged in every second one there are no more swaps than without ids."""
    swapped = {kind: sum(is_swapped(seed, kind) for seed in range(60)) for kind in (None, 0.0, 0.2, 0.5)}
    assert swapped[None] >= 8, "encounters in which places alone fail"
    assert swapped[0.0] <= swapped[None] / 2
    assert swapped[0.2] < swapped[None]
    assert swapped[0.5] <= swapped[None]


def trusts(frames, ids):
    """Trust in the ids of two standing tracks 0.8 m apart, after frames with these displacements and ids."""
    tracker = make_tracker(TrackingOptions(), NO_BIAS)
    for k in range(20):
        tracker.on_frame(
            a_view(k / FPS, *(a_fix(k / FPS, (4.0 + 0.8 * i, 3.0, 0.0), detector_id=10 + i) for i in (0, 1)))
        )
    found = []
    for k, (shifts, numbers) in enumerate(zip(frames, ids, strict=True), start=20):
        fixes = [
            a_fix(k / FPS, (4.0 + 0.8 * i + shift, 3.0, 0.0), detector_id=number)
            for i, (shift, number) in enumerate(zip(shifts, numbers, strict=True))
        ]
        tracker.on_frame(a_view(k / FPS, *fixes))
        found.append([(track.detector_id, track.id_trust) for track in tracker.snapshot().alive])
    return found


def test_trust_falls_where_places_contradict_and_recovers_where_they_agree():
    still, towards = (0.0, 0.0), (0.41, -0.41)  # the places are all but exchanged, and then as before
    (at_first, contradicted, later) = trusts([still, towards, still], [(10, 11)] * 3)
    assert [number for number, _ in at_first + contradicted + later] == [10, 11] * 3
    assert all(now < before for (_, before), (_, now) in zip(at_first, contradicted, strict=True))
    assert all(now > before for (_, before), (_, now) in zip(contradicted, later, strict=True))


def test_ids_exchanged_while_places_are_plain_are_adopted():
    (_, after) = trusts([(0.0, 0.0)] * 2, [(11, 10), (11, 10)])
    assert [number for number, _ in after] == [11, 10]


def alike(one, other):
    return [[(track.id, track.position_ned, track.state) for track in tracks] for tracks in one] == [
        [(track.id, track.position_ned, track.state) for track in tracks] for tracks in other
    ]


@pytest.mark.parametrize("seed", first_of(*range(6)))
@pytest.mark.parametrize("ids", [jumping, repeated])
def test_ids_that_jump_or_repeat_change_nothing(seed, ids):
    assert alike(flown(seed, ids), flown(seed, none_given))


def test_an_id_of_a_thing_far_away_is_not_believed():
    """The walkers' ids are exchanged while they are far apart: the places decide."""

    def exchanged(rng):
        for k in range(FPS * SECONDS):
            yield (21, 22) if k < 2 * FPS else (22, 21)

    assert swaps(flown(3, exchanged)[: 4 * FPS]) == 0


def test_a_new_id_after_a_miss_stays_the_same_track():
    tracker = make_tracker(TrackingOptions(), NO_BIAS)
    for k in range(60):
        fix = a_fix(k / FPS, (4.0, 3.0, 0.0), detector_id=5 if k < 30 else 6)
        tracks = tracker.on_frame(a_view(k / FPS, *([] if k in (28, 29) else [fix])))
    assert [track.id for track in tracks] == [1]
