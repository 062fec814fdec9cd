"""Small vibration about a slow motion: what the rotors' imbalance does to the moving satellite.

The slow motion is that of the satellite with the imbalance averaged over the rotors' turns. About
it, the deviations ``xi = (r_P, theta_P, r_B, theta_B)`` of both plates (displacements and rotation
vectors), those of the gimbal angles and those of the controller's integral obey linear equations
with coefficients that change slowly. In a frame that turns with the bus they answer ``F exp(st)``
with ``X exp(st)``, and

    Z(s) X = F,    Z(s) = s^2 M + s C + K + (gyroscopic, control and gimbal terms)

is solved for each order of each rotor (docs/theory.md, section 13). All matrices are derivatives,
by automatic differentiation, of the equations of motion themselves.

Vectors are in inertial components, which at the instant looked at are those of the turning frame.
"""

import equinox as eqx
import jax
import jax.numpy as jnp
from jaxtyping import Array, Complex, Float

from quietbus.dynamics.closed_loop import control_signals, evaluate, external_wrench
from quietbus.dynamics.equations import (
    mass_and_force,
    plate_mass_and_force,
    plate_motion,
    rigid_speeds,
)
from quietbus.dynamics.kinematics import PlateMotion
from quietbus.dynamics.state import State
from quietbus.model.cmg import ORDERS, ClusterMoments
from quietbus.model.satellite import Satellite
from quietbus.spatial.rotation import quaternion_multiply, skew
from quietbus.spatial.vector import cross


class Vibration(eqx.Module):
    """Coefficients of the linear equations of small vibration at one instant.

    ``M du/dt = by_pose xi + by_speed u + by_gimbal (gamma, dgamma/dt, d2gamma/dt2) + F``, all of
    them deviations, on the speeds (v_P, w_P, v_B, w_B).
    """

    plates: PlateMotion  # of the slow motion
    M: Float[Array, "12 12"]
    by_pose: Float[Array, "12 12"]  # on xi
    by_speed: Float[Array, "12 12"]
    by_gimbal: Float[Array, "12 3 cmg"]
    holding: Float[Array, "12"]  # force of a rigid mount in the slow motion; 0 if isolated
    # d(gimbal acceleration, rate of the integral) by theta_B, w_NB_B, integral, gamma, dgamma/dt
    control: Float[Array, "cmg+3 9+2*cmg"] | None  # None where the gimbals do not move
    projection: Float[Array, "12 6"] | None  # of a rigid mount

    def stiffness(self, s: Complex[Array, ""]) -> Complex[Array, "n n"]:
        """Dynamic stiffness Z(s), 12 x 12, or 6 x 6 on a rigid mount; control included."""
        speed, turn_B = self.speeds(s), self.turning(s)
        along = jnp.kron(jnp.eye(4), turn_B)
        Z = self.M @ (along @ speed) - self.by_pose - self.by_speed @ speed
        gimbal = self.gimbals(s)
        if gimbal is not None:
            powers = jnp.array([1.0, s, s**2])
            Z = Z.at[:, 9:].add(-jnp.einsum("ikj,k,ja->ia", self.by_gimbal, powers, gimbal))
        if self.projection is None:
            return Z
        # virtual work of the mount's force as its arm turns with the bus
        arm = skew(self.holding[:3]) @ skew(self.plates.p_BP)
        Z = self.projection.T @ Z @ self.projection
        return Z.at[3:, 3:].add(-arm)

    def turning(self, s: Complex[Array, ""]) -> Complex[Array, "3 3"]:
        """d/dt of a vector whose components in the turning frame go as exp(st)."""
        return s * jnp.eye(3) + skew(self.plates.w_B)

    def speeds(self, s: Complex[Array, ""]) -> Complex[Array, "12 12"]:
        """Deviations of (v_P, w_P, v_B, w_B) by xi."""
        turn = self.turning(s)
        blocks = (turn, turn - skew(self.plates.w_P), turn, turn - skew(self.plates.w_B))
        return jax.scipy.linalg.block_diag(*blocks)

    def gimbals(self, s: Complex[Array, ""]) -> Complex[Array, "cmg 3"] | None:
        """Deviations of the gimbal angles by theta_B, through controller, steering and servo."""
        if self.control is None:
            return None
        n = self.by_gimbal.shape[2]
        attitude, rate, integral, gamma, gamma_rate = jnp.split(
            self.control, [3, 6, 9, 9 + n], axis=1
        )
        memory = jnp.concatenate([gamma + s * gamma_rate, integral], axis=1)
        own = jnp.diag(jnp.concatenate([jnp.full(n, s**2), jnp.full(3, s)])) - memory
        # the bus rate's components turn with the bus
        given = attitude + rate @ self.plates.R_NB.T @ self.turning(s)
        return jnp.linalg.solve(own, given)[:n]

    def respond(self, s: Complex[Array, ""], force: Complex[Array, "12"]) -> Complex[Array, "12"]:
        """xi for a force F exp(st) on the speeds."""
        if self.projection is None:
            return jnp.linalg.solve(self.stiffness(s), force)
        T = self.projection
        return T @ jnp.linalg.solve(self.stiffness(s), T.T @ force)


