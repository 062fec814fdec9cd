"""What a run reports at each output instant: all that bodies, elements and control tell."""

from collections.abc import Iterable

import jax
import jax.numpy as jnp
from jaxtyping import Array, Float

from quietbus.dynamics.closed_loop import Evaluation, attitudes, evaluate
from quietbus.dynamics.equations import moving, rates_of
from quietbus.dynamics.state import State
from quietbus.model.body import body_quantities
from quietbus.model.cluster import ROTOR_TORQUE
from quietbus.model.report import Output, Quantity, by_name
from quietbus.model.satellite import Satellite

Outputs = dict[str, Float[Array, "..."]]


def outputs(
    satellite: Satellite, t: Float[Array, ""], state: State, detailed: bool = False
) -> Outputs:
    """Outputs at time t [s] by name; ``detailed``: with the forces in joints."""
    found = evaluate(satellite, t, state)
    return joined(told(satellite, state, found, detailed))


def quantities(satellite: Satellite, state: State, detailed: bool = False) -> dict[str, Quantity]:
    """What the outputs are, by name."""
    found: dict[str, Quantity] = {}

    def look(satellite, state):
        evaluation = evaluate(satellite, jnp.zeros(()), state)
        for quantity, _ in told(satellite, state, evaluation, detailed):
            found[quantity.name] = quantity

    jax.eval_shape(look, satellite, state)
    return found


def told(
    satellite: Satellite, state: State, found: Evaluation, detailed: bool = False
) -> list[Output]:
    """All outputs, those of like parts one after the other."""
    report: list[Output] = []
    now, turns = found.now, attitudes(satellite, state)
    for body in satellite.bodies:
        quantity, motion = body_quantities(body.name), now.motions[body.name]
        report += [
            Output(quantity["position"], motion.p),
            Output(quantity["velocity"], motion.v),
            Output(quantity["attitude"], turns[body.name]),
            Output(quantity["rate"], motion.R_AX.T @ motion.w),
        ]
    for element in satellite.elements:
        rates, u_rate = rates_of(found.rates, element), now.layout.gathered(element, found.u_rate)
        report += element.report(now.around(element), rates, u_rate, detailed)
    report += satellite.control.report(found.decision)
    if satellite.steady:
        report = [output for output in report if output.quantity != ROTOR_TORQUE]
    return report


def joined(report: Iterable[Output]) -> Outputs:
    """Values by the names of their quantities."""
    return by_name((quantity.name, value) for quantity, value in report)


def geometry_margin(satellite: Satellite, state: State) -> Float[Array, ""]:
    """How far the satellite is from where some part's geometry ends [-]; zero or less there."""
    now = moving(satellite, jnp.zeros(()), state)
    return jnp.min(jnp.stack([e.margin(now.around(e)) for e in satellite.elements]))
