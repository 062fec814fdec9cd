"""From the checked scenario to the parameters of the model; the only module that knows both.

Plain NumPy on purpose: hundreds of small JAX operations would each be compiled on their own.
"""

from __future__ import annotations

import dataclasses
from typing import Any, Literal, cast

import jax
import jax.numpy as jnp
import numpy as np
from scipy.spatial.transform import Rotation

from quietbus.dynamics.closed_loop import initial_state
from quietbus.dynamics.state import State
from quietbus.model.body import Bus, Plate
from quietbus.model.cmg import ControlMomentGyro
from quietbus.model.controller import GimbalServo, PIDController
from quietbus.model.disturbance import CHANNELS, Disturbance, Spectra, Spectrum
from quietbus.model.gimbal_motor import GimbalMotor
from quietbus.model.guidance import EigenaxisSlew, Guidance, StepGuidance
from quietbus.model.hexapod import Hexapod, LegParts
from quietbus.model.load import Constant, HalfSine, Load, Profile, Step, Table
from quietbus.model.rotor import RotorDrive, RunUp, WheelMotors
from quietbus.model.satellite import Satellite
from quietbus.model.steering import (
    GeneralizedSingularityRobust,
    PseudoInverse,
    SingularityRobust,
    Steering,
)
from quietbus.scenario import Scenario
from quietbus.scenario import control as scenario_control
from quietbus.scenario import disturbance as scenario_disturbance
from quietbus.scenario import hardware as scenario_hardware
from quietbus.scenario.wheels import Wheel, WheelCluster


def build_satellite(
    scenario: Scenario,
    mount: Literal["isolated", "rigid"] | None = None,
    first_unit: int = 0,
) -> Satellite:
    """Parameters of the model.

    Args:
        scenario: the checked scenario.
        mount: instead of the scenario's own.
        first_unit: number of the first unit where the satellite has others, on other platforms:
            random phases go by it.
    """
    if mount not in (None, "isolated", "rigid"):
        raise ValueError(f"mount must be 'isolated' or 'rigid', got {mount!r}")
    isolator, cluster = scenario.isolator, scenario.cluster
    base = _rotation(isolator.orientation)
    phases = cluster.phases(first_unit)
    placed: tuple[scenario_hardware.Unit | Wheel, ...] = cluster.placed()
    units = [_unit(unit, phase) for unit, phase in zip(placed, phases, strict=True)]
    stacked = jax.tree.map(lambda *each: _array(np.stack(each)), *units)
    satellite = Satellite(
        bus=Bus(_array(scenario.bus.mass), _array(scenario.bus.inertia)),
        plate=Plate(
            _array(isolator.plate.mass),
            _array(isolator.plate.center_of_mass),
            _array(isolator.plate.inertia),
        ),
        legs=_legs(isolator),
        cluster=dataclasses.replace(stacked, drive=_drive(cluster)),
        p_BP_B=_array(isolator.offset + base.apply([0.0, 0.0, isolator.separation])),
        q_BP=_array(_quaternion(base)),
        servo=_servo(cluster),
        guidance=_guidance(scenario),
        controller=None,
        steering=_steering(scenario.control),
        loads=tuple(_load(load) for load in scenario.loads),
        mount=mount or isolator.mount,
        disturbance=_disturbance(cluster, first_unit),
        motor=_gimbal_motor(cluster, first_unit),
    )
    if scenario.control is None:
        return satellite
    controller = _controller(scenario.control, _feedforward_inertia(scenario, satellite))
    return dataclasses.replace(satellite, controller=controller)


def build_initial_state(scenario: Scenario, satellite: Satellite) -> State:
    """State at the start of a run: plate and bus moving as one, bus mass centre at the origin."""
    return jax.jit(initial_state)(
        satellite,
        _array(_quaternion(_rotation(scenario.initial.attitude))),
        _array(scenario.initial.rate),
        _array(_gimbal_angles(scenario.cluster)),
    )


def _array(value: Any) -> jax.Array:
    return jnp.asarray(np.asarray(value, dtype=float))


def _optional(value: float | None) -> jax.Array | None:
    return None if value is None else _array(value)


def _rotation(angles: tuple[float, float, float]) -> Rotation:
    """Turn by [roll, pitch, yaw] [rad], 3-2-1 sequence."""
    return Rotation.from_euler("ZYX", angles[::-1])


