"""Figure 4: the model against an independent program, MuJoCo in place of ADAMS."""

from dataclasses import replace

import jax
import jax.numpy as jnp
import numpy as np
from scipy.spatial.transform import Rotation

from quietbus.build import build_initial_state
from quietbus.dynamics.closed_loop import rotor_angles
from quietbus.dynamics.equations import Wrench, accelerations
from quietbus.model.variants import without_rotation
from quietbus.plots.style import COLOURS, DASHES, new_figure, share_legend
from quietbus.reproduce.parts import Findings
from quietbus.reproduce.zhang2012.bench import Bench
from quietbus.validate.reference import Reference
from quietbus.validate.trajectory import fly, fly_mujoco_to, held_gimbals, massless_legs

FORCE = (10.0, 0.0, 30.0)  # [N] on the upper platform
DURATION = 10.0  # [s]
LOOKS = 21  # states at which accelerations with leg mass are compared


def validation(bench: Bench) -> Findings:
    """Figure 4."""
    study = bench.study
    start = build_initial_state(study.scenario, study.satellite)
    wrench = replace(Wrench.zero(), force_P=jnp.array(FORCE))
    locked = held_gimbals(without_rotation(study.satellite), wrench)
    struts = massless_legs(locked)
    times = np.linspace(0.0, DURATION, 201)
    ours = fly(struts, start, jnp.asarray(times))
    bench.shop.tell("MuJoCo", 0.3)
    theirs, own_error = fly_mujoco_to(1e-8, struts, start, wrench, times)
    moved, moved_there = (np.asarray(s.p_NB_N - s.p_NB_N[0]) for s in (ours, theirs))
    difference = np.abs(moved - moved_there)

    bench.shop.tell("accelerations with leg mass", 0.8)
    heavy = fly(locked, start, jnp.asarray(times))
    apart = np.asarray(heavy.p_NB_N - heavy.p_NB_N[0]) - moved
    with_legs = _accelerations(locked, heavy, times, wrench)

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
    turned, turned_there = (Rotation.from_quat(s.q_NB, scalar_first=True) for s in (ours, theirs))
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


def _accelerations(satellite, states, times: np.ndarray, wrench: Wrench) -> float:
    """Largest relative difference of accelerations along a flight, legs with mass."""
    first = jax.tree.map(lambda leaf: leaf[0], states)
    reference = Reference(satellite, first)
    errors = []
    for i in np.linspace(0, len(times) - 1, LOOKS).astype(int):
        state = jax.tree.map(lambda leaf, i=i: leaf[i], states)
        still = jnp.zeros_like(state.gimbal_angle)
        arguments = (state, rotor_angles(satellite, times[i], state), still, wrench)
        theirs = jax.tree.leaves(reference.accelerations(*arguments))
        ours = jax.tree.leaves(accelerations(satellite, *arguments))
        scale = max(np.linalg.norm(a) for a in theirs)
        errors += [np.linalg.norm(a - b) / scale for a, b in zip(theirs, ours, strict=True)]
    return float(np.max(errors))
