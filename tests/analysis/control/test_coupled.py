"""The coupled loop against closed forms, the loops per axis, brute force, and a flight in time."""

from dataclasses import replace

import jax
import jax.numpy as jnp
import numpy as np
import pytest

import quietbus as qb
from oracles.linear_systems import random_system
from oracles.satellites import paper_satellite, with_control
from quietbus.analysis.control.controlled import controlled
from quietbus.analysis.control.coupled import analyze_coupled, critical_gains, stable_gain_range
from quietbus.analysis.control.loop import attitude_loop
from quietbus.analysis.control.nyquist import stable_gain_range as loop_range
from quietbus.analysis.control.pid import PID
from quietbus.dynamics.closed_loop import initial_state
from quietbus.dynamics.linearize import OperatingPoint, linearize
from quietbus.spatial.rotation import rotation_vector_to_quaternion
from quietbus.studies.linear import at_height, without_friction, without_leg_mass, without_rotation
from quietbus.validate.trajectory import fly

PAPER = PID(kp=200.0, ki=0.1, kd=2500.0)
REST = OperatingPoint(np.zeros(3), np.zeros(4))
SEPARATION = 0.25 * np.sqrt(2.0)


def bare(inertia=(1100.0, 900.0, 800.0), mass=1000.0):
    """What the paper assumes, but free: no leg mass, friction, rotor momentum or products."""
    satellite = without_friction(without_leg_mass(qb.analyze("zhang2012").satellite))
    bus, plate = satellite.bodies
    tensor = jnp.diag(jnp.asarray(inertia, float))
    bus = replace(bus, mass_X=jnp.asarray(mass), I_XXcm_X=tensor)
    return without_rotation(replace(satellite, bodies=(bus, plate)))


def system_of(satellite, pid=PAPER, actuator="ideal"):
    return controlled(linearize(satellite, REST, actuator), pid)


def planar_range(inertia, height, mass=1000.0):
    """Stable K of one axis of the free satellite, from Newton's and Euler's laws written by hand.

    Bus (x, theta), plate (x, theta) with the hexapod's stiffness about the plate's mass centre
    (facts: 2k, k/4, coupling -sqrt(2)/4 k), the plate at `height` over the bus's mass centre.
    """
    m, I, k, c, b = 82.8, 8.8, 2e4, 500.0, np.sqrt(2.0) / 4.0
    hexapod = np.array([[2.0, -b], [-b, 0.25]])
    relative = np.array([[-1.0, -height, 1.0, 0.0], [0.0, -1.0, 0.0, 1.0]])
    shape = relative.T @ hexapod @ relative
    M = np.diag([mass, inertia, m, I])
    A = np.block(
        [
            [np.zeros((4, 4)), np.eye(4)],
            [-np.linalg.solve(M, k * shape), -np.linalg.solve(M, c * shape)],
        ]
    )
    torque = np.zeros((8, 1))
    torque[7] = 1.0 / I
    pid = np.zeros((1, 8))
    pid[0, 1], pid[0, 5] = PAPER.kp, PAPER.kd
    A = np.block([[A, np.zeros((8, 1))], [np.eye(1, 8, 1), np.zeros((1, 1))]])
    B = np.vstack([torque, [[0.0]]])
    F = np.hstack([pid, [[PAPER.ki]]]) / PAPER.kd
    # bus position and velocity as a whole act on nothing: keep motion relative to the bus
    T = np.eye(9)
    T[2, 0] = T[6, 4] = -1.0
    inside = [1, 2, 3, 5, 6, 7, 8]
    A = (T @ A @ np.linalg.inv(T))[np.ix_(inside, inside)]
    B, F = (T @ B)[inside], (F @ np.linalg.inv(T))[:, inside]

    def worst(gain):
        return np.linalg.eigvals(A - gain * B @ F).real.max()

    grid = np.geomspace(1e-2, 1e6, 1500)
    stable = np.array([worst(gain) for gain in grid]) < 0.0
    ends = []
    for i in np.flatnonzero(np.diff(stable)):
        low, high = grid[i], grid[i + 1]
        for _ in range(60):
            middle = np.sqrt(low * high)
            low, high = (middle, high) if (worst(middle) < 0.0) == stable[i] else (low, middle)
        ends.append(low)
    return list(zip(ends[::2], ends[1::2], strict=True))


