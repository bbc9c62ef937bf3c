"""Faults of the vehicle, at the real daemon: a reboot in flight, and two autopilots at the start."""

from __future__ import annotations

from collections.abc import Callable
from typing import Any

import pytest
from processes import free_port
from sites import Site
from small_vehicle import Datagrams, SmallVehicle

Until = Callable[[Callable[[dict[str, Any]], bool]], dict[str, Any]]


@pytest.mark.slow
def test_an_autopilot_that_reboots_in_flight_is_followed_again(site: Site, until: Until):
    with site.service() as service, SmallVehicle(Datagrams(site.autopilot_port)) as vehicle:
        until(lambda status: status["telemetry"]["attitudes_kept"] > 40 and status["clock"]["sigma_s"])
        vehicle.reboot()
        service.wait_for("rebooted", within_s=60.0)
        after = until(
            lambda status: (
                status["telemetry"]["attitudes_kept"] > 40
                and abs(status["clock"]["host_from_autopilot_ns"] / 1e9 - vehicle.boot_s) < 0.5
            )
        )
        assert service.stop() == 0
    assert service.said.count("rebooted") == 1
    assert service.said.count("autopilot found") == 1
    assert after["internal_faults"] == 0


@pytest.mark.slow
def test_of_two_autopilots_at_the_start_none_is_adopted_until_one_is_alone(site: Site, until: Until):
    """The second is heard by a link of its own; both are named, once. Configured, ours is adopted at once."""
    second = free_port()
    with (site.folder / "fwav-companion.toml").open("a") as file:
        file.write(f'\n[[link]]\nname = "second"\nurl = "udpin://127.0.0.1:{second}"\nrole = "autopilot"\n')
    with (
        SmallVehicle(Datagrams(site.autopilot_port), system=3),
        SmallVehicle(Datagrams(second), system=7),
        site.service() as service,
    ):
        said = service.wait_for("(?i)several autopilots[^\n]*")[0]
        assert "(3, 7)" in said
        until(lambda status: status["traffic"][0]["bytes_in"] > 5000)
        assert site.status()["autopilot"] is None
        assert service.stop() == 0
    assert service.said.lower().count("several autopilots") == 1
    site.replace("system_id = 0", "system_id = 7")
    with (
        SmallVehicle(Datagrams(site.autopilot_port), system=3),
        SmallVehicle(Datagrams(second), system=7),
        site.service() as service,
    ):
        assert until(lambda status: status["autopilot"] is not None)["autopilot"]["system"] == 7
        assert service.stop() == 0