def vibration(
    satellite: Satellite, t: Float[Array, ""], state: State, averaged: ClusterMoments
) -> tuple[Vibration, Float[Array, "12"], Float[Array, " cmg"]]:
    """Equations of small vibration about a slow motion.

    Args:
        t: time [s].
        state: of the slow motion.
        averaged: ``ClusterMoments.expand(satellite.cluster).averaged()``.

    Returns:
        The equations; accelerations of the slow motion (dv_P, dw_P, dv_B, dw_B); its gimbal
        accelerations [rad/s^2].
    """
    n = len(state.gimbal_angle)
    still = jnp.zeros(n)
    signals, a = evaluate(satellite, t, state, still, averaged)
    u_rate = jnp.concatenate([a.v_P, a.w_P, a.v_B, a.w_B])
    plates = plate_motion(state)
    gimbal = (state.gimbal_angle, state.gimbal_rate, signals.gimbal_acceleration)

    def carried(gimbal):
        return averaged.at(gimbal[0], still, *gimbal[1:])

    def force(plates):
        """f - M du/dt + loads, with the mass matrix on the way."""
        M, f = mass_and_force(satellite, plates, carried(gimbal))
        return f - M @ u_rate + external_wrench(satellite, t, plates).on_speeds, M

    def on_plate(gimbal):
        M, f = plate_mass_and_force(plates, carried(gimbal))
        return jnp.concatenate([f - M @ u_rate[:6], jnp.zeros(6)])

    residual, push, M = jax.linearize(force, plates, has_aux=True)
    columns = jax.vmap(lambda way: push(_tangent(plates, way)), out_axes=1)(jnp.eye(18))
    r, theta_P, theta_B, v, w_P, w_B = jnp.split(columns, 6, axis=1)
    return (
        Vibration(
            plates=plates,
            M=M,
            by_pose=jnp.concatenate([r, theta_P, -r, theta_B], axis=1),
            by_speed=jnp.concatenate([v, w_P, -v, w_B], axis=1),
            by_gimbal=jnp.stack(jax.jacfwd(on_plate)(gimbal), axis=1),
            holding=residual,
            control=_control(satellite, t, state),
            projection=rigid_speeds(satellite, plates) if satellite.mount == "rigid" else None,
        ),
        u_rate,
        signals.gimbal_acceleration,
    )


def _tangent(plates: PlateMotion, way: Float[Array, "18"]) -> PlateMotion:
    """Change of the plates' motion by (r, theta_P, theta_B, v, w_P, w_B), r and v of P from B."""
    r, theta_P, theta_B, v, w_P, w_B = way.reshape(6, 3)
    turned = lambda theta, R: cross(theta, R.T).T  # noqa: E731
    return PlateMotion(
        R_NB=turned(theta_B, plates.R_NB),
        R_NP=turned(theta_P, plates.R_NP),
        p_BP=r,
        v_B=jnp.zeros(3),
        w_B=w_B,
        v_P=v,
        w_P=w_P,
    )


def _control(satellite, t, state):
    """Derivatives of what controller, steering and servo decide (see ``Vibration.control``)."""
    if satellite.controller is None or satellite.steering is None:
        return None
    n = len(state.gimbal_angle)

    def decide(theta, rate, integral, gamma, gamma_rate):
        small = jnp.concatenate([jnp.ones(1), 0.5 * theta])
        moved = eqx.tree_at(
            lambda s: (s.q_NB, s.w_NB_B, s.error_integral, s.gimbal_angle, s.gimbal_rate),
            state,
            (
                quaternion_multiply(small, state.q_NB),
                state.w_NB_B + rate,
                state.error_integral + integral,
                state.gimbal_angle + gamma,
                state.gimbal_rate + gamma_rate,
            ),
        )
        signals = control_signals(satellite, t, moved)
        return jnp.concatenate([signals.gimbal_acceleration, signals.integral_rate])

    nothing = (jnp.zeros(3), jnp.zeros(3), jnp.zeros(3), jnp.zeros(n), jnp.zeros(n))
    return jnp.concatenate(jax.jacfwd(decide, argnums=tuple(range(5)))(*nothing), axis=1)


class RotorResponse(eqx.Module):
    """Steady response to every order of every rotor; deviations are Re(... exp(i h phi_j))."""

    s: Complex[Array, "cmg order"]  # [rad/s] i h Omega_j
    xi: Complex[Array, "cmg order 12"]  # [m, rad] of (r_P, theta_P, r_B, theta_B)


def rotor_response(
    satellite: Satellite, t: Float[Array, ""], state: State, moments: ClusterMoments
) -> tuple[Vibration, RotorResponse]:
    """Response to all rotors' imbalance about a slow motion.

    Args:
        t: time [s].
        state: of the slow motion.
        moments: ``ClusterMoments.expand(satellite.cluster)``.
    """
    small, u_rate, gimbal_acceleration = vibration(satellite, t, state, moments.averaged())
    orders = moments.orders(state.gimbal_angle, state.gimbal_rate, gimbal_acceleration)

    def one(carried, s):
        M, f = plate_mass_and_force(small.plates, carried)
        force = jnp.concatenate([f - M @ u_rate[:6], jnp.zeros(6)])
        # a rotor that stands still turns nothing: what its imbalance does is in the slow motion
        at_rest = s == 0.0
        xi = small.respond(jnp.where(at_rest, 1j, s), force)
        return jnp.where(at_rest, 0.0, xi)

    s = 1j * jnp.array(ORDERS) * satellite.cluster.rotor_speed[:, None]
    return small, RotorResponse(s, jax.vmap(jax.vmap(one))(orders, s))


def bus_rate(small: Vibration, response: RotorResponse) -> Complex[Array, "cmg order 3"]:
    """Amplitudes of the bus rate [rad/s], bus axes."""
    turn = jax.vmap(jax.vmap(small.turning))(response.s)
    return jnp.einsum("joac,joc,ab->job", turn, response.xi[..., 9:], small.plates.R_NB)
