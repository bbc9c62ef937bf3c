"""An error of our own affects only its own part: neither later messages nor the next due work."""

from __future__ import annotations

from collections.abc import Sequence
from types import SimpleNamespace

import pytest

from fwav_companion.geometry.stamps import NS_PER_S, HostNs
from fwav_companion.mavlink.router.node import LinkPolicy, Node
from fwav_companion.mavlink.wire.codec import decode
from fwav_companion.mavlink.wire.scanner import Scanner
from fwav_companion.service.daemon import Service
from fwav_companion.service.journal import Journal
from fwav_companion.service.network import Outbox
from fwav_companion.service.timer import FALLBACK_INTERVAL_NS, PipelineTimer
from fwav_companion.types import Destination, Notice, NoticeCode, Outgoing, Severity

NOW = HostNs(5 * NS_PER_S)


class Wire:
    """A link that records what is sent."""

    def __init__(self) -> None:
        self.sent = b""

    def send(self, data: bytes, *, origin: object = None) -> None:
        assert origin is None, "it would wait behind forwarded frames"
        self.sent += data


def value(name: str, number: object) -> Outgoing:
    fields = {"time_boot_ms": 1, "name": name, "value": number}
    return Outgoing(name="NAMED_VALUE_FLOAT", fields=fields, to=Destination.EVERYONE, component=191)


def sent_of(messages: Sequence[Outgoing]) -> tuple[list[str], list[str]]:
    """(names sent, faults reported)."""
    wire, faults = Wire(), []
    node = Node([LinkPolicy("ground", "gcs")], wanted=())
    journal = Journal(None, clock=None)
    Outbox(node, {"ground": wire}, None, journal, lambda what, _: faults.append(what)).send(messages, (), NOW)
    return [decode(frame).fields.name for frame in Scanner(datagrams=True).feed(wire.sent)], faults


def test_what_cannot_be_encoded_takes_nothing_with_it():
    left, faults = sent_of([value("before", 1.0), value("broken", "no number"), value("after", 2.0)])
    assert left == ["before", "after"]
    assert faults == ["NAMED_VALUE_FLOAT was not sent"]


def test_after_a_mistake_in_silence_what_is_due_is_tried_again_soon(service: Service, monkeypatch: pytest.MonkeyPatch):
    """The timer event that met the error had passed, and nothing else would have set the timer before the next board
    report.

    It is not tried again at once either: that would never end.
    """
    service._parts.pipeline.advance(NOW)
    now, rings = HostNs(NOW + 2 * NS_PER_S), []
    monkeypatch.setattr(service._parts.clock, "now", lambda: now)
    service._dispatcher._alarm = PipelineTimer(
        service._dispatcher.on_alarm, lambda when_s, ring: rings.append((when_s, ring))
    )
    monkeypatch.setattr(service._parts.pipeline, "advance", lambda _: 1 / 0)
    for _ in range(3):
        with pytest.raises(ZeroDivisionError) as fault:
            service._dispatcher.on_alarm() if not rings else rings.pop()[1]()
        service._dispatcher.on_internal_fault(None, {"message": "as the event loop has it", "exception": fault.value})
        assert [when_s for when_s, _ in rings] == [(now + FALLBACK_INTERVAL_NS) / NS_PER_S]
        now = HostNs(now + FALLBACK_INTERVAL_NS)


def test_a_fault_at_the_end_keeps_nothing_from_being_closed(service: Service, monkeypatch: pytest.MonkeyPatch):
    closed: list[float] = []
    monkeypatch.setattr(service._parts.pipeline, "finish", lambda _: 1 / 0)
    monkeypatch.setattr(service._parts.calibrations, "close", closed.append)
    service._close()
    assert len(closed) == 1
    assert service._parts.log.faults == 1


def test_a_restart_of_tracking_replaces_the_vision_process(service: Service, monkeypatch: pytest.MonkeyPatch):
    restarts: list[str] = []
    service._dispatcher.camera.vision = SimpleNamespace(restart=lambda: restarts.append("vision"))
    monkeypatch.setattr(service._dispatcher, "_arm", lambda _: None)
    notice = Notice(NoticeCode.STARTED_ANEW, Severity.ERROR, "tracking starts anew", to_ground=True)
    service._dispatcher.report([notice], NOW)
    assert restarts == ["vision"]


def test_a_fault_that_every_message_repeats_is_one_line_a_second(
    service: Service, monkeypatch: pytest.MonkeyPatch, caplog: pytest.LogCaptureFixture
):
    now_s = 100.0
    monkeypatch.setattr("fwav_companion.service.fault_log.time.monotonic", lambda: now_s)
    for step in range(30):
        now_s = 100.0 + step / 10
        service._parts.log.faulted({"message": "again", "exception": ZeroDivisionError()})
    assert [record.getMessage().split(":")[0] for record in caplog.records] == [
        "internal fault 1", "internal fault 11", "internal fault 21"
    ]  # fmt: skip
    assert service._parts.log.faults == 30