def _quaternion(rotation: Rotation) -> np.ndarray:
    """Hamilton quaternion, scalar first."""
    return np.roll(rotation.as_quat(), 1)


def _legs(isolator: scenario_hardware.Isolator) -> Hexapod:
    """The legs in the bus frame."""
    legs, base = isolator.legs, _rotation(isolator.orientation)
    lower, upper = isolator.joints()
    length = np.linalg.norm(upper - lower, axis=1)

    def per_leg(value: Any) -> jax.Array:
        return _array(np.broadcast_to(value, legs.count))

    def parts(value: Any) -> LegParts:
        each = value if isinstance(value, tuple) else (value,) * legs.count
        keys = ("mass", "distance", "transverse_inertia", "axial_inertia")
        return LegParts(*(_array([getattr(part, key) for part in each]) for key in keys))

    return Hexapod(
        p_PU_P=_array(legs.upper_joints),
        p_BA_B=_array(isolator.offset + base.apply(lower)),
        k_B=_array(base.apply(legs.universal_axes)),
        stiffness=per_leg(legs.stiffness),
        damping=per_leg(legs.damping),
        free_length=per_leg(length if legs.free_length is None else legs.free_length),
        nominal_length=_array(length),
        upper=parts(legs.upper_part),
        lower=parts(legs.lower_part),
        spherical_friction=per_leg(legs.spherical_friction),
        universal_friction=per_leg(legs.universal_friction),
    )


def _servo(cluster: scenario_hardware.Cluster | WheelCluster) -> GimbalServo:
    if isinstance(cluster, WheelCluster):
        return GimbalServo(_array(0.0), None, None)  # held
    return GimbalServo(
        _array(cluster.gimbal_bandwidth),
        _optional(cluster.gimbal_rate_limit),
        _optional(cluster.gimbal_acceleration_limit),
    )


def _drive(cluster: scenario_hardware.Cluster | WheelCluster) -> RotorDrive | None:
    """What changes the rotors' speeds; None if nothing does."""
    units, run_up = cluster.placed(), None
    if cluster.run_up is not None:
        said, one = cluster.run_up, np.ones(len(units))
        initial, final = said.speeds(tuple(unit.rotor.speed for unit in units if unit.rotor))
        run_up = RunUp(
            _array(initial),
            _array(final),
            _array(said.start * one),
            _array(said.duration * one),
            said.shape,
        )
    if not isinstance(cluster, WheelCluster):
        return run_up
    motors = [wheel.motor or cluster.motor for wheel in cluster.placed()]
    return WheelMotors(
        _limits([motor.torque_limit for motor in motors]),
        _limits([motor.speed_limit for motor in motors]),
        run_up,
    )


def _limits(values: list[float | None]) -> jax.Array | None:
    """One limit for each unit; None if no unit has one."""
    if all(value is None for value in values):
        return None
    return _array([np.inf if value is None else value for value in values])


def _gimbal_angles(cluster: scenario_hardware.Cluster | WheelCluster) -> np.ndarray:
    return np.array(cluster.gimbal_angles or np.zeros(cluster.count))


def _unit(unit: scenario_hardware.Unit | Wheel, phase: float) -> ControlMomentGyro:
    """One CMG, or a wheel with its housing as a gimbal body that is held."""
    body, rotor = unit.gimbal_body, unit.rotor
    assert body is not None  # Cluster.placed fills both in
    assert rotor is not None
    g, s = np.array(unit.gimbal_axis), np.array(unit.spin_axis)
    s -= (s @ g) * g  # at right angles to the last digit
    s /= np.linalg.norm(s)
    error = rotor.installation_error
    # A_fg of eq. 3 is, to first order, the transpose of this turn about (s, t, g)
    bearing = Rotation.from_rotvec([error.chi, error.beta, error.alpha])
    return ControlMomentGyro(
        p_PC_P=_array(unit.position),
        R_PG0=_array(np.stack([s, np.cross(g, s), g], axis=1)),
        gimbal_mass=_array(body.mass),
        p_CGcm_G=_array(body.center_of_mass),
        I_GGcm_G=_array(np.diag(body.inertia)),
        rotor_mass=_array(rotor.mass),
        p_CR_G=_array(np.add(body.center_of_mass, rotor.offset)),
        R_GF=_array(bearing.as_matrix()),
        I_RRcm_R=_array(rotor.inertia),
        eccentricity=_array(rotor.static_imbalance / rotor.mass),
        rotor_speed=_array(rotor.speed),
        rotor_phase=_array(phase),
    )


