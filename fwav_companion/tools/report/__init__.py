"""The report of a flight: ``report.html`` and ``compare.html`` as self-contained pages. Pure: lines in, HTML out.

Reading order: ``flight_data`` gathers a replay's lines into :class:`FlightData` (``series_builder`` and
``series_matching`` decide which track is which target), ``page`` orders the sections, and each ``*_section`` draws one.
"""

from fwav_companion.tools.report.calibration_section import calibration_section
from fwav_companion.tools.report.comparison import comparison
from fwav_companion.tools.report.diagnostics import diagnostics
from fwav_companion.tools.report.flight_data import CameraPicture, FlightData, PlantedErrors, flight_data
from fwav_companion.tools.report.landing_record import RecordedMessages
from fwav_companion.tools.report.page import SecondFlight, page
from fwav_companion.tools.report.summary_section import SecondResult
from fwav_companion.tools.report.target_series import ReplayedLines
from fwav_companion.tools.report.tracking_variants import (
    CALIBRATED,
    PAPER,
    PLAIN,
    VARIANTS,
    TrackingVariant,
    variant_of,
)
from fwav_companion.tools.report.true_vehicle_path import TrueVehiclePath
from fwav_companion.tools.report.variants_section import variants_section

__all__ = [
    "CALIBRATED",
    "PAPER",
    "PLAIN",
    "VARIANTS",
    "CameraPicture",
    "FlightData",
    "PlantedErrors",
    "RecordedMessages",
    "ReplayedLines",
    "SecondFlight",
    "SecondResult",
    "TrackingVariant",
    "TrueVehiclePath",
    "calibration_section",
    "comparison",
    "diagnostics",
    "flight_data",
    "page",
    "variant_of",
    "variants_section",
]
