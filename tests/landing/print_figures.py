"""Prints how near the mock's copter lands: python tests/landing/print_figures.py [FLIGHTS [PROCESSES [ROW ...]]].

Each flight draws its noise, biases, start and heading; the copter follows the LANDING_TARGET of the service from first
sight to the ground (``sitl_mock/lander.py``). Next to it: what the copter does with exact angles and ranges of the same
frames. The camera's place in the vehicle is in both, since nothing in a descent shows it: the first half of the rows
draws it from its prior (3 cm an axis), in the second half it is as configured.
"""

from __future__ import annotations

import sys
from collections.abc import Mapping
from concurrent.futures import ProcessPoolExecutor
from pathlib import Path
from typing import Any, NamedTuple

sys.path[:0] = [str(Path(__file__).resolve().parents[1] / "support"), str(Path(__file__).resolve().parents[2])]

import numpy as np
from landing_flights import BESIDE_PAD, BESIDE_TAG, ON_BOAT, ON_PAD, ONE_TAG, Landing, drawn, land, land_exactly

INDOORS = ("ground.model=rangefinder",)
TO_THE_LEFT = ("camera.mount.pitch_deg=-55.0", "camera.mount.yaw_deg=-90.0")
WHERE_CONFIGURED = {"biases.lever_arm_m": (0.0, 0.0, 0.0)}
LEAST_SHARE = 0.95


class Row(NamedTuple):
    """A kind of landing and what is asked of it."""

    name: str
    scenario: str
    target: str
    asked_m: tuple[float, float]
    """Median and 90 % of the misses."""
    settings: tuple[str, ...] = ()
    changes: Mapping[str, Any] = {}


DRAWN = (
    Row("GPS, one tag of 0.2 m", "land", ONE_TAG, (0.03, 0.06)),
    Row("the same, jump of 2 m at 5 m", "land_jump", ONE_TAG, (0.03, 0.06)),
    Row("no GPS, rangefinder", "land_indoors", ONE_TAG, (0.04, 0.08), INDOORS),
    Row("no GPS, tag size alone", "land_tag_size", ONE_TAG, (0.05, 0.10)),
    Row("pad of three sizes", "land_pad", ON_PAD, (0.02, 0.04)),
    Row("2 m beside a tag of 0.2 m", "land_beside_tag", BESIDE_TAG, (0.10, 0.20), TO_THE_LEFT),
    Row("2 m beside a pad", "land_beside_pad", BESIDE_PAD, (0.05, 0.10), TO_THE_LEFT),
    Row("boat, turning", "land_boat", ON_BOAT, (0.12, 0.25)),
)
ROWS = (*DRAWN, *(row._replace(changes=WHERE_CONFIGURED) for row in DRAWN))


def flown(row: int, seed: int) -> tuple[Landing, float]:
    """A landing, and its miss with exact angles."""
    kind = ROWS[row]
    options = drawn(kind.scenario, seed, **kind.changes)
    exact = land_exactly(options)
    return land(options, kind.target, kind.settings), float("inf") if exact is None else exact.miss_m


def spread(misses_m: list[float]) -> str:
    """Median and 90 %, metres."""
    return f"{np.median(misses_m):.3f} / {np.quantile(misses_m, 0.9, method='higher'):.3f}"


def main(flights: int, processes: int, rows: list[int]) -> int:
    """Print a line a row; 1 where one misses what is asked of it."""
    print(f"miss at touchdown, median / 90 % of {flights} flights, m; needed share of frames {LEAST_SHARE:.0%}")
    print(
        f"{'landing':30}{'asked':>13}{'miss':>15}{'exact angles':>15}{'share':>8}{'worst':>8}{'squares':>9}{'worst':>7}"
    )
    failed, before = False, None
    with ProcessPoolExecutor(processes) as pool:
        for index in rows:
            row = ROWS[index]
            if row.changes != before:
                before = row.changes
                print("the camera's place as configured" if before else "the camera's place drawn from its prior")
            results = list(pool.map(flown, [index] * flights, range(1, flights + 1)))
            misses = [landing.miss_m for landing, _ in results]
            shares = [landing.sent / landing.frames if landing.frames else 0.0 for landing, _ in results]
            squares = [landing.squares for landing, _ in results]
            asked = f"{row.asked_m[0]:.2f} / {row.asked_m[1]:.2f}"
            print(
                f"{row.name:30}{asked:>13}{spread(misses):>15}{spread([each for _, each in results]):>15}"
                f"{np.mean(shares):8.1%}{min(shares):8.1%}"
                f"{np.mean(squares):9.2f}{max(squares):7.2f}",
                flush=True,
            )
            within = zip((np.median(misses), np.quantile(misses, 0.9, method="higher")), row.asked_m, strict=True)
            failed |= any(found > asked_m for found, asked_m in within) or np.mean(shares) < LEAST_SHARE
    return int(failed)


if __name__ == "__main__":
    numbers = [int(each) for each in sys.argv[1:]]
    flights, processes, *chosen = [*numbers, *(40, 2)[len(numbers) :]]
    sys.exit(main(flights, processes, chosen or list(range(len(ROWS)))))
