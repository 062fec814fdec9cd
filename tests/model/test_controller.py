"""PID control with its limits, and the gimbal servo."""

import equinox as eqx
import jax
import jax.numpy as jnp
import numpy as np
import pytest
from scipy.spatial.transform import Rotation

from quietbus.build import build_initial_state, build_satellite
from quietbus.dynamics.closed_loop import decide
from quietbus.model.controller import Measured, PIDController
from quietbus.model.gimbals import GimbalServos
from quietbus.scenario import load_scenario
from quietbus.spatial.rotation import rotation_vector_to_quaternion

KP, KI, KD = 200.0, 10.0, 500.0
UNWINDING = 1.0 / np.sqrt(KI * KD)


def controller(torque_limit=None, unwinding=UNWINDING, J=None):
    limit = jnp.asarray(np.inf if torque_limit is None else torque_limit)
    J = jnp.zeros((3, 3)) if J is None else J
    return PIDController(*map(jnp.asarray, (KP, KI, KD)), J, jnp.asarray(unwinding), limit)


def test_torque_is_minus_pid_plus_inertia_times_reference_acceleration():
    rng = np.random.default_rng(0)
    e, q, w, dw = rng.normal(size=(4, 3))
    J = rng.normal(size=(3, 3))
    expected = -(KP * e + KI * q + KD * w) + J @ dw
    found = controller(J=J).torque_B(Measured(e, w, dw), q)
    np.testing.assert_allclose(found, expected, rtol=1e-12)


@pytest.fixture(scope="module")
def signals_of():
    """Control signals of the built-in satellite for an attitude, rate and target attitude."""
    scenario = load_scenario("zhang2012")
    satellite = build_satellite(scenario)
    state = build_initial_state(scenario, satellite)
    signals = eqx.filter_jit(decide)

    def at(turn, rate=(0.0, 0.0, 0.0), target=(1.0, 0.0, 0.0, 0.0), sign=1.0):
        aimed = eqx.tree_at(lambda s: s.control.guidance.q_NR, satellite, jnp.asarray(target))
        q_NB = sign * rotation_vector_to_quaternion(jnp.asarray(turn))
        moved = eqx.tree_at(lambda s: (s.bus.q_NX, s.bus.w_NX_X), state, (q_NB, jnp.asarray(rate)))
        return signals(aimed, jnp.zeros(()), moved)

    return at


@pytest.mark.parametrize("sign", [-1.0, 1.0])
@pytest.mark.parametrize("angle", [-3.0, -0.2, 0.2, 3.0, 3.3, 6.0])
def test_torque_drives_the_bus_back_the_short_way(signals_of, angle, sign):
    """-2 Kp sin(angle / 2), for both quaternions of one attitude; past half a turn, forward."""
    axis = np.array([0.6, -0.48, 0.64])
    torque = signals_of(angle * axis, sign=sign).torque_B
    left = angle if abs(angle) < np.pi else angle - 2.0 * np.pi
    np.testing.assert_allclose(torque, -2.0 * 200.0 * np.sin(left / 2.0) * axis, atol=1e-10)


def test_torque_brakes_the_rate_in_the_bus_frame(signals_of):
    turn, rate = jnp.array([0.3, 1.2, -0.7]), jnp.array([0.01, -0.02, 0.03])
    on_target = rotation_vector_to_quaternion(turn)
    torque = signals_of(turn, rate, target=on_target).torque_B
    np.testing.assert_allclose(torque, -2500.0 * rate, atol=1e-10)


def test_torque_follows_a_slew_in_the_bus_frame():
    """Rate error and feedforward, with a bus far off the turning reference."""
    scenario = load_scenario("zhang2012-slew").with_overrides({"control.torque_limit": None})
    satellite = build_satellite(scenario)
    state = build_initial_state(scenario, satellite)
    J = np.array([[900.0, 20.0, -10.0], [20.0, 1000.0, 30.0], [-10.0, 30.0, 1100.0]])
    where = lambda s: s.control.controller.J_feedforward_B  # noqa: E731
    satellite = eqx.tree_at(where, satellite, jnp.asarray(J))
    guidance = satellite.control.guidance
    t = jnp.float64(guidance.start[0] + 0.5 * guidance.duration[0])
    reference = guidance.reference(t)
    assert np.linalg.norm(reference.w_NR_R) > 1e-6
    assert np.linalg.norm(reference.dw_NR_R) > 1e-6

    turn, w = Rotation.from_rotvec([0.7, -0.4, 1.1]), np.array([0.01, 0.03, -0.02])
    R_NB = Rotation.from_quat(np.roll(reference.q_NR, -1)) * turn
    q_NB = jnp.asarray(np.roll(R_NB.as_quat(), 1))
    state = eqx.tree_at(lambda s: (s.bus.q_NX, s.bus.w_NX_X), state, (q_NB, jnp.asarray(w)))
    found = eqx.filter_jit(decide)(satellite, t, state).torque_B

    kp, kd = float(satellite.control.controller.kp), float(satellite.control.controller.kd)
    e = 2.0 * turn.as_quat()[:3]
    in_B = turn.inv().apply(np.stack([reference.w_NR_R, reference.dw_NR_R]))
    expected = J @ in_B[1] - kp * e - kd * (w - in_B[0])
    np.testing.assert_allclose(found, expected, rtol=1e-12)