def _disturbance(
    cluster: scenario_hardware.Cluster | WheelCluster, first_unit: int
) -> Disturbance | None:
    """Of all rotors, at the orders of all tables; None if no rotor has any."""
    placed: tuple[scenario_hardware.Unit | Wheel, ...] = cluster.placed()
    each = [unit.rotor.disturbance if unit.rotor else None for unit in placed]
    if not any(each):
        return None
    orders = cluster.orders
    shape = (len(each), len(orders), len(CHANNELS))
    coefficient, phase = np.zeros(shape), np.zeros(shape)
    period, damping = np.zeros((2, len(each), 3))
    place = {order: k for k, order in enumerate(orders)}
    spectra: list[Spectra] = []
    for j, own in enumerate(each):
        spectra.append(_spectra(own))
        if own is None:
            continue
        phases = own.phases(first_unit + j)
        for line, given in zip(own.orders or (), phases, strict=True):
            k = place[line.order]
            for name in scenario_disturbance.COMPONENTS:
                if getattr(line, name):
                    channel = line.channel_of(name)
                    coefficient[j, k, channel] += getattr(line, name)
                    phase[j, k, channel] = given[name]
        modes = own.resonances
        for m, mode in enumerate((modes.radial, modes.axial, modes.rocking)):
            if mode is not None:
                period[j, m], damping[j, m] = 0.5 / (np.pi * mode.frequency), mode.damping
    return Disturbance(
        order=_array(orders),
        imbalance_at=(orders.index(1), orders.index(2)),
        coefficient=_array(coefficient),
        phase=_array(phase),
        period=_array(period),
        damping=_array(damping),
        broadband=tuple(spectra),
    )


def _spectra(disturbance: scenario_disturbance.Disturbance | None) -> Spectra:
    """Spectra of one rotor by component."""
    given = disturbance.broadband.given() if disturbance else {}

    def spectrum(name: str) -> Spectrum | None:
        if name not in given:
            return None
        table = given[name]
        logarithmic = table.interpolation == "log"
        return Spectrum(_array(table.frequency), _array(table.psd), logarithmic)

    radial, axial, rocking, about = (spectrum(name) for name in scenario_disturbance.COMPONENTS)
    return radial, axial, rocking, about


def _gimbal_motor(
    cluster: scenario_hardware.Cluster | WheelCluster, first_unit: int
) -> GimbalMotor | None:
    motor = cluster.gimbal_motor
    if motor is None or isinstance(cluster, WheelCluster):
        return None
    ripple, stepping = motor.ripple or (), motor.stepping
    steps = stepping.steps_per_turn if stepping else 1
    harmonic = 1 + np.arange(stepping.harmonics if stepping else 0)
    holding = motor.holding_bandwidth
    phases = [motor.phases(seed, j) for j, seed in enumerate(cluster.seeds, first_unit)]
    return GimbalMotor(
        per_turn=_array([line.per_turn for line in ripple]),
        torque=_array([line.torque for line in ripple]),
        phase=_array([own for own, _ in phases]),
        holding=_array(0.1 * cluster.gimbal_bandwidth if holding is None else holding),
        step_per_turn=_array(harmonic * steps),
        step_turn=_array(2.0 / (harmonic * steps)),
        step_phase=_array([harmonic * own for _, own in phases]),
        step_frequency=_array(2.0 * np.pi * stepping.frequency if stepping else 1.0),
        step_damping=_array(stepping.damping if stepping else 1.0),
    )


def _controller(control: scenario_control.Control, J_B: np.ndarray) -> PIDController:
    kp, ki, kd = control.pid.kp, control.pid.ki, control.pid.kd
    return PIDController(
        kp=_array(kp),
        ki=_array(ki),
        kd=_array(kd),
        J_feedforward_B=_array(J_B if control.feedforward else np.zeros((3, 3))),
        # 1/(Ki Tt) with the tracking time Tt = sqrt(Kd/Ki)
        unwinding=_array(1.0 / np.sqrt(ki * kd) if ki * kd > 0.0 else 0.0),
        torque_limit=_optional(control.torque_limit),
    )


