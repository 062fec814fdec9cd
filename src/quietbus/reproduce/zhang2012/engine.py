"""Figure 4: the model against an independent program, MuJoCo in place of ADAMS."""

import equinox as eqx
import jax
import jax.numpy as jnp
import numpy as np
from scipy.spatial.transform import Rotation

from quietbus.build import build_initial_state
from quietbus.dynamics.equations import accelerations, moving
from quietbus.dynamics.state import State
from quietbus.model.element import Rates
from quietbus.model.satellite import Satellite
from quietbus.model.variants import without_rotation
from quietbus.plots.style import COLOURS, DASHES, new_figure, share_legend
from quietbus.reproduce.parts import Findings
from quietbus.reproduce.zhang2012.bench import Bench
from quietbus.validate.reference import Reference
from quietbus.validate.trajectory import (
    fly,
    fly_mujoco_to,
    held_gimbals,
    load_on,
    massless_legs,
)

FORCE = (10.0, 0.0, 30.0)  # [N] on the upper platform
DURATION = 10.0  # [s]
LOOKS = 21  # states at which accelerations with leg mass are compared


def validation(bench: Bench) -> Findings:
    """Figure 4."""
    study = bench.study
    start = build_initial_state(study.scenario, study.satellite)
    wrenches = load_on(study.satellite, "plate", FORCE)
    locked = held_gimbals(without_rotation(study.satellite), wrenches)
    struts = massless_legs(locked)
    times = np.linspace(0.0, DURATION, 201)
    ours = fly(struts, start, jnp.asarray(times))
    bench.shop.tell("MuJoCo", 0.3)
    theirs, own_error = fly_mujoco_to(1e-8, struts, start, wrenches, times)
    moved, moved_there = (_path(s) for s in (ours, theirs))
    difference = np.abs(moved - moved_there)

    bench.shop.tell("accelerations with leg mass", 0.8)
    heavy = fly(locked, start, jnp.asarray(times))
    apart = _path(heavy) - moved
    with_legs = _accelerations(locked, heavy, times, wrenches)

    figure = new_figure(5.2, "Base platform pushed through the isolator by (10, 0, 30) N")
    position, error = figure.subplots(2, 1, sharex=True, height_ratios=(1.5, 1))
    for i, axis in enumerate("xyz"):
        look = {"color": COLOURS[i], "linestyle": DASHES[i]}
        position.plot(times, moved_there[:, i], color=COLOURS[i], linewidth=5, alpha=0.25)
        position.plot(times, moved[:, i], label=f"{axis}, quietbus", **look)
        error.plot(times[1:], np.maximum(difference[1:, i], 1e-18), label=axis, **look)
    position.plot([], [], color="0.5", linewidth=5, alpha=0.4, label="MuJoCo (wide, pale)")
    position.set(ylabel="bus mass centre [m]")
    error.set(yscale="log", ylabel="difference [m]", xlabel="time [s]")
    share_legend(figure, position)
    relative = float(np.max(difference) / np.max(np.abs(moved)))
    turned, turned_there = (
        Rotation.from_quat(s.bus.q_NX, scalar_first=True) for s in (ours, theirs)
    )
    apart_by = np.max((turned_there.inv() * turned).magnitude())
    most = np.max((turned[0].inv() * turned).magnitude())
    numbers = {
        "validation_difference": relative,
        "validation_attitude": float(apart_by / most),
        "validation_own_error": own_error,
        "validation_leg_mass": with_legs,
        "validation_leg_mass_shift": float(np.max(np.abs(apart)) / np.max(np.abs(moved))),
    }
    caption = (
        "Figure 4 of the paper, with MuJoCo in place of ADAMS: CMGs locked, free satellite, legs "
        "without mass (struts are tendons there). Largest difference over largest motion: "
        f"{relative:.1e} in position, as the paper shows it, and "
        f"{numbers['validation_attitude']:.1e} in attitude; MuJoCo's own error by halving its "
        f"step: {own_error:.1e}. With leg masses, accelerations at {LOOKS} instants of the flight "
        f"differ by at most {with_legs:.1e} (relative), and the bus's path changes by "
        f"{100 * numbers['validation_leg_mass_shift']:.2g} %."
    )
    return Findings(figure, caption, numbers)


def _path(states: State) -> np.ndarray:
    """Of the bus's mass centre from its start [m]."""
    return np.asarray(states.bus.p_NX_N - states.bus.p_NX_N[0])


def _accelerations(
    satellite: Satellite, states: State, times: np.ndarray, wrenches: np.ndarray
) -> float:
    """Largest relative difference of accelerations along a flight, legs with mass."""
    at = lambda i: jax.tree.map(lambda leaf: leaf[i], states)  # noqa: E731
    reference, errors = Reference(satellite, at(0)), []
    for i in np.linspace(0, len(times) - 1, LOOKS).astype(int):
        still = {c.name: Rates(jnp.zeros(c.driven), jnp.zeros(0)) for c in satellite.clusters}
        theirs = reference.accelerations(times[i], at(i), still, wrenches)
        ours = np.asarray(_ours(satellite, jnp.asarray(times[i]), at(i), still))
        off = np.linalg.norm(theirs - ours.reshape(theirs.shape), axis=2)
        errors.append(np.max(off) / np.max(np.linalg.norm(theirs, axis=2)))
    return float(np.max(errors))


@eqx.filter_jit
def _ours(satellite, t, state, rates):
    """Under the loads that the satellite has."""
    return accelerations(satellite, moving(satellite, t, state), rates)