def test_torque_limit_keeps_the_direction():
    limited = controller(torque_limit=2.0).limited
    torque = np.array([3.0, -4.0, 12.0])
    np.testing.assert_allclose(limited(torque), torque * 2.0 / 13.0, rtol=1e-12)
    np.testing.assert_array_equal(limited(torque / 13.0), torque / 13.0)
    np.testing.assert_array_equal(limited(np.zeros(3)), np.zeros(3))
    np.testing.assert_array_equal(controller().limited(torque), torque)


def step_response(pid, J=500.0, duration=120.0, dt=0.01):
    """Attitude error of a bare inertia from 1 rad, and the integral, by small steps."""

    def step(carry, _):
        e, w, q = carry
        measured = Measured(e, w, jnp.zeros(3))
        asked = pid.torque_B(measured, q)
        delivered = pid.limited(asked)
        w = w + dt * delivered / J
        q_rate = pid.memory_rate(measured, q, asked, delivered)
        return (e + dt * w, w, q + dt * q_rate), (e[0], q[0])

    start = (jnp.array([1.0, 0.0, 0.0]), jnp.zeros(3), jnp.zeros(3))
    return jax.jit(lambda: jax.lax.scan(step, start, None, int(duration / dt))[1])()


def test_integral_is_that_of_the_error_where_nothing_saturates():
    e, T = jnp.array([0.1, -0.2, 0.3]), jnp.array([1.0, 2.0, 3.0])
    measured = Measured(e, jnp.zeros(3), jnp.zeros(3))
    np.testing.assert_array_equal(controller().memory_rate(measured, jnp.zeros(3), T, T), e)


def test_back_calculation_stops_windup():
    """A 1 rad step with a torque limit of a twentieth of what the PID asks at first.

    While saturated, dq/dt = -(q - e T_t + (Kp e + Kd w + T) / Ki) / T_t with T_t = sqrt(Kd / Ki),
    so |Ki q| stays below |Kp e| + |Kd w| + |T| + Ki T_t |e|, whatever the time spent there.
    """
    e, q = step_response(controller(torque_limit=10.0))
    e_wound, _ = step_response(controller(torque_limit=10.0, unwinding=0.0))
    rate = np.abs(np.gradient(e, 0.01)).max()
    bound = KP + KD * rate + 10.0 + KI * np.sqrt(KD / KI)
    assert np.abs(KI * q).max() < bound
    assert -e_wound.min() > 0.5  # it does wind up without
    assert -e.min() < 0.5 * -e_wound.min()
    assert np.abs(e[-1000:]).max() < 0.01


def servo(rate_limit=None, acceleration_limit=None):
    limits = (np.inf if v is None else v for v in (rate_limit, acceleration_limit))
    return GimbalServos(jnp.asarray(50.0), *map(jnp.asarray, limits))


def test_servo_answers_a_step_by_a_first_order_lag():
    """rate = command (1 - exp(-bandwidth t)), integrated by the midpoint rule."""
    command, dt = np.array([1.0, -0.4]), 1e-4
    rates = [np.zeros(2)]
    for _ in range(400):
        middle = rates[-1] + 0.5 * dt * servo().acceleration(rates[-1], command)
        rates.append(rates[-1] + dt * np.asarray(servo().acceleration(middle, command)))
    t = dt * np.arange(401)
    np.testing.assert_allclose(rates, np.outer(1.0 - np.exp(-50.0 * t), command), atol=2e-6)


def test_rates_are_cut_alike_by_the_rate_limit():
    command = np.array([0.5, -4.0, 1.0])
    share = servo(rate_limit=2.0).share(command)
    np.testing.assert_allclose(share * command, [0.25, -2.0, 0.5], rtol=1e-14)
    assert float(servo(rate_limit=4.0).share(command)) == 1.0
    assert float(servo(rate_limit=2.0).share(np.zeros(3))) == 1.0
    assert float(servo().share(1e6 * command)) == 1.0


def test_acceleration_limit_holds_for_each_gimbal():
    command, rate = np.array([0.5, -4.0, 1.0]), np.array([0.4, 0.0, 1.0])
    found = servo(acceleration_limit=10.0).acceleration(rate, command)
    np.testing.assert_allclose(found, [5.0, -10.0, 0.0], atol=1e-12)
    np.testing.assert_allclose(servo().acceleration(rate, command), 50.0 * (command - rate))


def test_cut_rates_are_what_the_integrator_knows_of():
    """The closed loop tells the integral how much of the torque the gimbals can deliver."""
    scenario = load_scenario("zhang2012").with_overrides(
        {"cluster.gimbal_rate_limit": 1e-3, "control.torque_limit": 3.0}
    )
    satellite = build_satellite(scenario)
    state = build_initial_state(scenario, satellite)
    signals = eqx.filter_jit(decide)(satellite, jnp.zeros(()), state)
    e = signals.error_B
    asked = -200.0 * e
    np.testing.assert_allclose(signals.torque_B, 3.0 * asked / np.linalg.norm(asked), rtol=1e-12)
    assert np.abs(signals.commands[0]).max() == pytest.approx(1e-3, rel=1e-12)
    lost = (signals.memory_rate - e) * np.sqrt(0.1 * 2500.0)  # asked - delivered
    delivered = asked - lost
    assert 0.0 < np.linalg.norm(delivered) < 0.5 * 3.0
    np.testing.assert_allclose(np.cross(delivered, asked), np.zeros(3), atol=1e-9)
