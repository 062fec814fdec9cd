"""What of a small vibration is looked at: the outputs' deviations."""

from collections.abc import Callable
from functools import partial

import equinox as eqx
import jax.numpy as jnp
import numpy as np
from jaxtyping import Array, Complex, Float

from quietbus.dynamics.vibration import Vibration
from quietbus.model.body import body_quantities
from quietbus.model.motion import Motion
from quietbus.model.report import AXIS, Quantity
from quietbus.model.satellite import BUS, Satellite
from quietbus.spatial.rotation import skew
from quietbus.spatial.vector import cross, rotate

POINT_ACCELERATION = Quantity(
    "point_acceleration",
    ("point", *AXIS),
    "m/s^2",
    "inertial acceleration of a point of the bus, bus frame",
    vibrates=True,
)
LINE_OF_SIGHT = Quantity(
    "line_of_sight",
    ("line", *AXIS),
    "rad",
    "motion of a line of sight, across it, bus frame",
    vibrates=True,
)
QUANTITIES = (POINT_ACCELERATION, LINE_OF_SIGHT)
IMAGE = 12  # motions that move an image


class View(eqx.Module):
    """What is looked at beyond the usual outputs."""

    point_B: Float[Array, "point 3"]  # [m] of the bus, where accelerations are wanted
    # [rad per rad, m] image motion by turn and displacement of the body that a line of sight is
    # on, and by those of another body from their places in this one
    line_of_sight: Float[Array, "line 3 12"]
    on: tuple[tuple[str, str], ...] = eqx.field(static=True, default=())  # bodies of each line

    def bodies(self, satellite: Satellite) -> tuple[tuple[str, str], ...]:
        """The two bodies of each line; by default the bus and what stands on it first."""
        default = (BUS, satellite.mounts[0].body if satellite.mounts else BUS)
        return self.on or (default,) * len(self.line_of_sight)


NOTHING_SEEN = View(np.zeros((0, 3)), np.zeros((0, 3, IMAGE)))  # type: ignore[arg-type]


def image_motions(
    base: Motion,
    other: Motion,
    x_base: Array,
    x_other: Array,
) -> Array:
    """What moves images (12,) or (12, k), as the columns of ``View.line_of_sight``.

    Args:
        x_base, x_other: (6,) or (6, k) displacement and turn of both bodies, along the same axes.
    """
    (r, theta), (r_o, theta_o) = (x_base[:3], x_base[3:]), (x_other[:3], x_other[3:])
    arm = skew(other.p - base.p)
    return jnp.concatenate([theta, r, theta_o - theta, r_o - r + arm @ theta])  # - theta x arm


def linear_outputs(
    satellite: Satellite,
    small: Vibration,
    s: Complex[Array, ""],
    xi: Complex[Array, " m"],
    view: View,
) -> dict[str, Complex[Array, "..."]]:
    """Deviations of the outputs, by their names in a run, for one response xi exp(st)."""
    return linear_outputs_with(satellite, small, s, xi, view, partial(small.remembered, s, xi))


def linear_outputs_with(
    satellite: Satellite,
    small: Vibration,
    s: Complex[Array, ""],
    xi: Complex[Array, " m"],
    view: View,
    remembered: Callable[[], Complex[Array, " z"]],
) -> dict[str, Complex[Array, "..."]]:
    """The same where drives and memories are moved by something else than the bodies alone.

    Args:
        remembered: their deviations; asked for where some output depends on them.
    """
    layout, motions = small.slow.now.layout, small.slow.now.motions
    xi_all = small.projection @ xi
    turning = s * jnp.eye(3) + small.turning
    found: dict[str, Complex[Array, "..."]] = {}
    for body in satellite.bodies:
        theta = xi_all[layout.rows(body.name)][3:]
        quantity = body_quantities(body.name)
        found[quantity["rate"].name] = motions[body.name].R_AX.T @ turning @ theta
        if quantity["attitude"].vibrates:
            found[quantity["attitude"].name] = theta
    speed = s * xi_all + small.speed @ xi_all
    for name, seen in small.seen.items():
        found[name] = seen.by_pose @ xi_all + seen.by_speed @ speed
        if seen.by_z.shape[-1]:
            found[name] = found[name] + seen.by_z @ remembered()[small.memory.layout.driven :]
    x_B = xi_all[layout.rows(BUS)]
    point = x_B[:3] + cross(x_B[3:], view.point_B)
    found[POINT_ACCELERATION.name] = rotate(turning @ turning, point)
    lines = images(satellite, small, view, xi_all)
    found[LINE_OF_SIGHT.name] = jnp.stack(lines) if lines else jnp.zeros((0, 3), xi.dtype)
    return found


def images(satellite: Satellite, small: Vibration, view: View, x: Array) -> list[Array]:
    """Motion of each line's image (3, ...) by x (n, ...), displacements and turns of all bodies."""
    layout, motions = small.slow.now.layout, small.slow.now.motions
    return [
        line @ image_motions(motions[on], motions[of], *(x[layout.rows(b)] for b in (on, of)))
        for line, (on, of) in zip(view.line_of_sight, view.bodies(satellite), strict=True)
    ]
