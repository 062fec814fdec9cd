"""The transient that steady responses leave out, against the oscillators' equations in time."""

from types import SimpleNamespace

import numpy as np
import pytest
from scipy.integrate import solve_ivp

from quietbus.dynamics.layout import Layout
from quietbus.dynamics.memory import Answering, Memory
from quietbus.dynamics.vibration import Vibration
from quietbus.dynamics.views import View
from quietbus.model.motion import Motion
from quietbus.solve.transient import Modes, transient

BUS_LAST = np.roll(np.arange(12), 6)  # the bus's come first
NATURAL = np.linspace(15.0, 26.0, 12)[BUS_LAST]  # [rad/s] of twelve oscillators
DAMPING = np.linspace(0.3, 0.1, 12)[BUS_LAST]  # [1/s]
SEEN = slice(3, 6)  # the turn of the bus
SATELLITE = SimpleNamespace(mounts=[SimpleNamespace(body="plate")])
ORDERS = np.array([1.0, 2.0])


def oscillators():
    """Unit masses; nothing turns."""
    layout = Layout((("bus", 6), ("plate", 6)), 2)
    rest = Motion(np.eye(3), *np.zeros((3, 3)))
    now = SimpleNamespace(layout=layout, motions={"bus": rest, "plate": rest})
    M, C, K = np.eye(12), np.diag(2.0 * DAMPING), np.diag(NATURAL**2)
    parts = (*(np.zeros((0, 0)) for _ in range(5)), np.zeros((3, 12, 0)), np.zeros((12, 0)))
    nothing = Memory(Answering((), (), (), ()), *parts)
    slow = SimpleNamespace(now=now)
    return Modes.of(Vibration(slow, layout, M, C, K, nothing, np.eye(12), np.zeros((12, 12)), {}))


def steady(force, speed):
    """(n, 1, order, 12) for forces (n, order, 12) and speeds (n,)."""
    s = (1j * speed[:, None] * ORDERS)[..., None]
    return (force / (s**2 + 2.0 * DAMPING * s + NATURAL**2))[:, None]


def true_transient(time, force, angle, speed, h):
    """(n,) length of the bus's rate, at order h, less that of the steady response."""

    def rate(t, x):
        pushed = force(np.array([t]))[0, h] * np.exp(1j * ORDERS[h] * angle(t))
        position, velocity = x[:12], x[12:]
        return np.r_[velocity, pushed - 2.0 * DAMPING * velocity - NATURAL**2 * position]

    x_s = steady(force(time), speed(time))[:, 0, h]
    s = 1j * ORDERS[h] * speed(time)[:, None]
    turn = np.exp(1j * ORDERS[h] * angle(time))[:, None]
    start = np.r_[x_s[0], s[0] * x_s[0]] * turn[0]
    run = solve_ivp(rate, time[[0, -1]], start, "DOP853", time, rtol=1e-7, atol=1e-10)
    missing = run.y[12:].T / turn - s * x_s
    return np.linalg.norm(missing[:, SEEN], axis=1)


def constant(t):
    """Order 2 is weaker, and along other axes."""
    force = np.zeros((len(t), 2, 12), complex)
    force[:, 0], force[:, 1] = np.linspace(1.0, 2.0, 12), 0.2j * np.linspace(2.0, -1.0, 12)
    return force[..., BUS_LAST]


def turning(t):
    """As of gimbals that turn, at 0.2 rad/s."""
    return constant(t) * np.exp(0.2j * t)[:, None, None]


@pytest.mark.parametrize("output_rate", [10.0, 100.0])
def test_run_up_past_the_modes_rings_for_as_long_as_they_do(output_rate):
    """From 5 to 45 rad/s in 8 s: each mode is crossed in a few tenths of a second, then nothing."""
    speed = lambda t: 5.0 + 5.0 * np.minimum(t, 8.0)  # noqa: E731
    angle = lambda t: 5.0 * t + 2.5 * np.minimum(t, 8.0) ** 2 + 40.0 * np.maximum(t - 8.0, 0.0)  # noqa: E731
    time = np.arange(0.0, 14.0, 1.0 / output_rate)
    xi = steady(constant(time), speed(time))
    found = transient(SATELLITE, time, xi, speed(time)[:, None], ORDERS, {0: oscillators()}, VIEW)
    expected = sum(true_transient(time, constant, angle, speed, h) for h in (0, 1))
    error = np.abs(found.bus_rate - expected)
    assert np.max(error) < 0.03 * np.max(expected)
    # in the ring-down, long after everything has come to rest, too
    ringing = time > 9.0
    assert np.all(error[ringing] < 0.1 * expected[ringing])
    lines = np.linalg.norm(
        speed(time)[:, None, None, None] * ORDERS[:, None] * xi[..., SEEN], axis=3
    )
    assert expected[time > 10.0][0] > lines[-1].sum()  # more than the jitter


@pytest.mark.parametrize("speed", [10.0, 25.3, 60.0])
def test_forces_that_turn_lag_and_a_start_rings(speed):
    """Beside the modes, next to one (25 rad/s), and far away; ten outputs a second."""
    time = np.arange(0.0, 6.0, 0.1)
    even = np.full(len(time), speed)
    found = transient(
        SATELLITE,
        time,
        steady(turning(time), even),
        even[:, None],
        ORDERS,
        {0: oscillators()},
        VIEW,
    )
    expected = sum(
        true_transient(time, turning, lambda t: speed * t, lambda t: 0.0 * t + speed, h)
        for h in (0, 1)
    )
    np.testing.assert_allclose(found.bus_rate, expected, atol=0.02 * np.max(expected))
    np.testing.assert_allclose(found.line_of_sight[:, 1], found.line_of_sight[:, 0])


def test_several_bases_follow_on_without_a_seam():
    time = np.arange(0.0, 12.0, 0.1)
    speed = (5.0 + 3.0 * time)[:, None]
    xi = steady(constant(time), speed[:, 0])
    one, four = (
        transient(SATELLITE, time, xi, speed, ORDERS, dict.fromkeys(at, oscillators()), VIEW)
        for at in ([50], [0, 7, 60, 119])
    )
    np.testing.assert_allclose(four.bus_rate, one.bus_rate, atol=1e-9 * one.bus_rate.max())
    np.testing.assert_allclose(four.line_of_sight, one.line_of_sight, atol=1e-12)


def test_a_line_of_sight_is_moved_by_the_bus_alone_where_the_plate_follows():
    """theta_B by itself: what is seen is its part across the direction."""
    view = View(np.zeros((0, 3)), np.concatenate([np.eye(3), np.zeros((3, 9))], axis=1)[None])
    time = np.arange(0.0, 4.0, 0.1)
    speed = (5.0 + 3.0 * time)[:, None]
    xi = steady(constant(time), speed[:, 0])
    found = transient(SATELLITE, time, xi, speed, ORDERS, {0: oscillators()}, view)
    # far from rest the oscillators ring at 23 to 26 rad/s
    ratio = found.bus_rate[-1] / found.line_of_sight[-1, 0]
    assert 20.0 < ratio < 30.0


VIEW = View(np.zeros((0, 3)), np.stack([np.eye(3, 12), np.roll(np.eye(3), 1, 0) @ np.eye(3, 12)]))