def _feedforward_inertia(scenario: Scenario, satellite: Satellite) -> np.ndarray:
    """Inertia [kg m^2] of the whole satellite about its mass centre, bus axes.

    Plate in its nominal pose, gimbals at their angles at the start, rotors balanced.
    """
    bodies: list[tuple[Any, Any, Any]] = []  # mass, mass centre from B, inertia about it
    satellite = jax.tree.map(np.asarray, satellite)
    B, P, legs = satellite.bus, satellite.plate, satellite.legs
    bodies.append((B.mass, np.zeros(3), B.I_BBcm_B))

    base = _rotation(scenario.isolator.orientation)
    R_BP, p_BP_B = base.as_matrix(), np.asarray(satellite.p_BP_B)
    bodies.append((P.mass, p_BP_B + R_BP @ P.p_PPcm_P, R_BP @ P.I_PPcm_P @ R_BP.T))

    upper = p_BP_B + np.asarray(legs.p_PU_P) @ R_BP.T
    lower = np.asarray(legs.p_BA_B)
    directions = (upper - lower) / np.asarray(legs.nominal_length)[:, None]
    for parts, ends, sign in ((legs.lower, lower, 1.0), (legs.upper, upper, -1.0)):
        for i, s in enumerate(directions):
            ss = np.outer(s, s)
            inertia = parts.transverse_inertia[i] * (np.eye(3) - ss) + parts.axial_inertia[i] * ss
            bodies.append((parts.mass[i], ends[i] + sign * parts.distance[i] * s, inertia))

    C = satellite.cluster
    for i, gamma in enumerate(_gimbal_angles(scenario.cluster)):
        R_PG = C.R_PG0[i] @ Rotation.from_rotvec([0.0, 0.0, gamma]).as_matrix()
        R_BG, p_BC_B = R_BP @ R_PG, p_BP_B + R_BP @ C.p_PC_P[i]
        R_BF = R_BG @ C.R_GF[i]
        I_R = np.diag(np.diag(C.I_RRcm_R[i]))
        bodies.append(
            (C.gimbal_mass[i], p_BC_B + R_BG @ C.p_CGcm_G[i], R_BG @ C.I_GGcm_G[i] @ R_BG.T)
        )
        bodies.append((C.rotor_mass[i], p_BC_B + R_BG @ C.p_CR_G[i], R_BF @ I_R @ R_BF.T))

    mass = np.array([float(m) for m, _, _ in bodies])
    p = np.array([np.asarray(r) for _, r, _ in bodies])
    r = p - mass @ p / mass.sum()
    own = np.sum([np.asarray(I) for _, _, I in bodies], axis=0)
    return own + np.eye(3) * (mass @ np.sum(r * r, axis=1)) - (mass[:, None] * r).T @ r


def _steering(control: scenario_control.Control | None) -> Steering | None:
    match control and control.steering:
        case scenario_control.PseudoInverse():
            return PseudoInverse()
        case scenario_control.SingularityRobust(lambda0=lambda0, mu=mu):
            return SingularityRobust(_array(lambda0), _array(mu))
        case scenario_control.GeneralizedSingularityRobust() as law:
            keys = ("lambda0", "mu", "epsilon0", "frequency", "phases")
            return GeneralizedSingularityRobust(*(_array(getattr(law, key)) for key in keys))
    return None


def _guidance(scenario: Scenario) -> Guidance:
    target = _rotation(scenario.target.attitude)
    guidance = scenario.target.guidance
    if guidance == "step":
        return StepGuidance(_array(_quaternion(target)))
    start = _rotation(scenario.initial.attitude)
    return EigenaxisSlew.plan(
        _quaternion(start),
        (start.inv() * target).as_rotvec(),
        max_rate=guidance.max_rate,
        max_acceleration=guidance.max_acceleration,
        max_jerk=guidance.max_jerk,
        start=guidance.start,
    )


def _load(load: scenario_control.Load) -> Load:
    vectors = (_array(load.force), _array(load.torque), _array(load.point))
    return Load(load.body, load.frame, *vectors, _profile(load.profile))


def _profile(profile: scenario_control.Profile | Literal["constant"]) -> Profile:
    if profile == "constant":
        return Constant()
    if profile.step is not None:
        end = np.inf if profile.step.end is None else profile.step.end
        return Step(_array(profile.step.start), _array(end))
    if profile.half_sine is not None:
        return HalfSine(_array(profile.half_sine.start), _array(profile.half_sine.duration))
    table = cast("scenario_control.Table", profile.table)
    return Table(_array(table.times), _array(table.values))
