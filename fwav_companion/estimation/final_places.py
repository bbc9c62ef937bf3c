"""Static targets by a solve over the sightings of a whole flight."""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from fwav_companion.estimation.ground import TARGET_SIZE
from fwav_companion.estimation.solve import SolveTask
from fwav_companion.types.tracks import FinalPlace


def final_places(task: SolveTask) -> dict[int, FinalPlace]:
    """The places by target; none where the solve fails.

    The task's sightings are those of the whole flight, its start is the flight's last solve.
    """
    try:
        found = replace(task, whole_flight=True).run()
    except np.linalg.LinAlgError:
        return {}
    if not found.is_finite:
        return {}
    places = {}
    for i, target in enumerate(found.ids.tolist()):
        at = len(task.model.priors) + TARGET_SIZE * i
        north, east = found.mean[at : at + 2].tolist()
        (nn, ne), (_, ee) = found.covariance[at : at + 2, at : at + 2].tolist()
        places[target] = FinalPlace(north, east, ((nn, ne), (ne, ee)), int((task.kept.target == target).sum()))
    return places
