"""Motion of a rigid body, and how it is moved a little."""

import equinox as eqx
from jaxtyping import Array, Float

from quietbus.spatial.vector import cross


class Motion(eqx.Module):
    """Pose and speed of a body X at one instant, all components along common axes A."""

    R_AX: Float[Array, "3 3"]
    p: Float[Array, "3"]  # [m] origin of X from a point that all bodies share
    v: Float[Array, "3"]  # [m/s] of the origin of X
    w: Float[Array, "3"]  # [rad/s]

    def shifted(
        self,
        r: Float[Array, "3"],
        theta: Float[Array, "3"],
        v: Float[Array, "3"],
        w: Float[Array, "3"],
    ) -> "Motion":
        """The tangent of a displacement r, a turn theta, and of further speeds v and w."""
        return Motion(cross(theta, self.R_AX.T).T, r, v, w)
