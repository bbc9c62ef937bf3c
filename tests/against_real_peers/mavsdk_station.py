"""A ground station made of MAVSDK alone: prints every message it decodes as a line of JSON, sends commands from stdin.

A program of its own, since a native library with threads of its own is best ended with its process.
``python mavsdk_station.py udpin://127.0.0.1:14550``
"""

import json
import sys

from mavsdk import ComponentType, Configuration, ConnectionResult, Mavsdk
from mavsdk.plugins.mavlink_direct import MavlinkDirect, MavlinkDirectError, MavlinkMessage

STARTING_S = 60.0


def say(**what: object) -> None:
    sys.stdout.write(json.dumps(what) + "\n")
    sys.stdout.flush()


def main(url: str) -> int:
    station = Mavsdk(Configuration.create_with_component_type(ComponentType.GROUND_STATION))
    if station.add_any_connection(url) is not ConnectionResult.SUCCESS:
        return 1
    say(listens=True)
    system = station.first_autopilot(STARTING_S)
    if system is None:
        return 2
    direct = MavlinkDirect(system)
    direct.subscribe_message("", lambda message, _: on_message(message))
    say(system=True)
    for line in sys.stdin:
        send(direct, json.loads(line))
    station.destroy()
    return 0


def on_message(message: MavlinkMessage) -> None:
    say(name=message.message_name, component=message.component_id, fields=json.loads(message.fields_json))


def send(direct: MavlinkDirect, command: dict[str, float]) -> None:
    """Send a COMMAND_LONG and print its result."""
    message = MavlinkMessage(
        message_name="COMMAND_LONG",
        system_id=245,
        component_id=190,
        target_system_id=int(command["target_system"]),
        target_component_id=int(command["target_component"]),
        fields_json=json.dumps(command),
    )
    try:
        answer = direct.send_command(message)
    except MavlinkDirectError as error:
        say(refused=str(error))
    else:
        say(answer=json.loads(answer.fields_json))


if __name__ == "__main__":
    sys.exit(main(sys.argv[1]))
