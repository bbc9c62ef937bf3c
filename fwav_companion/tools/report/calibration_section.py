"""The section about self-calibration: camera delay and mount over time, against the truth where it is known. Pure."""

from __future__ import annotations

from collections.abc import Sequence

import msgspec

from fwav_companion.geometry.ellipses import NORMAL_95
from fwav_companion.tools.report.drawing import (
    SMALL_CHART,
    LinearAxes,
    Point,
    drawing,
    line,
    polygon,
    polyline,
    thinned,
)
from fwav_companion.tools.report.flight_data import CalibrationSample, FlightData, PlantedErrors
from fwav_companion.tools.report.page_elements import figure, key, row, section, table
from fwav_companion.types.flight_status import ParameterReport

MOST_POINTS = 300
MARGIN = 0.18
"""Empty space above and below the values of a chart, as a fraction of their range."""
STATUSES = {
    "waiting": "The flight showed too little to change delay or mount: both keep their configured values.",
    "ambiguous": "Several delays explain the measurements equally well, as with a steady beat: no value was changed.",
    "unexplained": "No delay within its prior explains the measurements: no value was changed.",
    "time": "The shaking showed the delay. Headings and ranges of this flight do not show the mount: it was kept.",
    "calibrated": "Delay and mount were both found in flight.",
}
WHAT_IS_THE_MOUNT = (
    "The mount is a rotation about the body axes. A constant error of the autopilot's roll, pitch or heading has the "
    "same effect and is part of it."
)
STATES = {"contradicts": "contradicts the configuration"}
LEAST_SHOWN_SIGMA = 1e-4
"""Sigma before the flight below which an error is not listed: it is stated as exact."""
UNITS = {" ms": "milliseconds", "°": "degrees"}
AXES = ("x (roll)", "y (pitch)", "z (yaw)")


class CalibratedQuantity(msgspec.Struct, frozen=True):
    """One estimated quantity over time."""

    name: str
    unit: str
    points: list[tuple[float, float, float]]
    """(seconds, value, half width of its 95 % interval)."""
    true: float | None

    @property
    def caption(self) -> str:
        """The final value with its uncertainty, and the truth where it is known."""
        _, value, width = self.points[-1]
        truth = "" if self.true is None else f" In truth {self.true:.2f}{self.unit}."
        return f"At the end {value:.2f}{self.unit} ± {width:.2f}{self.unit} (95 %).{truth}"


def calibration_section(flight: FlightData) -> str:
    """Charts of delay and mount; empty without self-calibration."""
    if len(flight.calibration) < 2:
        return ""
    by = ""
    if flight.calibrated_by:
        by = f" {flight.calibrated_by.capitalize()} found these values; the estimates above do not use them."
    entries = [("calibrated", "line", "estimate"), ("claim", "area", "95 % interval")]
    if flight.planted is not None:
        entries.append(("planted", "line", "the truth, unknown to the service"))
    wrong = f"No value was estimated: {flight.mistake}. " if flight.mistake else ""
    words = f"{wrong}{STATUSES.get(flight.calibration[-1].status, '')}{by} {WHAT_IS_THE_MOUNT}"
    drawn = "".join(
        figure(each.name, quantity_chart(each), each.caption) for each in quantities(flight.calibration, flight.planted)
    )
    listed = parameter_table(flight.calibration[-1].parameters)
    return section(
        "Self-calibration of the camera", words, f'{key(entries)}<div class="grid four">{drawn}</div>{listed}'
    )


def parameter_table(parameters: Sequence[ParameterReport]) -> str:
    """What the flight shows of each error that its sightings share, at its end; empty without one."""
    if not parameters:
        return ""
    rows = [
        row(
            (
                each.name,
                f"{each.estimate:+.3g}",
                f"{NORMAL_95 * each.sigma:.2g}",
                f"{NORMAL_95 * each.prior_sigma:.2g}",
                STATES.get(each.status, each.status) + (f": {each.reason}" if each.reason else ""),
            ),
            "off" if each.status == "contradicts" else "",
        )
        for each in parameters
        if each.prior_sigma > LEAST_SHOWN_SIGMA
    ]
    return table(("Error", "found", "95 % within ±", "before the flight ±", "status"), rows)


def quantities(samples: Sequence[CalibrationSample], planted: PlantedErrors | None) -> list[CalibratedQuantity]:
    """Camera delay, and mount about each body axis."""
    delay = [(each.at_s, 1e3 * each.time_offset_s, 1e3 * NORMAL_95 * each.time_offset_sigma_s) for each in samples]
    true_ms = None if planted is None else 1e3 * planted.time_offset_s
    found = [CalibratedQuantity("Camera delay", " ms", delay, true_ms)]
    for axis, name in enumerate(AXES):
        angle = [(each.at_s, each.mount_deg[axis], NORMAL_95 * each.mount_sigma_deg[axis]) for each in samples]
        true_deg = None if planted is None else planted.mount_deg[axis]
        found.append(CalibratedQuantity(f"Mount about {name}", "°", angle, true_deg))
    return found


def quantity_chart(quantity: CalibratedQuantity) -> str:
    """The value over time with its uncertainty, and the truth where it is known."""
    points = quantity.points
    x = (points[0][0], max(points[-1][0], points[0][0] + 1.0))
    axes = LinearAxes(x, _value_range(quantity), SMALL_CHART)
    upper = thinned([(t, value + width) for t, value, width in points], MOST_POINTS)
    lower = thinned([(t, value - width) for t, value, width in points], MOST_POINTS)
    parts = [polygon([axes.at(*point) for point in (*upper, *reversed(lower))], "claim")]
    parts += axes.elements("seconds", UNITS[quantity.unit])
    if quantity.true is not None:
        parts.append(line(axes.at(axes.x[0], quantity.true), axes.at(axes.x[1], quantity.true), "planted"))
    values = thinned([(t, value) for t, value, _ in points], MOST_POINTS)
    parts.append(polyline((axes.at(*point) for point in values), "variant variant-calibrated"))
    return drawing(*axes.size, parts, f"{quantity.name} over time")


def _value_range(quantity: CalibratedQuantity) -> Point:
    """Ends of the y axis: all values, the truth and the final uncertainty; earlier uncertainty may be cut off."""
    _, last, width = quantity.points[-1]
    shown = [value for _, value, _ in quantity.points] + [last - width, last + width]
    if quantity.true is not None:
        shown.append(quantity.true)
    margin = MARGIN * max(max(shown) - min(shown), 1e-3)
    return min(shown) - margin, max(shown) + margin
