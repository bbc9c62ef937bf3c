"""MAVSDK's gimbal plugin as a ground station: takes a gimbal, points it, and prints what the manager says.

A program of its own, as ``mavsdk_station.py``. ``python mavsdk_gimbal.py udpin://127.0.0.1:14550``
"""

import json
import sys
import time
from collections.abc import Callable

from mavsdk import ComponentType, Configuration, ConnectionResult, Mavsdk
from mavsdk.plugins.gimbal import ControlMode, Gimbal, GimbalError, GimbalMode, SendMode

PATIENCE_S = 60.0
PAUSE_S = 0.2


def say(**what: object) -> None:
    sys.stdout.write(json.dumps(what) + "\n")
    sys.stdout.flush()


def main(url: str) -> int:
    station = Mavsdk(Configuration.create_with_component_type(ComponentType.GROUND_STATION))
    if station.add_any_connection(url) is not ConnectionResult.SUCCESS:
        return 1
    say(listens=True)
    system = station.first_autopilot(PATIENCE_S)
    if system is None:
        return 2
    plugin = Gimbal(system)
    known = patiently(lambda: plugin.gimbal_list().gimbals)[0]
    number = known.gimbal_id
    say(manager=known.gimbal_manager_component_id, device=known.gimbal_device_id)
    plugin.take_control(number, ControlMode.PRIMARY)
    say(taken=patiently(lambda: plugin.get_control_status(number).sysid_primary_control))
    plugin.set_angles(number, 0.0, -40.0, 25.0, GimbalMode.YAW_FOLLOW, SendMode.ONCE)
    time.sleep(2.0)
    angles = plugin.get_attitude(number).euler_angle_forward
    say(pitch=angles.pitch_deg, yaw=angles.yaw_deg)
    plugin.release_control(number)
    say(released=patiently(lambda: plugin.get_control_status(number).sysid_primary_control == 0))
    sys.stdin.read()
    station.destroy()
    return 0


def patiently(ask: Callable[[], object]) -> object:
    """The first answer that is not empty."""
    deadline = time.monotonic() + PATIENCE_S
    while time.monotonic() < deadline:
        try:
            answer = ask()
        except GimbalError:
            answer = None
        if answer:
            return answer
        time.sleep(PAUSE_S)
    raise TimeoutError(ask)


if __name__ == "__main__":
    sys.exit(main(sys.argv[1]))
