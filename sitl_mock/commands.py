"""Commands and rate requests: the mock acknowledges every command, unsupported ones too."""

from __future__ import annotations

from collections.abc import Callable
from math import isfinite

from sitl_mock.autopilot_options import AutopilotOptions
from sitl_mock.broadcast import Broadcast
from sitl_mock.codec import NAMES, NUMBERS, Heard
from sitl_mock.gimbal_manager import GimbalManager
from sitl_mock.radio import Radio

ACCEPTED, DENIED, UNSUPPORTED, FAILED = 0, 2, 3, 4
REBOOT, ARM, GET_INTERVAL, SET_INTERVAL, REQUEST_MESSAGE = 246, 400, 510, 511, 512
WARNING = 4
LONGEST_INTERVAL_US = 2.0**31 - 1.0
"""Longest interval that MESSAGE_INTERVAL can encode, microseconds."""


class Commands:
    """Handles COMMAND_LONG, COMMAND_INT and REQUEST_DATA_STREAM that are addressed to the autopilot."""

    def __init__(
        self,
        options: AutopilotOptions,
        broadcast: Broadcast,
        radio: Radio,
        arm: Callable[[bool, int], None],
        reboot_soon: Callable[[int], None],
        gimbal: GimbalManager | None = None,
    ) -> None:
        """``gimbal``: the gimbal manager that the autopilot is; None: it has none."""
        self._gimbal = gimbal
        self._by_message = {} if gimbal is None else gimbal.handlers()
        self._broadcast, self._radio, self._do_arm, self._reboot_soon = broadcast, radio, arm, reboot_soon
        self._states_nothing = options.answers == "ack_only"
        self._table = {
            REBOOT: self._reboot,
            ARM: self._arm,
            GET_INTERVAL: self._get_interval,
            SET_INTERVAL: self._set_interval,
            REQUEST_MESSAGE: self._request_message,
        }
        if not options.knows_set_message_interval:
            del self._table[SET_INTERVAL]

    def hear(self, heard: Heard, now_ns: int) -> None:
        """Executes a command and acknowledges it."""
        command = heard.fields["command"]
        parameters = (heard.fields["param1"], heard.fields["param2"])
        if command in self._by_message:
            result = self._by_message[command](heard, now_ns)
        elif command not in self._table:
            result = UNSUPPORTED
        elif not isfinite(parameters[0]):
            result = DENIED
        else:
            result = self._table[command](*parameters, now_ns)
        ack = {
            "command": command,
            "result": result,
            "target_system": heard.system,
            "target_component": heard.component,
        }
        self._radio.say("COMMAND_ACK", ack, now_ns)

    def data_stream(self, heard: Heard, now_ns: int) -> None:
        """Handles REQUEST_DATA_STREAM: sets a group of messages to one rate."""
        streams = self._broadcast.streams
        rate_hz = float(heard.fields["req_message_rate"]) if heard.fields["start_stop"] else 0.0
        for name, hz in streams.request_group(heard.fields["req_stream_id"], min(rate_hz, streams.ceiling_hz)).items():
            self._broadcast.set_rate(name, hz, now_ns)

    def _set_interval(self, number: float, interval_us: float, now_ns: int) -> int:
        name = NAMES.get(int(number), "")
        streams = self._broadcast.streams
        if not isfinite(interval_us):
            return DENIED
        if not self._broadcast.knows(name):
            self._radio.statustext(WARNING, f"No ap_message for mavlink id ({int(number)})", now_ns)
            return DENIED
        rate_hz: float | None = 1e6 / min(interval_us, LONGEST_INTERVAL_US) if interval_us > 0.0 else 0.0
        if interval_us == 0.0:
            rate_hz = streams.default_hz(name)
        if rate_hz is None:
            return FAILED
        if rate_hz > streams.ceiling_hz * (1.0 + 1e-9):
            return DENIED
        self._broadcast.set_rate(name, rate_hz, now_ns)
        return ACCEPTED

    def _get_interval(self, number: float, _param2: float, now_ns: int) -> int:
        name = NAMES.get(int(number), "")
        if self._states_nothing:
            return ACCEPTED
        known = self._broadcast.knows(name)
        interval_us = self._broadcast.streams.reported_interval_us(name) if known else 0
        fields = {"message_id": int(number) % 65536, "interval_us": interval_us}
        self._radio.say("MESSAGE_INTERVAL", fields, now_ns)
        return ACCEPTED

    def _request_message(self, number: float, _param2: float, now_ns: int) -> int:
        name = NAMES.get(int(number), "")
        if self._gimbal is not None and self._gimbal.request(int(number), now_ns):
            return ACCEPTED
        if not self._broadcast.knows(name):
            return UNSUPPORTED if int(number) not in NUMBERS.values() else DENIED
        return ACCEPTED if self._broadcast.send(name, now_ns) else FAILED

    def _arm(self, arm: float, _param2: float, now_ns: int) -> int:
        self._do_arm(bool(arm), now_ns)
        return ACCEPTED

    def _reboot(self, what: float, _param2: float, now_ns: int) -> int:
        if what != 1.0:
            return DENIED
        self._reboot_soon(now_ns)
        return ACCEPTED
