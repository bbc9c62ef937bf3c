"""The parameter protocol: read, list, set."""

from __future__ import annotations

from functools import partial
from math import isfinite
from typing import Any

from sitl_mock.agenda import Agenda
from sitl_mock.autopilot_options import AutopilotOptions
from sitl_mock.codec import Heard
from sitl_mock.radio import Radio

INT32, REAL32 = 6, 9
PRECLAND_DEFAULTS: dict[str, float] = {
    "PLND_STRICT": 1,
    "PLND_RET_MAX": 4,
    "PLND_XY_DIST_MAX": 2.5,
    "PLND_ALT_MIN": 0.75,
    "PLND_ALT_MAX": 8.0,
}
"""What AC_PrecLand does without a target, by ArduPilot's defaults."""


class Parameters:
    """Values by parameter name. A set value is stored and reported, but not applied: an autopilot applies it at its
    next reboot.
    """

    def __init__(self, options: AutopilotOptions, agenda: Agenda, radio: Radio, more: dict[str, float]) -> None:
        """``more``: parameters in addition to the usual ones."""
        self._agenda, self._radio = agenda, radio
        self._listing_ns = round(options.parameter_interval_s * 1e9)
        self.values = {**_values(options), **more}

    def read(self, heard: Heard, now_ns: int) -> None:
        """PARAM_REQUEST_READ by name, or by index where that is not negative."""
        names = list(self.values)
        index = heard.fields["param_index"]
        if 0 <= index < len(names):
            self._send_value(names[index], now_ns)
        elif index < 0 and heard.fields["param_id"] in self.values:
            self._send_value(heard.fields["param_id"], now_ns)

    def list(self, _heard: Heard, now_ns: int) -> None:
        """PARAM_REQUEST_LIST: sends all parameters, paced."""
        for number, name in enumerate(self.values):
            self._agenda.at(now_ns + number * self._listing_ns, partial(self._send_value, name))

    def set(self, heard: Heard, now_ns: int) -> None:
        """PARAM_SET: changes a known parameter and sends its new value."""
        name, value = heard.fields["param_id"], heard.fields["param_value"]
        if name in self.values and isfinite(value):
            self.values[name] = value
            self._send_value(name, now_ns)

    def _send_value(self, name: str, at_ns: int) -> None:
        value = self.values[name]
        fields: dict[str, Any] = {
            "param_id": name.encode(),
            "param_value": float(value),
            "param_type": INT32 if isinstance(value, int) else REAL32,
            "param_count": len(self.values),
            "param_index": list(self.values).index(name),
        }
        self._radio.say("PARAM_VALUE", fields, at_ns)


def _values(o: AutopilotOptions) -> dict[str, float]:
    if o.firmware == "px4":
        return {"SYS_AUTOSTART": 4001, "IMU_GYRO_CUTOFF": float(o.gyro_filter_hz), "MAV_SYS_ID": o.system_id}
    return {
        "SYSID_THISMAV": o.system_id,
        "SCHED_LOOP_RATE": int(o.loop_rate_hz),
        "INS_GYRO_FILTER": float(o.gyro_filter_hz),
        "PTCH_TRIM_DEG": float(o.pitch_trim_deg),
        "FLIGHT_OPTIONS": o.flight_options,
        "PLND_ENABLED": int(o.precland_enabled),
        "PLND_TYPE": 1,
        "PLND_LAG": float(o.precland_lag_s),
        "PLND_YAW_ALIGN": float(o.precland_yaw_align_cdeg),
        "PLND_ORIENT": o.precland_orient,
        **{f"PLND_CAM_POS_{axis}": float(m) for axis, m in zip("XYZ", o.precland_camera_m, strict=True)},
        **{f"PLND_LAND_OFS_{axis}": float(cm) for axis, cm in zip("XY", o.precland_offset_cm, strict=True)},
        **PRECLAND_DEFAULTS,
        **o.precland_parameters,
        "RNGFND1_TYPE": int(o.rangefinder),
    }