@pytest.mark.parametrize("height", [-0.5, 0.2, 0.6 + SEPARATION, 1.5])
def test_range_of_the_free_satellite_is_that_of_hand_written_planar_dynamics(height):
    """Symmetric bus: x and y separate; the coupled range is where both and z are stable."""
    found = np.array(stable_gain_range(system_of(at_height(bare(), height))))
    x, y = (planar_range(inertia, height) for inertia in (1100.0, 900.0))
    both = [(max(a, c), min(b, d)) for a, b in x for c, d in y]
    # z, a plain torsional spring between two inertias, is stable further up than these
    expected = [(low, high) for low, high in both if low < min(high, 4e4)]
    np.testing.assert_allclose(found, expected, rtol=1e-6)


def test_a_heavy_bus_gives_the_ranges_per_axis():
    """Base plate at the mass centre of a bus 1e6 times as heavy, controller likewise."""
    scale = 1e6
    heavy = bare(tuple(scale * I for I in (1100.0, 900.0, 800.0)), 1e3 * scale)
    pid = PID(*(scale * gain for gain in (PAPER.kp, PAPER.ki, PAPER.kd)))
    result = analyze_coupled(system_of(at_height(heavy, SEPARATION), pid))
    channels = qb.analyze("zhang2012").channels
    each = [
        loop_range(attitude_loop(channel.numerator, channel.denominator, inertia, PAPER))[0]
        for channel, inertia in zip(channels, (1100.0, 900.0, 800.0), strict=True)
    ]
    ((low, high),) = result.stable_gain_range
    assert low / scale == pytest.approx(max(low for low, _ in each), rel=1e-4)
    assert high / scale == pytest.approx(min(high for _, high in each), rel=1e-4)
    # each axis's own limits are among the gains at which poles cross
    crossings = np.array(result.critical_gains) / scale
    for ends in each:
        for end in ends:
            assert np.abs(crossings / end - 1.0).min() < 1e-4


def test_poles_lie_on_the_axis_at_the_ends_of_the_range():
    system = qb.analyze("zhang2012").controlled
    ((low, high),) = stable_gain_range(system)
    for end in (low, high):
        poles = system.poles(end)
        assert np.abs(poles.real).min() < 1e-9
        assert abs(poles.real.max()) < 1e-9
    assert system.abscissa(low * 1.001) < 0 > system.abscissa(high * 0.999)
    assert system.abscissa(low * 0.999) > 0 < system.abscissa(high * 1.001)


@pytest.mark.parametrize("seed", range(12))
def test_no_crossing_is_missed(seed):
    """Random systems, several ranges among them: the same as a fine grid of eigenvalues."""
    system = random_system(seed)
    gains = np.geomspace(1e-4, 1e4, 3001)
    stable = np.array([system.abscissa(gain) for gain in gains]) < 0.0
    inside = np.zeros(len(gains), bool)
    for low, high in stable_gain_range(system):
        inside |= (gains > low) & (gains < (np.inf if high is None else high))
    np.testing.assert_array_equal(inside, stable)
    changes = gains[np.flatnonzero(np.diff(stable))]
    for change in changes:
        assert np.abs(np.log(critical_gains(system) / change)).min() < 0.01


def test_ranges_of_random_systems_are_of_all_kinds():
    """The test above means something: no range, one without an end, several."""
    found = [stable_gain_range(random_system(seed)) for seed in range(12)]
    assert any(ranges and ranges[-1][1] is None for ranges in found) or any(
        len(ranges) > 1 for ranges in found
    )
    assert any(ranges and ranges[0][0] == 0.0 for ranges in found)


def test_upper_limit_falls_as_the_platform_rises():
    heights = np.linspace(0.1, 2.0, 8)
    limits = qb.analyze("zhang2012").limits_by_height(heights)
    assert np.all(np.diff(limits[:, 1]) < 0.0)
    assert limits[0, 1] > 9000.0
    assert limits[-1, 1] < 3100.0


