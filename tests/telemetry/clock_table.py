"""Prints what the clock makes of drawn sequences of each kind, and what PX4's and mavros' filter makes of the same.

``least``: what no estimator of one-way arrivals can beat, in the mean over draws (``one_way_optimum``).
Run from the folder of the project: ``python tests/telemetry/clock_table.py [DRAWS] [WORD]``.
"""

import sys

from clock_draws import KINDS
from clock_rows import tabulated

HEAD = (
    f"{'kind':24} {'steady':>7} {'99 %':>7} {'claim':>7} {'share':>6} {'>3 s':>7} {'start':>6} {'healed':>6} "
    f"{'half':>6} {'beyond':>6} {'least':>6} {'PX4':>8}"
)


def main(draws: int = 100, word: str = "") -> None:
    print(HEAD)
    print(
        f"{'':24} {'ms':>7} {'ms':>7} {'ms':>7} {'':>6} {'%':>7} {'s':>6} {'s':>6} "
        f"{'ms':>6} {'ms':>6} {'ms':>6} {'ms':>8}"
    )
    for name in (name for name in KINDS if word in name):
        row, flights = tabulated(name, draws)
        news = sorted({repr(one) for flown in flights for one in flown.news})
        print(
            f"{name:24} {row.steady_ms:7.2f} {row.p99_ms:7.2f} {row.sigma_ms:7.2f} {row.bare_share:6.2f} "
            f"{100 * row.outside_share:7.3f} {row.start_s:6.2f} {row.healed_s:6.2f} {row.half_ms:6.2f} "
            f"{row.beyond_ms:6.2f} {row.least_ms:6.2f} {row.published_ms:8.2f}  {len(news)} {news[:2] if news else ''}",
            flush=True,
        )


if __name__ == "__main__":
    main(*(int(word) if word.isdigit() else word for word in sys.argv[1:]))  # type: ignore[arg-type]
