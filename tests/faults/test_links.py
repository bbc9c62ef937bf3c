"""Faults of links, made on pseudo-terminals and sockets of the real daemon: it recovers, and says so once."""

from __future__ import annotations

import os
import socket
import sys
import time
from collections.abc import Callable
from pathlib import Path
from typing import Any

import pytest
from mavlink_wire import Wire, dialect, parse
from processes import Process, free_port
from sites import Site
from small_vehicle import Datagrams, Line, SmallVehicle

Until = Callable[[Callable[[dict[str, Any]], bool]], dict[str, Any]]


def on_a_line(site: Site) -> Line:
    """A serial line, behind a name of its own, to which the daemon's autopilot link points."""
    path = site.folder / "autopilot"
    site.replace(f"udpin://127.0.0.1:{site.autopilot_port}", f"serial://{path}:57600")
    return Line(path)


def follows(status: dict[str, Any]) -> bool:
    return (
        status["autopilot"] is not None and not status["autopilot_lost"] and status["telemetry"]["attitudes_kept"] > 20
    )


@pytest.mark.slow
def test_an_adapter_that_is_unplugged_and_comes_back_as_another_device(site: Site, until: Until):
    line = on_a_line(site)
    with site.service() as service, SmallVehicle(line):
        until(follows)
        line.unplug()
        service.wait_for("link autopilot is down: ")
        service.wait_for("autopilot is silent|autopilot lost")
        line.plug()
        service.wait_for("link autopilot is up(.|\n)*link autopilot is up")
        status = until(follows)
        assert service.stop() == 0
    assert service.said.count("link autopilot is down") == 1
    assert status["internal_faults"] == 0
    assert status["telemetry"]["reboots"] == 0


def test_a_wrong_baud_rate_and_half_a_frame_for_ever_stop_nothing(site: Site, until: Until):
    """At the wrong rate bytes are noise; the half of a frame stays without the other, until whole ones come."""
    line = on_a_line(site)
    with site.service() as service:
        service.wait_for("link autopilot is up")
        for _ in range(20):
            line.write(os.urandom(500))
            time.sleep(0.01)
        half = Wire(1, 1).heartbeat()[:10]
        line.write(half)
        until(lambda status: status["traffic"][0]["bytes_in"] >= 10_000 + len(half))
        site.ground.listen(until="HEARTBEAT", count=2)
        with SmallVehicle(line):
            status = until(follows)
        assert service.stop() == 0
    assert status["traffic"][0]["skipped_bytes"] >= 9_000
    assert service.said.count("autopilot found") == 1
    assert status["internal_faults"] == 0


def test_a_station_that_is_gone_and_comes_back_from_another_port(site: Site, until: Until):
    port = free_port()
    site.replace(f"udpout://127.0.0.1:{site.ground.port}", f"udpin://127.0.0.1:{port}")
    with site.service() as service, SmallVehicle(Datagrams(site.autopilot_port)):
        until(follows)
        for _ in range(3):  # each time from another port
            with socket.socket(socket.AF_INET, socket.SOCK_DGRAM) as station:
                station.settimeout(20.0)
                station.sendto(Wire(255, 190).heartbeat(dialect.MAV_TYPE_GCS, 8), ("127.0.0.1", port))
                heard: set[tuple[int, str]] = set()
                while not {(1, "HEARTBEAT"), (191, "HEARTBEAT")} <= heard:
                    heard |= {(m.get_srcComponent(), m.get_type()) for m in parse(station.recv(65536))}
        assert service.stop() == 0
    assert "is down" not in service.said


def test_a_peer_that_reads_nothing_costs_the_others_nothing(site: Site, until: Until):
    """Its TCP window closes; heartbeats and telemetry go on to the other station."""
    port = free_port()
    with (site.folder / "fwav-companion.toml").open("a") as file:
        file.write(f'\n[[link]]\nname = "deaf"\nurl = "tcpin://127.0.0.1:{port}"\nrole = "gcs"\n')
    with site.service() as service, SmallVehicle(Datagrams(site.autopilot_port)), socket.socket() as deaf:
        until(follows)
        deaf.setsockopt(socket.SOL_SOCKET, socket.SO_RCVBUF, 2048)
        deaf.connect(("127.0.0.1", port))
        deaf.send(Wire(254, 190).heartbeat(dialect.MAV_TYPE_GCS, 8))
        wire, vehicle = Wire(1, 154), Datagrams(site.autopilot_port)
        payload = bytes(range(200))
        deadline_s = time.monotonic() + 60.0
        while until(lambda status: "deaf" in status["links"])["links"]["deaf"]["dropped"] == 0:
            assert time.monotonic() < deadline_s, "its buffer never filled"
            for _ in range(200):
                vehicle.write(wire.frame("DATA96", 1, 96, payload[:96]))
            time.sleep(0.05)
        site.ground.listen(until="HEARTBEAT", count=4)
        vehicle.write(wire.frame("DATA64", 1, 64, payload[:64]))
        site.ground.listen(until="DATA64")
        status = until(follows)
        assert service.stop() == 0
        vehicle.close()
    assert status["internal_faults"] == 0


HANGING_NAMES = """
import socket, sys, time
real = socket.getaddrinfo

def hangs(host, *rest, flags=0, **more):
    if host == "station.example" and not flags & socket.AI_NUMERICHOST:
        time.sleep(3600.0)
    return real(host, *rest, flags=flags, **more)

socket.getaddrinfo = hangs
sys.argv = ["fwav-companion", "run", "--config", "fwav-companion.toml"]
from fwav_companion.__main__ import main
sys.exit(main())
"""


def test_a_name_whose_resolution_hangs_holds_up_no_other_link_and_no_end(site: Site, until: Until):
    with (site.folder / "fwav-companion.toml").open("a") as file:
        file.write('\n[[link]]\nname = "far"\nurl = "udpout://station.example:14550"\nrole = "gcs"\n')
    service = Process("-c", HANGING_NAMES, folder=site.folder, program=(sys.executable,))
    try:
        with SmallVehicle(Datagrams(site.autopilot_port)):
            until(follows)
            site.ground.listen(until="HEARTBEAT", count=3)
            assert site.status()["links"]["far"]["state"] == "opening"
            assert service.stop(within_s=10.0) == 0
    finally:
        service.kill()


def test_folders_of_devices_need_not_exist(site: Site):
    """The link is down, said once, and tried again."""
    site.replace(f"udpin://127.0.0.1:{site.autopilot_port}", f"serial://{Path('/dev/serial/by-id/nothing')}:57600")
    with site.service() as service:
        service.wait_for("link autopilot is down: .*no such device")
        site.ground.listen(until="HEARTBEAT", count=4)
        assert service.stop() == 0
    assert service.said.count("link autopilot is down") == 1
