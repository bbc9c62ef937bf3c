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
