"""A small simulated autopilot that receives rate requests: it grants, refuses, forgets and reports wrongly, in invented
time.
"""

from collections import namedtuple

from pymavlink.dialects.v20 import ardupilotmega as mavlink

from fwav_companion.mavlink.client.rates import MESSAGE_IDS, Rates
from fwav_companion.mavlink.client.subscriptions import default_subscriptions
from fwav_companion.types import Autopilot, AutopilotKind, Message

MS, S = 10**6, 10**9
T0 = 9_000 * S
STEP = 2 * MS
Ack = namedtuple("Ack", "command result progress result_param2 target_system target_component")
Param = namedtuple("Param", "param_id param_value param_type param_count param_index")
Empty = namedtuple("Empty", "")
Interval = namedtuple("Interval", "message_id interval_us")
NAMES = {number: name for name, number in MESSAGE_IDS.items()}
STREAM_MEMBERS = {10: {"ATTITUDE"}, 6: {"GLOBAL_POSITION_INT", "LOCAL_POSITION_NED"}, 2: {"GPS_RAW_INT"}}


def autopilot(kind=AutopilotKind.ARDUPILOT):
    return Autopilot(system=1, component=1, kind=kind, vehicle_type=16, armed=False, link="fc")


class Peer:
    """The autopilot: intervals by message, a rate limit, refusals, and an answer two milliseconds later."""

    def __init__(self, rates, kind=AutopilotKind.ARDUPILOT):
        self.rates, self.kind = rates, kind
        self.ceiling_hz, self.gives_hz = 1000.0, 1000.0
        self.denied, self.result = set(), None
        self.intervals_ns, self.next_ns = {}, {}
        self.parameters = {"SCHED_LOOP_RATE": 400.0}
        self.defaults_hz = {}
        """Messages sent by default; a message that is missing here has no default to be reset to."""
        self.states_rates, self.hears, self.knows_intervals = True, True, True
        self.groups = STREAM_MEMBERS
        self.stated_us = {}
        """Intervals that it states falsely, by message."""
        self.sent, self.asked, self.replies = [], [], []
        self.acknowledges, self.now = True, T0

    def start(self):
        self.send_defaults()
        self.rates.adopt(autopilot(self.kind), self.now)
        return self

    def run(self, seconds):
        end = self.now + round(seconds * S)
        while self.now < end:
            self.now += STEP
            for name in list(self.intervals_ns):
                while self.next_ns[name] <= self.now:
                    self.next_ns[name] += self.intervals_ns[name]
                    self.deliver(Message(name, 1, 1, "fc", Empty()))
            due, self.replies = self.replies, []
            for message in due:
                self.deliver(message)
            while self.rates.wake_at is not None and self.rates.wake_at <= self.now:
                for out in self.rates.on_wake(self.now):
                    self.take(out)
        return self

    def deliver(self, message):
        self.rates.on_message(message, self.now)

    def send_defaults(self):
        for name, hz in self.defaults_hz.items():
            if name not in self.intervals_ns and hz:
                self.set_rate(name, hz)

    def take(self, out):
        self.sent.append((self.now, out))
        if not self.hears:
            return
        fields = out.fields
        if out.name == "COMMAND_LONG" and fields["command"] == mavlink.MAV_CMD_GET_MESSAGE_INTERVAL:
            self.tell_interval(int(fields["param1"]))
        elif self.is_set_interval(out) and fields["param2"] <= 0.0:
            self.reset(NAMES.get(int(fields["param1"]), ""), fields["param2"])
        elif self.is_set_interval(out) and int(fields["param1"]) in NAMES and self.knows_intervals:
            name, interval_us = NAMES[int(fields["param1"])], fields["param2"]
            self.asked.append((name, 1e6 / interval_us))
            result = self.result if self.result is not None else self.grant(name, interval_us)
            if self.acknowledges:
                self.replies.append(Message("COMMAND_ACK", 1, 1, "fc", Ack(511, result, 0, 0, 1, 191)))
        elif out.name == "REQUEST_DATA_STREAM":
            for name in self.groups.get(fields["req_stream_id"], ()):
                self.set_rate(name, fields["req_message_rate"])
        elif out.name == "PARAM_REQUEST_READ" and fields["param_id"] in self.parameters:
            value = self.parameters[fields["param_id"]]
            self.replies.append(Message("PARAM_VALUE", 1, 1, "fc", Param(fields["param_id"], value, 9, 900, 0)))

    def is_set_interval(self, out):
        return out.name == "COMMAND_LONG" and out.fields["command"] == mavlink.MAV_CMD_SET_MESSAGE_INTERVAL

    def tell_interval(self, number):
        """Report an interval; for a stopped stream ArduPilot sends -1 and PX4 0."""
        interval_ns = self.intervals_ns.get(NAMES[number])
        stopped = 0 if self.kind is AutopilotKind.PX4 else -1
        truth = interval_ns // 1000 if interval_ns else stopped
        reply = Interval(number, self.stated_us.get(NAMES[number], truth))
        if self.acknowledges:
            if self.states_rates:
                self.replies.append(Message("MESSAGE_INTERVAL", 1, 1, "fc", reply))
            self.replies.append(Message("COMMAND_ACK", 1, 1, "fc", Ack(510, 0, 0, 0, 1, 191)))

    def reset(self, name, interval_us):
        """Set a stop or the default, which not every message has."""
        hz = 0.0 if interval_us < 0.0 else self.defaults_hz.get(name)
        if hz is not None:
            self.intervals_ns.pop(name, None)
            if hz:
                self.set_rate(name, hz)
        if self.acknowledges:
            result = mavlink.MAV_RESULT_FAILED if hz is None else mavlink.MAV_RESULT_ACCEPTED
            self.replies.append(Message("COMMAND_ACK", 1, 1, "fc", Ack(511, result, 0, 0, 1, 191)))

    def grant(self, name, interval_us):
        if name in self.denied:
            return mavlink.MAV_RESULT_DENIED
        if 1e6 / interval_us > self.ceiling_hz * (1 + 1e-9):
            return mavlink.MAV_RESULT_FAILED
        self.set_rate(name, 1e6 / interval_us)
        return mavlink.MAV_RESULT_ACCEPTED

    def set_rate(self, name, hz):
        self.intervals_ns[name] = round(S / min(hz, self.gives_hz))
        self.next_ns[name] = self.now + self.intervals_ns[name]

    def gcs_requests_streams(self, hz=4.0):
        for name in ("ATTITUDE", "ATTITUDE_QUATERNION", "GLOBAL_POSITION_INT"):
            if name in self.intervals_ns:
                self.set_rate(name, hz)

    def reboot(self):
        self.intervals_ns.clear()
        self.replies.clear()
        self.send_defaults()

    def asks_for(self, name):
        return [hz for asked, hz in self.asked if asked == name]


def peer(attitude_message="auto", kind=AutopilotKind.ARDUPILOT, attitude_hz=100):
    wanted = default_subscriptions(attitude_hz, 10)
    return Peer(Rates(wanted, attitude_message=attitude_message), kind)


def status(them, name):
    return them.rates.status()[name]
