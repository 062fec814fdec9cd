"""Lines too small for the tolerance: the direct solver's steps resolve them all the same."""

from dataclasses import replace
from types import SimpleNamespace

import jax.numpy as jnp
import numpy as np
import pytest
from jax.flatten_util import ravel_pytree

from quietbus.build import build_initial_state, build_satellite
from quietbus.scenario import load_scenario
from quietbus.solve.direct import Tolerances, integrate
from quietbus.solve.periodic import steady_speeds
from quietbus.solve.resolved_steps import STEPS, ResolvingController, fastest_line

BALANCED = {"cluster.rotor.static_imbalance": 0, "cluster.rotor.dynamic_imbalance": 0}


def line_of(run):
    """Complex amplitude of the bus's rate at 100 Hz in the last half second."""
    last = run.time >= 0.5
    t = run.time[last]
    turn = 200.0 * np.pi * t
    columns = np.column_stack([np.cos(turn), np.sin(turn), np.vander(t - 0.75, 8)])
    found = np.linalg.lstsq(columns, run.outputs["bus_rate"][last], rcond=None)[0]
    return found[0] - 1j * found[1]


@pytest.mark.parametrize("over_tolerance", [120.0, 1.2])
def test_amplitude_of_a_line_is_right_whatever_its_size(over_tolerance):
    """Theory 15.3: 1e-5 of the amplitude; without the limit 0.3 % and more are wrong."""
    start = load_scenario("zhang2012").with_overrides(
        {"isolator.mount": "rigid", "initial.attitude": [0, 0, 0]}
    )

    def fly(imbalance, tolerances):
        scenario = start.with_overrides(BALANCED | {"cluster.rotor.static_imbalance": imbalance})
        satellite = build_satellite(scenario)
        state = build_initial_state(scenario, satellite)
        largest = np.max(steady_speeds(satellite, state)[..., 3:])
        return integrate(satellite, state, 1.0, 1000.0, tolerances), largest

    default = Tolerances()
    imbalance = 1e-5
    _, largest = fly(imbalance, default)
    imbalance *= over_tolerance * default.absolute / largest
    run, amplitude = fly(imbalance, default)
    assert amplitude == pytest.approx(over_tolerance * default.absolute)
    exact, _ = fly(imbalance, Tolerances(1e-13, 1e-18))
    error = np.max(np.abs(line_of(run) - line_of(exact))) / np.max(np.abs(line_of(exact)))
    assert error < 1e-5
    assert run.steps < 1.1 * STEPS * 100


def fastest(name, changes, rate):
    """Highest frequency [rad/s] that the controller sees in a state."""
    scenario = load_scenario(name).with_overrides(changes)
    satellite = build_satellite(scenario)
    state = build_initial_state(scenario, satellite)
    flat, unravel = ravel_pytree(state)
    line = fastest_line(satellite.prepared(), unravel)
    if rate is not None:
        own = replace(state.own["cluster"], y_rate=jnp.asarray(rate))
        state = replace(state, own=state.own | {"cluster": own})
    return float(line.frequency(jnp.zeros(()), ravel_pytree(state)[0])), flat


ORDERS = {"orders": [{"order": 4.2, "axial_force": 1e-9}, {"order": 7.0}]}


@pytest.mark.parametrize(
    ("name", "changes", "rate", "expected"),
    [
        ("zhang2012", {}, None, 200.0 * np.pi),
        ("zhang2012", {"cluster.rotor.static_imbalance": 0}, None, 200.0 * np.pi),
        ("zhang2012", BALANCED, None, 0.0),
        ("zhang2012", {"cluster.rotor.disturbance": ORDERS}, None, 4.2 * 200.0 * np.pi),
        ("wheels-demo", {}, [10.0, -250.0, 30.0, 0.0], 250.0),
        (
            "zhang2012",
            BALANCED
            | {"cluster.gimbal_motor": {"ripple": [{"per_turn": 1200, "torque": "1 mN*m"}]}},
            [0.1, -0.5, 0.0, 0.0],
            600.0,
        ),
    ],
)
def test_the_fastest_line_is_found_among_all_kinds(name, changes, rate, expected):
    """A line of no size does not count."""
    found, _ = fastest(name, changes, rate)
    assert found == pytest.approx(expected)


def test_steps_grow_and_shrink_with_the_speed():
    """The controller cuts the next step by the speed at the end of the last one."""
    inner = SimpleNamespace(adapt_step_size=lambda *_: (True, 1.0, 9.0, False, None, None))
    line = SimpleNamespace(frequency=lambda _, y: y[0])
    controller = object.__new__(ResolvingController)
    object.__setattr__(controller, "controller", inner)
    object.__setattr__(controller, "line", line)
    for omega, longest in ((100.0, 2.0 * np.pi / STEPS / 100.0), (0.01, 8.0), (0.0, 8.0)):
        y = jnp.array([omega])
        _, start, end, *_ = controller.adapt_step_size(0.0, 1.0, 0.0 * y, y, None, None, 8, None)
        assert float(end) - start == pytest.approx(longest)
