"""The MAVLink messages that the service sends: the fields filled, the requests made, the answers to commands."""

from __future__ import annotations

from math import isnan
from typing import Any
from xml.etree import ElementTree as ET

from flights import flights
from frozen import hold
from pymavlink.dialects.v20 import ardupilotmega as dialect

NAMING = {"COMMAND_LONG": ("command", "param1"), "PARAM_REQUEST_READ": ("param_id",), "NAMED_VALUE_FLOAT": ("name",)}
"""Messages with fields that name a request, a parameter or a value."""
HEADER_OF_COMMANDS = ("command", "target_system", "target_component")


def sent() -> list[Any]:
    return [message for flight in flights() for _, message in flight.sent]


def value_facts(message: str, field: str, values: list[Any]) -> set[str]:
    """The values of an enumeration; for other fields whether they are always NaN or always 0, which means unused."""
    if all(isinstance(value, float) and isnan(value) for value in values):
        return {" = NaN"}
    if all(value == 0 for value in values):
        return {" = 0"}
    enumerations = dialect.mavlink_map[getattr(dialect, f"MAVLINK_MSG_ID_{message}")].fieldenums_by_name
    if field in enumerations and field not in HEADER_OF_COMMANDS:
        return {f" = {int(value)}" for value in values}
    return {""}


def test_the_messages_and_the_fields_that_are_filled():
    by_field: dict[tuple[int, str, str], list[Any]] = {}
    facts = set()
    for message in sent():
        facts.add(f"{message.component} {message.name} to {message.to.value}")
        for field, value in message.fields.items():
            by_field.setdefault((message.component, message.name, field), []).append(value)
    for (component, name, field), values in by_field.items():
        facts |= {f"{component} {name}.{field}{fact}" for fact in value_facts(name, field, values)}
    hold("messages", facts)


def test_the_requests_to_the_autopilot_and_the_names_of_values():
    facts = set()
    for message in sent():
        if fields := NAMING.get(message.name):
            shown = " ".join(f"{field}={message.fields[field]}" for field in fields)
            facts.add(f"{message.component} {message.name} {shown}")
    hold("requests", facts)


def test_the_answers_to_commands():
    facts = set()
    for component, number, params, answer in flights()[0].answers:
        acknowledgement, *more = answer
        assert (acknowledgement.name, acknowledgement.fields["command"]) == ("COMMAND_ACK", number)
        asked = ", ".join(f"{param:g}" for param in params)
        then = " ".join(message.name for message in more)
        facts.add(f"{component} {number}({asked}): result {acknowledgement.fields['result']} {then}".rstrip())
    hold("commands_answered", facts)


def test_cursor_on_target():
    facts = set()
    for flight in flights():
        for datagram in flight.datagrams:
            for element in ET.fromstring(datagram).iter():
                facts |= {element.tag} | {f"{element.tag}.{name}" for name in element.attrib}
    hold("cursor_on_target", facts)
