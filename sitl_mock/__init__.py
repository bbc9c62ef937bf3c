"""Mock autopilot, camera and world: an independent check of everything that the companion computes.

It never imports the companion, and the companion never imports it. Geometry, flight, lens, clocks and consumers are
its own implementations.

In simulated time, without sockets, as fast as it can be computed::

    from sitl_mock import FrameTruth, VehicleTruth, scenario, simulate

    options = scenario("late_camera").but({"seed": 3, "seconds": 30.0, "biases.mount_deg": (0.0, 0.0, 0.0)})
    flight = simulate(options)
    for host_ns, what in flight:                    # in order of arrival
        if isinstance(what, bytes):                 # MAVLink from the autopilot (usually one whole frame)
            for reply in companion.on_bytes(what, host_ns):
                flight.on_bytes(reply, host_ns)     # TIMESYNC, rate requests, LANDING_TARGET: answers are later events
        elif isinstance(what, dict):                # detections of one frame, by the contract's section 5
            companion.on_frame(what, host_ns)
        elif isinstance(what, FrameTruth):          # just before its frame: the target of each detection
            ...
        elif isinstance(what, VehicleTruth):        # at options.truth_hz, 0 by default
            ...

``drive`` runs a companion with timers, each at its own instant (``Peer``: ``wake_at``, and ``on_wake``, ``on_bytes``,
``on_frame``, which return the bytes to send)::

    for host_ns, what in flight.drive(peer):
        ...

Available afterwards, or at any instant::

    flight.biases                                   # drawn errors: mount_deg, time_offset_s, heading_deg, ...
    flight.state_at(host_ns)                        # position NED, velocity, euler, body rates: exact
    flight.clock.boot_ns(host_ns)                   # the autopilot's boot clock
    flight.world.place(ned), flight.world.ned(place)  # NED about the take-off-ground origin (options.origin)
    flight.scene[0].at(flight.flight_s(host_ns))    # position of a target in that NED
    flight.surface.height_m(north, east)            # height of the ground above the take-off ground in that NED
    flight.vehicle.precland.accepted, .refused      # results of LANDING_TARGET
    flight.vehicle.belief.home(armed=True), flight.vehicle.belief.projection.origin

``scenario("perfect")`` has neither noise nor bias; ``unbiased`` has noise only. ``autopilot.rates_hz`` starts streams
without a request: ``{"ATTITUDE_QUATERNION": 100.0, "GLOBAL_POSITION_INT": 10.0}``.

Live, as a separate process: ``sitl-mock --connect udpout:127.0.0.1:14540 --detections 127.0.0.1:14601 --seconds 20``.
"""

from sitl_mock.autopilot_options import AutopilotOptions
from sitl_mock.camera import FrameTruth
from sitl_mock.options import (
    Biases,
    CameraOptions,
    FlightOptions,
    Options,
    OthersOptions,
    Priors,
    WireOptions,
)
from sitl_mock.scenarios import SCENARIOS, scenario
from sitl_mock.simulate import Event, Peer, Simulation, VehicleTruth, simulate
from sitl_mock.target_options import TargetOptions
from sitl_mock.vehicle import MockVehicle

__all__ = [
    "SCENARIOS",
    "AutopilotOptions",
    "Biases",
    "CameraOptions",
    "Event",
    "FlightOptions",
    "FrameTruth",
    "MockVehicle",
    "Options",
    "OthersOptions",
    "Peer",
    "Priors",
    "Simulation",
    "TargetOptions",
    "VehicleTruth",
    "WireOptions",
    "scenario",
    "simulate",
]
