"""What changes in time."""

import equinox as eqx
from jaxtyping import Array, Float

from quietbus.model.element import Own


class BodyState(eqx.Module):
    """Pose and speed of a body X that moves on its own."""

    p_NX_N: Float[Array, "3"]  # [m] origin of its frame; the bus's is its mass centre
    q_NX: Float[Array, "4"]  # [-] attitude
    v_NX_N: Float[Array, "3"]  # [m/s]
    w_NX_X: Float[Array, "3"]  # [rad/s]


class State(eqx.Module):
    """Motion of the free bodies, and what elements and control have of their own.

    Bodies that are welded to others add nothing, nor do legs: their two ends fix them.
    """

    bodies: dict[str, BodyState]
    own: dict[str, Own]

    @property
    def bus(self) -> BodyState:
        """Motion of the controlled body."""
        return self.bodies["bus"]
