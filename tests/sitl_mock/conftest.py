"""A minimal companion, driven in simulated time, that records the messages it receives."""

import pytest

from sitl_mock import scenario, simulate
from sitl_mock.codec import NUMBERS, Heard, Listener, Speaker

SECOND = 1_000_000_000


class Companion:
    """Sends the given messages at the given instants; keeps (host_ns, Heard) of every received message."""

    def __init__(self, name="perfect", **differences):
        self.flight = simulate(scenario(name).but({"seconds": 5.0, **differences}))
        self.speaker = Speaker(1, 191)
        self.listener = Listener()
        self.heard: list[tuple[int, Heard]] = []
        self.frames = []
        self.truths = []
        self._to_send = []

    def at(self, seconds, name, **fields):
        self._to_send.append((self.flight.start_host_ns + round(seconds * SECOND), name, fields))
        return self

    def command(self, seconds, number, *parameters, target=(1, 1)):
        values = {f"param{i + 1}": float(p) for i, p in enumerate((*parameters, *[0.0] * 7)[:7])}
        system, component = target
        return self.at(
            seconds,
            "COMMAND_LONG",
            target_system=system,
            target_component=component,
            command=number,
            confirmation=0,
            **values,
        )

    def ask_rate(self, seconds, name, rate_hz):
        return self.command(seconds, 511, NUMBERS[name], 1e6 / rate_hz)

    @property
    def wake_at(self):
        return min((at for at, _, _ in self._to_send), default=None)

    def on_wake(self, now):
        due = [one for one in self._to_send if one[0] <= now]
        self._to_send = [one for one in self._to_send if one[0] > now]
        return [self.speaker.frame(name, fields) for _, name, fields in due]

    def on_bytes(self, data, now):
        self.heard.extend((now, heard) for heard in self.listener.feed(data))
        return []

    def on_frame(self, frame, now):
        self.frames.append((now, frame))
        return []

    def fly(self):
        for now, what in self.flight.drive(self):
            if not isinstance(what, (bytes, dict)):
                self.truths.append((now, what))
        return self

    def of(self, name, system=1):
        return [heard.fields for _, heard in self.heard if heard.name == name and heard.system == system]

    def times_of(self, name, system=1):
        return [now for now, heard in self.heard if heard.name == name and heard.system == system]


@pytest.fixture
def companion():
    """The class itself: each test makes its own flight."""
    return Companion