@pytest.mark.slow
def test_nonlinear_flight_diverges_above_the_coupled_limit_and_settles_below():
    """Growth rate of the nonlinear closed loop, gimbal servo and all, against the abscissa."""
    satellite = paper_satellite(imbalance=0.0)
    system = system_of(satellite, PAPER, "servo")
    ((_, high),) = stable_gain_range(system)
    assert high == pytest.approx(3866.0, abs=1.0)
    assert high < 0.6 * 7463.0  # far below what the analysis per axis allows
    times = np.linspace(0.0, 8.0, 801)
    start = jax.jit(initial_state)(
        satellite,
        rotation_vector_to_quaternion(jnp.array([1e-5, 1e-5, 1e-5])),
        jnp.zeros(3),
        jnp.zeros(4),
    )
    for factor in (1.1, 0.9):
        gain = factor * high / PAPER.kd
        controller = replace(
            satellite.control.controller,
            kp=jnp.asarray(gain * PAPER.kp),
            ki=jnp.asarray(gain * PAPER.ki),
            kd=jnp.asarray(gain * PAPER.kd),
        )
        flown = fly(
            with_control(satellite, controller=controller), start, jnp.asarray(times), 1e-10
        )
        # rate of the plate: what the oscillation shakes most
        rate = {name: np.asarray(body.w_NX_X) for name, body in flown.bodies.items()}
        shake = rate["plate"][:, 1] - rate["bus"][:, 1]
        early, late = (np.ptp(shake[(times > t) & (times < t + 1.0)]) for t in (3.0, 7.0))
        growth = np.log(late / early) / 4.0
        abscissa = float(system.abscissa(factor * high))
        fast = system.poles(factor * high)
        fast = fast[np.abs(fast.imag) > 5.0].real.max()  # slow poles do not shake
        assert np.sign(growth) == np.sign(factor - 1.0)
        assert growth == pytest.approx(fast, rel=0.05)
        assert (abscissa > 0) == (factor > 1)


def test_without_integral_action_any_small_gain_is_stable():
    result = analyze_coupled(system_of(bare(), PID(200.0, 0.0, 2500.0)))
    assert result.stable
    assert result.stable_gain_range[0][0] == 0.0
    assert np.all(result.poles.real < 0.0)


def test_rate_feedback_alone_leaves_the_attitude_adrift():
    result = analyze_coupled(system_of(bare(), PID(0.0, 0.0, 2500.0)))
    assert not result.stable
    assert result.stable_gain_range == ()
    assert result.disk_margin == 0.0


def test_without_rate_feedback_the_gain_is_kp():
    system = system_of(bare(), PID(200.0, 0.0, 0.0))
    assert system.gain == 200.0
    result = analyze_coupled(system)
    assert not result.stable
    assert "Unstable at K = 200" in result.verdict


def test_unstable_at_the_chosen_gain_is_analysed_and_said():
    result = analyze_coupled(system_of(bare(), PID(800.0, 0.4, 10_000.0)))
    assert not result.stable
    assert result.unstable_poles == 4
    assert result.gain_margin_db is None
    assert result.gain_margins_db == ()
    assert result.stable_gain_range[0][1] == pytest.approx(3957.0, rel=1e-2)
    assert "Unstable at K = 1e+04: 4 poles" in result.verdict


def test_no_gain_at_all_is_refused():
    with pytest.raises(ValueError, match="not zero"):
        system_of(bare(), PID(0.0, 0.0, 0.0))


def test_loop_of_an_axis_with_the_others_closed():
    """Closing it too gives the poles of the whole: 1 + l_i vanishes there."""
    system = qb.analyze("zhang2012").controlled
    omega = np.array([0.3, 2.0, 15.0])
    for i in range(3):
        open_axis = np.eye(3)
        open_axis[i, i] = 0.0
        A = system.A - system.gain * system.B @ open_axis @ system.F
        s = 1j * omega[:, None, None]
        resolvent = np.linalg.solve(s * np.eye(len(A)) - A, system.B[:, [i]].astype(complex))
        expected = (system.gain * system.F[[i]] @ resolvent)[:, 0, 0]
        np.testing.assert_allclose(system.axis_loops(omega)[:, i], expected, rtol=1e-9)
