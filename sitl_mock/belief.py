"""The autopilot's estimate of its own state: the truth with biases, wander and noise, and the places of home and
origin.
"""

from __future__ import annotations

from math import radians
from random import Random

from sitl_mock.draws import DrawnBiases, SmoothWander, Wander, shifted, wander_time_s
from sitl_mock.earth import ArduPilotProjection, LocalProjection, Place, Px4Projection, World
from sitl_mock.flight import Flight, State
from sitl_mock.flow import Flow
from sitl_mock.gimbal import Gimbal
from sitl_mock.gyro import Gyro
from sitl_mock.options import Options
from sitl_mock.rotation import Vector, plus
from sitl_mock.surface import Surface


class Belief:
    """The autopilot's state estimate. Biases are the same in every message; noise is drawn for each message."""

    def __init__(self, options: Options, biases: DrawnBiases, flight: Flight, world: World) -> None:
        self._o, self._biases, self._flight, self.world = options, biases, flight, world
        self._attitude_errors_deg = (biases.attitude_roll_deg, biases.attitude_pitch_deg, biases.heading_deg)
        seed = options.seed
        self._gyro = Gyro(flight, options.autopilot.gyro_filter_hz, options.autopilot.gyro_sample_hz)
        self.gimbal = Gimbal(options, biases, flight)
        self._noise = Random(f"{seed}/noise")
        wander = SmoothWander if options.autopilot.position_wander == "smooth" else Wander
        self._gyro_noise = Random(f"{seed}/gyro")
        axes = ("roll", "pitch", "yaw")
        self._signs = tuple(-1.0 if axis in options.autopilot.reversed_axes else 1.0 for axis in axes)
        self._surface = Surface(options)
        self._wander = tuple(
            wander(biases.position_sigma_m, wander_time_s(options), Random(f"{seed}/wander/{axis}"))
            for axis in ("north", "east")
        )
        self._flow = Flow(flight, options.autopilot.flow_drift, seed)
        self._flow_noise = Random(f"{seed}/flow/noise")
        origin = self._reported(options.autopilot.ekf_origin_m)
        self.projection: LocalProjection = (
            Px4Projection(origin) if options.autopilot.firmware == "px4" else ArduPilotProjection(origin)
        )

    def truth(self, flight_s: float) -> State:
        """True state at an instant, without any error."""
        return self._flight.at(flight_s)

    def own_state(self, flight_s: float) -> State:
        """True state with the attitude that the autopilot believes, without its noise."""
        state, errors = self._flight.at(flight_s), self._attitude_errors_deg
        roll, pitch, yaw = (angle + radians(error) for angle, error in zip(state.euler, errors, strict=True))
        return state._replace(euler=(roll, pitch, yaw))

    def attitude(self, flight_s: float) -> tuple[Vector, Vector]:
        """Estimated (roll, pitch, yaw) and filtered body rates at an instant, rad and rad/s."""
        noise, errors = self._o.priors.attitude_noise_deg, self._attitude_errors_deg
        euler = self._flight.euler(flight_s)
        roll, pitch, yaw = (a + radians(e + self._fresh(noise)) for a, e in zip(euler, errors, strict=True))
        return self._signed((roll, pitch, yaw)), self._signed(self._rates(flight_s))

    def position(self, flight_s: float) -> tuple[Place, Vector]:
        """Estimated (place, NED velocity) at an instant, with delay, wander, bias and noise."""
        state = self._flight.at(flight_s - self._o.autopilot.position_delay_s - self._biases.position_delay_s)
        p = self._o.priors
        north, east = (error + self._fresh(p.position_noise_m) for error in self.wander(flight_s))
        down = -(self._biases.height_m + self._fresh(p.height_noise_m))
        v = p.velocity_noise_m_s
        velocity = plus(state.velocity, (self._fresh(v), self._fresh(v), self._fresh(v)))
        return self._reported(plus(state.position, (north, east, down))), velocity

    def has_flow(self, flight_s: float) -> bool:
        """Whether the autopilot measures its motion over the ground at this instant."""
        lost = any(start <= flight_s < end for start, end in self._o.autopilot.flow_lost_s)
        return self._o.autopilot.flow and not lost

    def flow_position(self, flight_s: float) -> tuple[Vector, Vector]:
        """Local (position, velocity) by optical flow at an instant: NED from the EKF's origin, metres and m/s."""
        state = self._flight.at(flight_s - self._o.autopilot.position_delay_s - self._biases.position_delay_s)
        p, origin = self._o.priors, self._o.autopilot.ekf_origin_m
        position, velocity = plus(state.position, self.flow_error(flight_s)), state.velocity
        noise = (p.position_noise_m, p.position_noise_m, p.height_noise_m)
        north, east, down = (
            each + self._flow_noise.gauss(0.0, sigma) - zero
            for each, sigma, zero in zip(position, noise, origin, strict=True)
        )
        v_north, v_east, v_down = (each + self._flow_noise.gauss(0.0, p.velocity_noise_m_s) for each in velocity)
        return (north, east, down - self._biases.height_m), (v_north, v_east, v_down)

    def flow_error(self, flight_s: float) -> Vector:
        """Local position by optical flow minus truth without noise, NED, metres."""
        by_north, by_east = shifted(self._o.autopilot.position_shifts, flight_s)
        return plus(self._flow.error(flight_s), (by_north, by_east, 0.0))

    def resets(self, flight_s: float) -> int:
        """Number of steps of the position until an instant."""
        return sum(from_s == to_s <= flight_s for from_s, to_s, _, _ in self._o.autopilot.position_shifts)

    def wander(self, flight_s: float) -> tuple[float, float]:
        """Horizontal position error at an instant without noise, for the truth file: north, east, metres."""
        by_north, by_east = shifted(self._o.autopilot.position_shifts, flight_s)
        return (self._wander[0].at(flight_s) + by_north, self._wander[1].at(flight_s) + by_east)

    def home(self, armed: bool) -> Place:
        """Home place; arming moves it to ``home_m`` on the take-off ground."""
        a = self._o.autopilot
        north, east, down = (*a.home_m, 0.0)
        if not armed:
            north, east, down = plus((north, east, down), a.home_moves_m)
        return self._reported((north, east, down))

    def has_position(self, flight_s: float) -> bool:
        """Whether the autopilot has a global position at this instant."""
        o = self._o.autopilot
        lost = any(start <= flight_s < end for start, end in o.gps_lost_s)
        return o.gps and flight_s >= o.gps_fix_at_s and not lost

    def range_m(self, flight_s: float) -> float:
        """Distance measured by a rangefinder along the body's down axis, metres."""
        state = self._flight.at(flight_s)
        cosine = state.ned_from_body[2][2]
        if cosine <= 0.05:
            return 1e3
        north, east, down = state.position
        above_m = -down - self._surface.height_m(north, east)
        return max(0.0, above_m / cosine + self._fresh(0.03))

    def _reported(self, ned: Vector) -> Place:
        """A place by the receiver's altitude above sea level."""
        return self.world.place(plus(ned, (0.0, 0.0, -self._biases.altitude_m)))

    def _rates(self, flight_s: float) -> Vector:
        sigma = radians(self._o.autopilot.gyro_noise_deg_s)
        p, q, r = self._gyro.rates(flight_s)
        if not sigma:
            return (p, q, r)
        x, y, z = (self._gyro_noise.gauss(0.0, sigma) for _ in range(3))
        return (p + x, q + y, r + z)

    def _fresh(self, sigma: float) -> float:
        """A drawn noise; by cause a noise of zero takes its draw too, so that all others stay as they are."""
        return self._noise.gauss(0.0, sigma) if sigma or self._o.noise_by_cause else 0.0

    def _signed(self, values: Vector) -> Vector:
        (roll, pitch, yaw), (x, y, z) = self._signs, values
        return (roll * x, pitch * y, yaw * z)
