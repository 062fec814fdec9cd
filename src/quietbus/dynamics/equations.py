"""Kane's equations of all parts: ``M du/dt = f``, summed from the elements' shares.

Derivation: docs/theory.md. Vectors are along the axes of the motions they belong to, inertial ones
unless ``Moving.along`` has turned them.
"""

import equinox as eqx
import jax.numpy as jnp
from jaxtyping import Array, Float

from quietbus.dynamics.layout import Layout
from quietbus.dynamics.state import State
from quietbus.dynamics.welds import Welds
from quietbus.model.alike import of_each
from quietbus.model.element import NOTHING, AbstractElement, Around, Own, Rates
from quietbus.model.motion import Motion
from quietbus.model.satellite import Satellite
from quietbus.spatial.rotation import quaternion_to_matrix
from quietbus.spatial.vector import rotate, solve_positive_definite


class Moving(eqx.Module):
    """Motion of all bodies, welded ones too, and the elements' own, at one instant."""

    t: Float[Array, ""]  # [s]
    R_AN: Float[Array, "3 3"]  # takes inertial components to the axes A of the motions
    motions: dict[str, Motion]
    own: dict[str, Own]
    layout: Layout = eqx.field(static=True)

    def around(self, element: AbstractElement) -> Around:
        """What an element may depend on."""
        hosts = tuple(self.motions[host] for host in element.hosts)
        return Around(self.t, self.R_AN, hosts, self.own.get(element.name, NOTHING))

    def along(self, body: str) -> "Moving":
        """The same along the axes of a body, from its origin."""
        base = self.motions[body]
        R = base.R_AX.T
        turned = {
            name: Motion(R @ m.R_AX, rotate(R, m.p - base.p), rotate(R, m.v), rotate(R, m.w))
            for name, m in self.motions.items()
        }
        return Moving(self.t, R @ self.R_AN, turned, self.own, self.layout)


def moving(satellite: Satellite, t: Float[Array, ""], state: State) -> Moving:
    """All motions at a state, inertial axes."""
    motions = {}
    for name, body in state.bodies.items():
        R = quaternion_to_matrix(body.q_NX)
        motions[name] = Motion(R, body.p_NX_N, body.v_NX_N, rotate(R, body.w_NX_X))
    for mount in satellite.mounts:
        if mount.welded:
            motions[mount.body] = mount.motion(motions[mount.base])
    return Moving(t, jnp.eye(3), motions, state.own, Layout.of(satellite, state))


def accelerations(
    satellite: Satellite,
    now: Moving,
    rates: dict[str, Rates],
    extra: Float[Array, " n"] | float = 0.0,
) -> Float[Array, " n"]:
    """du/dt of all bodies and own coordinates.

    Args:
        rates: of the elements that have any.
        extra: further forces on the speeds.
    """
    welds = Welds(satellite, now.layout, now.motions)
    at_rest = welds.spread(jnp.zeros(welds.free.size))
    f = welds.onto_free(balance(satellite, now, rates, at_rest) + extra)
    M = welds.onto_free(welds.onto_free(mass_matrix(satellite, now)).T)
    return welds.spread(solve_positive_definite(M, f))


def mass_matrix(satellite: Satellite, now: Moving) -> Float[Array, "n n"]:
    """M of ``M du/dt = f`` on all speeds."""
    elements = satellite.elements
    shares = of_each(lambda e, around: e.mass(around), elements, map(now.around, elements))
    return now.layout.matrix(zip(elements, shares, strict=True))


def balance(
    satellite: Satellite, now: Moving, rates: dict[str, Rates], u_rate: Float[Array, " n"]
) -> Float[Array, " n"]:
    """``f - M du/dt`` on all speeds."""
    elements = satellite.elements
    shares = of_each(
        lambda e, around, rates, u_rate: e.balance(around, rates, u_rate),
        elements,
        map(now.around, elements),
        (rates_of(rates, e) for e in elements),
        (now.layout.gathered(e, u_rate) for e in elements),
    )
    return now.layout.vector(zip(elements, shares, strict=True))


def rates_of(rates: dict[str, Rates], element: AbstractElement) -> Rates:
    """An element's rates, of one that has none too."""
    return rates.get(element.name, _NO_RATES)


_NO_RATES = Rates(NOTHING.y, NOTHING.z)
