"""Small vibration about a slow motion: what the rotors' imbalance does to the moving satellite.

The slow motion is that of the satellite with the imbalance averaged over the rotors' turns. About
it, the deviations ``xi = (r_P, theta_P, r_B, theta_B)`` of both plates (displacements and rotation
vectors), those of the gimbal angles and those of the controller's integral obey linear equations
whose coefficients change slowly. In the frame that turns with the bus they answer ``F exp(st)``
with ``xi exp(st)``, where

    (s^2 M + s C + K) xi = F + gimbals' reaction

is solved for each order of each rotor (docs/theory.md, section 14). All matrices are derivatives,
by automatic differentiation, of the equations of motion themselves.

All vectors are along the bus axes of the slow motion at the instant looked at.
"""

import equinox as eqx
import jax
import jax.numpy as jnp
import numpy as np
from jaxtyping import Array, Complex, Float

from quietbus.dynamics.closed_loop import (
    ControlSignals,
    control_signals,
    evaluate,
    external_wrench,
)
from quietbus.dynamics.equations import (
    body_force,
    body_mass_matrix,
    plate_force,
    plate_motion,
    rigid_speeds,
)
from quietbus.dynamics.kinematics import PlateMotion, leg_motion
from quietbus.dynamics.legs import leg_forces, leg_mass_matrix
from quietbus.dynamics.state import State
from quietbus.model.cmg import ORDERS, ClusterMoments
from quietbus.model.disturbance import on_plate, orders_of
from quietbus.model.satellite import Satellite
from quietbus.model.variants import without_disturbance
from quietbus.spatial.rotation import quaternion_multiply, quaternion_to_matrix, skew
from quietbus.spatial.vector import cross, dot, rotate, solve_small


class SlowMotion(eqx.Module):
    """The slow motion at one instant."""

    t: Float[Array, ""]  # [s]
    state: State
    plates: PlateMotion  # along bus axes, so that R_NB is the unit matrix
    u_rate: Float[Array, "12"]  # accelerations (dv_P, dw_P, dv_B, dw_B)
    gimbal: tuple[Float[Array, " cmg"], ...]  # angle [rad], rate and acceleration
    rotor_speed: Float[Array, " cmg"]  # [rad/s]
    rotor_acceleration: Float[Array, " cmg"] | None  # [rad/s^2]; None: constant speed

    def turning(self, moments: ClusterMoments) -> ClusterMoments:
        """The cluster's moments at the rotors' speeds of this instant."""
        if self.rotor_acceleration is None:
            return moments
        return moments.turning(self.rotor_speed, self.rotor_acceleration)


def rotor_speeds(satellite: Satellite, state: State) -> Float[Array, " cmg"]:
    """Rotor speeds [rad/s], those of the state where they change."""
    return satellite.cluster.rotor_speed if state.rotor is None else state.rotor.speed


def unit_acceleration(satellite: Satellite, signals: ControlSignals) -> Float[Array, " cmg"]:
    """What the control makes the units do [rad/s^2]: of their gimbals, or of the wheels."""
    if not satellite.cluster.wheels:
        return signals.gimbal_acceleration
    assert signals.rotor_acceleration is not None
    return signals.rotor_acceleration


def slow_motion(
    satellite: Satellite, t: Float[Array, ""], state: State, averaged: ClusterMoments
) -> SlowMotion:
    """The slow motion at time t [s]; ``averaged`` as of ``ClusterMoments.averaged``."""
    satellite = without_disturbance(satellite)
    signals, a = evaluate(satellite, t, state, jnp.zeros_like(state.gimbal_angle), averaged)
    plates, R_BN = plate_motion(state), quaternion_to_matrix(state.q_NB).T
    vectors = (plates.p_BP, plates.v_B, plates.w_B, plates.v_P, plates.w_P)
    along_bus = PlateMotion(jnp.eye(3), R_BN @ plates.R_NP, *(rotate(R_BN, v) for v in vectors))
    u_rate = jnp.stack([a.v_P, a.w_P, a.v_B, a.w_B])
    gimbal = (state.gimbal_angle, state.gimbal_rate, signals.gimbal_acceleration)
    rotor = rotor_speeds(satellite, state), signals.rotor_acceleration
    return SlowMotion(t, state, along_bus, rotate(R_BN, u_rate).reshape(12), gimbal, *rotor)


class Coefficients(eqx.Module):
    """``M du/dt = by_pose xi + by_speed u``, deviations of what acts on (v_P, w_P, v_B, w_B)."""

    M: Float[Array, "12 12"]
    by_pose: Float[Array, "12 12"]
    by_speed: Float[Array, "12 12"]
    force: Float[Array, "12"]  # f - M du/dt of the slow motion


def leg_coefficients(satellite: Satellite, slow: SlowMotion) -> Coefficients:
    """What the legs contribute."""
    legs, plates = satellite.legs, slow.plates

    def force(plates):
        return leg_forces(legs, leg_motion(legs, plates), plates, slow.u_rate)

    held, columns = _derivatives(force, plates, jnp.eye(18))
    r, theta_P, theta_B, v, w_P, w_B = jnp.split(columns, 6, axis=1)
    return Coefficients(
        M=leg_mass_matrix(legs, leg_motion(legs, plates)),
        by_pose=jnp.concatenate([r, theta_P, -r, theta_B], axis=1),
        by_speed=jnp.concatenate([v, w_P, -v, w_B], axis=1),
        force=held,
    )


def body_coefficients(
    satellite: Satellite, slow: SlowMotion, averaged: ClusterMoments
) -> Coefficients:
    """What plate, cluster, bus and external loads contribute."""
    averaged = slow.turning(averaged)
    carried = averaged.at(slow.gimbal[0], jnp.zeros_like(slow.gimbal[0]), *slow.gimbal[1:])
    R_NB = quaternion_to_matrix(slow.state.q_NB)

    def force(plates):
        own = body_force(satellite, plates, carried, slow.u_rate)
        if not satellite.loads:
            return own
        attitudes = lambda p: (p.R_NB, p.R_NP)  # noqa: E731
        inertial = eqx.tree_at(attitudes, plates, tuple(R_NB @ R for R in attitudes(plates)))
        loads = external_wrench(satellite, slow.t, inertial).on_speeds
        return own + rotate(R_NB.T, loads.reshape(4, 3)).reshape(12)

    # position and velocity of the plate do not matter to these
    ways = jnp.eye(18)[jnp.array([3, 4, 5, 6, 7, 8, 12, 13, 14, 15, 16, 17])]
    held, columns = _derivatives(force, slow.plates, ways)
    theta_P, theta_B, w_P, w_B = jnp.split(columns, 4, axis=1)
    zero = jnp.zeros((12, 3))
    return Coefficients(
        M=body_mass_matrix(satellite, slow.plates, carried),
        by_pose=jnp.concatenate([zero, theta_P, zero, theta_B], axis=1),
        by_speed=jnp.concatenate([zero, w_P, zero, w_B], axis=1),
        force=held,
    )


def _derivatives(force, plates, ways):
    """Value of ``force`` and its derivatives (12, way) along (r, theta_P, theta_B, v, w_P, w_B).

    r and v are those of the plate from the bus.
    """
    turned = lambda theta, R: cross(theta, R.T).T  # noqa: E731

    def moved(way):
        r, theta_P, theta_B, v, w_P, w_B = way.reshape(6, 3)
        turn = turned(theta_B, plates.R_NB), turned(theta_P, plates.R_NP)
        return PlateMotion(*turn, r, jnp.zeros(3), w_B, v, w_P)

    held, push = jax.linearize(force, plates)
    return held, jax.vmap(lambda way: push(moved(way)), out_axes=1)(ways)


class Control(eqx.Module):
    """How the gimbals answer the bus: ``d(gimbal acceleration, rate of the integral)``.

    Reaction wheels have their rotors' angles where CMGs have those of their gimbals.
    """

    by_attitude: Float[Array, "cmg+3 3"]  # theta_B
    by_rate: Float[Array, "cmg+3 3"]  # w_NB_B
    by_integral: Float[Array, "cmg+3 3"]
    by_angle: Float[Array, "cmg+3 cmg"]
    by_angle_rate: Float[Array, "cmg+3 cmg"]
    reaction: Float[Array, "3 n cmg"]  # on the plates, of gimbal angle, rate and acceleration

    def memory(self, s: Complex[Array, ""], given: Complex[Array, "cmg+3 3"]):
        """Gimbal angles and integral (cmg+3, 3) as controller and servo answer ``given``."""
        n = self.by_angle.shape[1]
        fed_back = jnp.concatenate([self.by_angle + s * self.by_angle_rate, self.by_integral], 1)
        own = jnp.concatenate([jnp.full(n, s**2), jnp.full(3, s)])
        return solve_small(jnp.diag(own) - fed_back, given)


class Vibration(eqx.Module):
    """Equations of small vibration at one instant, on xi or on a rigid mount on (r_B, theta_B)."""

    slow: SlowMotion
    M: Float[Array, "n n"]
    C: Float[Array, "n n"]
    K: Float[Array, "n n"]
    control: Control | None  # None where the gimbals do not move
    projection: Float[Array, "12 n"] | None  # xi of a rigid mount by (r_B, theta_B)

    @property
    def turning(self) -> Float[Array, "3 3"]:
        """[w_B x]: what the time derivative of a vector has more than that of its components."""
        return skew(self.slow.plates.w_B)

    def memory(self, s: Complex[Array, ""]) -> Complex[Array, "cmg+3 3"]:
        """Deviations of gimbal angles and integral by theta_B."""
        control = self.control
        assert control is not None
        rate = s * jnp.eye(3) + self.turning  # of the bus, along its own axes
        return control.memory(s, control.by_attitude + control.by_rate @ rate)

    def stiffness(self, s: Complex[Array, ""]) -> Complex[Array, "n n"]:
        """Dynamic stiffness of the controlled satellite."""
        Z = s**2 * self.M + s * self.C + self.K
        if self.control is None:
            return Z
        angle = self.memory(s)[:-3]
        angles = jnp.stack([angle, s * angle, s**2 * angle])
        return Z.at[:, -3:].add(-jnp.einsum("kia,kab->ib", self.control.reaction, angles))

    def respond(
        self, s: Complex[Array, ""], force: Complex[Array, "12 m"]
    ) -> Complex[Array, "12 m"]:
        """xi for forces F exp(st) on the speeds."""
        T = self.projection
        if T is None:
            return solve_small(self.stiffness(s), force)
        return T @ solve_small(self.stiffness(s), T.T @ force)

    def state_matrix(self) -> np.ndarray:
        """A of dx/dt = A x (NumPy); x: xi, its rate, gimbal angles, their rates, the integral."""
        n = len(self.M)
        pull, damp = (np.linalg.solve(self.M, -np.asarray(matrix)) for matrix in (self.K, self.C))
        if self.control is None:
            return np.block([[np.zeros((n, n)), np.eye(n)], [pull, damp]])
        control = self.control
        m = control.by_angle.shape[1]
        pad = np.zeros((m + 3, n - 3))
        turning = np.cross(self.slow.plates.w_B, np.eye(3)).T
        by_pose = control.by_attitude + control.by_rate @ turning
        decided = np.hstack(
            [
                pad,
                by_pose,
                pad,
                *(
                    getattr(control, name)
                    for name in ("by_rate", "by_angle", "by_angle_rate", "by_integral")
                ),
            ]
        )
        angle, rate, acceleration = np.linalg.solve(self.M, control.reaction)
        moved = np.hstack([pull, damp, angle, rate, np.zeros((n, 3))])
        moved = moved + acceleration @ decided[:m]
        unit = np.eye(decided.shape[1])
        return np.vstack([unit[n : 2 * n], moved, unit[2 * n + m : 2 * n + 2 * m], decided])


def vibration(
    satellite: Satellite, slow: SlowMotion, moments: ClusterMoments, legs: Coefficients
) -> Vibration:
    """Equations of small vibration about a slow motion.

    Args:
        moments: ``ClusterMoments.expand(satellite.cluster)``.
        legs: ``leg_coefficients(satellite, slow)``.
    """
    bodies = body_coefficients(satellite, slow, moments.averaged())
    all_ = jax.tree.map(jnp.add, bodies, legs)
    # du/dt = (s + W) u and u = (s + V) xi, in the frame that turns with the bus
    W = skew(slow.plates.w_B)
    V = jax.scipy.linalg.block_diag(W, W - skew(slow.plates.w_P), W, jnp.zeros((3, 3)))
    W = jnp.kron(jnp.eye(4), W)
    C = all_.M @ (W + V) - all_.by_speed
    K = all_.M @ W @ V - all_.by_pose - all_.by_speed @ V
    control = control_path(satellite, slow, moments)
    if satellite.mount == "isolated":
        return Vibration(slow, all_.M, C, K, control, None)
    T = rigid_speeds(satellite, slow.plates)
    M, C, K = (T.T @ matrix @ T for matrix in (all_.M, C, K))
    # virtual work of the mount's force, which holds the plate, as its arm turns with the bus
    K = K.at[3:, 3:].add(-skew(all_.force[:3]) @ skew(slow.plates.p_BP))
    if control is not None:
        control = eqx.tree_at(lambda c: c.reaction, control, T.T @ control.reaction)
    return Vibration(slow, M, C, K, control, T)


def control_path(satellite: Satellite, slow: SlowMotion, moments: ClusterMoments) -> Control | None:
    """Derivatives of what controller, steering and servo decide, and the gimbals' reaction."""
    if satellite.controller is None or satellite.steering is None:
        return None
    satellite = without_disturbance(satellite)
    state, n = slow.state, len(slow.gimbal[0])

    def decide(theta, rate, integral, angle, angle_rate):
        small = jnp.concatenate([jnp.ones(1), 0.5 * theta])
        moved = eqx.tree_at(
            lambda s: (s.q_NB, s.w_NB_B, s.error_integral),
            with_units_moved(satellite, state, angle, angle_rate),
            (
                quaternion_multiply(state.q_NB, small),
                state.w_NB_B + rate,
                state.error_integral + integral,
            ),
        )
        signals = control_signals(satellite, slow.t, moved)
        return jnp.concatenate([unit_acceleration(satellite, signals), signals.integral_rate])

    nothing = (jnp.zeros(3), jnp.zeros(3), jnp.zeros(3), jnp.zeros(n), jnp.zeros(n))
    by = jax.jacfwd(decide, argnums=tuple(range(5)))(*nothing)
    reaction = gimbal_reaction(slow, moments, satellite.cluster.wheels)
    return Control(by[0], by[1], by[2], by[3], by[4], reaction)


def gimbal_reaction(
    slow: SlowMotion, moments: ClusterMoments, wheels: bool = False
) -> Float[Array, "3 12 cmg"]:
    """Forces on (v_P, w_P, v_B, w_B) by each gimbal's angle, rate and acceleration.

    Args:
        wheels: by those of each rotor instead.
    """

    def reaction(unit):
        push = jax.vmap(plate_force, (None, 0, None))
        if wheels:
            mean = moments.turning(*unit[1:]).order(0, *slow.gimbal)
        else:
            mean = slow.turning(moments).order(0, *unit)
        return push(slow.plates, mean, slow.u_rate[:6])

    unit = slow.gimbal
    if wheels:
        assert slow.state.rotor is not None
        assert slow.rotor_acceleration is not None
        unit = (slow.state.rotor.angle, slow.rotor_speed, slow.rotor_acceleration)

    # each unit's reaction is its own: one derivative for all units at once
    n = len(slow.gimbal[0])
    ways = [tuple(jnp.full(n, float(i == k)) for i in range(3)) for k in range(3)]
    reactions = jnp.stack([jax.jvp(reaction, (unit,), (way,))[1].T for way in ways])
    return jnp.pad(reactions, ((0, 0), (0, 6), (0, 0)))


def with_units_moved(
    satellite: Satellite,
    state: State,
    angle: Float[Array, " cmg"],
    angle_rate: Float[Array, " cmg"],
) -> State:
    """The state with gimbals, or wheels, at other angles and rates by these [rad], [rad/s]."""
    if satellite.cluster.wheels:
        where = lambda s: (s.rotor.angle, s.rotor.speed)  # noqa: E731
    else:
        where = lambda s: (s.gimbal_angle, s.gimbal_rate)  # noqa: E731
    old_angle, old_rate = where(state)
    return eqx.tree_at(where, state, (old_angle + angle, old_rate + angle_rate))


def rotor_forces(
    satellite: Satellite, slow: SlowMotion, moments: ClusterMoments
) -> Complex[Array, "order cmg 12"]:
    """Amplitudes of the forces on (v_P, w_P, v_B, w_B) at each order of each rotor."""
    push, moments = jax.vmap(plate_force, (None, 0, None)), slow.turning(moments)
    imbalance = jnp.stack(
        [push(slow.plates, moments.order(h, *slow.gimbal), slow.u_rate[:6]) for h in ORDERS]
    )
    disturbance = satellite.disturbance
    if disturbance is not None:
        lines = disturbance.amplitudes(satellite.cluster, slow.rotor_speed)
        lines = on_bus(slow, on_plate(satellite.cluster, slow.gimbal[0], lines))
        at = jnp.array(disturbance.imbalance_at)
        imbalance = jnp.swapaxes(lines, 0, 1).at[at].add(imbalance)
    return jnp.pad(imbalance, ((0, 0), (0, 0), (0, 6)))


def on_bus(slow: SlowMotion, wrench: Complex[Array, "*n 6"]) -> Complex[Array, "*n 6"]:
    """Forces and torques on the plate, turned from its axes to those of the bus."""
    vectors = wrench.reshape(*wrench.shape[:-1], 2, 3)
    return rotate(slow.plates.R_NP, vectors).reshape(wrench.shape)


def rotor_response(
    satellite: Satellite, small: Vibration, moments: ClusterMoments, one_speed: bool = False
) -> Complex[Array, "cmg order 12"]:
    """xi of the steady response to each order of each rotor, Re(xi exp(i h phi)).

    Args:
        moments: ``ClusterMoments.expand(satellite.cluster)``.
        one_speed: all rotors turn at one speed, so that one elimination serves them all.
    """

    def respond(h, speed, force):
        s = 1j * h * speed
        standing = s == 0.0  # a rotor that stands still shakes nothing
        return jnp.where(standing, 0.0, small.respond(jnp.where(standing, 1j, s), force))

    forces = rotor_forces(satellite, small.slow, moments)
    h = orders_of(satellite.disturbance)
    if one_speed:
        columns = jnp.swapaxes(forces, 1, 2)
        xi = jax.vmap(respond, (0, None, 0))(h, small.slow.rotor_speed[0], columns)
        return jnp.moveaxis(xi, 2, 0)
    each = jax.vmap(jax.vmap(respond, (None, 0, 0)), (0, None, 0))
    return jnp.swapaxes(each(h, small.slow.rotor_speed, forces[..., None])[..., 0], 0, 1)


class View(eqx.Module):
    """What of the bus is looked at, beyond the usual outputs."""

    point_B: Float[Array, "point 3"]  # [m] where accelerations are wanted
    # [rad per rad, m] image motion by turn and displacement of the bus, and by those of the plate
    # from its place in the bus
    line_of_sight: Float[Array, "line 3 12"]


NOTHING_SEEN = View(np.zeros((0, 3)), np.zeros((0, 3, 12)))  # type: ignore[arg-type]


def image_motions(p_BP: Float[Array, "3"]) -> Float[Array, "12 12"]:
    """What moves images, as the columns of ``View.line_of_sight``, by xi.

    Args:
        p_BP: plate in the bus [m].
    """
    one, zero = jnp.eye(3), jnp.zeros((3, 3))
    rows = [
        [zero, zero, zero, one],
        [zero, zero, one, zero],
        [zero, one, zero, -one],
        [one, zero, -one, skew(p_BP)],  # -theta_B x p_BP
    ]
    return jnp.block(rows)


def linear_outputs(
    satellite: Satellite,
    small: Vibration,
    s: Complex[Array, ""],
    xi: Complex[Array, "12"],
    view: View,
) -> dict[str, Complex[Array, "..."]]:
    """Deviations of the outputs, by their names in a run, for one response xi exp(st)."""
    legs, plates = satellite.legs, small.slow.plates
    r_P, theta_P, r_B, theta_B = xi.reshape(4, 3)
    motion = leg_motion(legs, plates)
    joints = r_P + cross(theta_P, motion.r_U) - r_B - cross(theta_B, motion.r_A)
    stroke = dot(motion.s, joints)
    at, one = (motion.length, motion.length_rate), jnp.ones_like(motion.length)
    _, spring = jax.jvp(legs.strut_force, at, (one, 0.0 * one))
    _, damper = jax.jvp(legs.strut_force, at, (0.0 * one, one))
    turning = s * jnp.eye(3) + small.turning
    point = r_B + cross(theta_B, view.point_B)
    return {
        "bus_rate": turning @ theta_B,
        "bus_attitude": theta_B,
        "platform_rate": plates.R_NP.T @ turning @ theta_P,
        "leg_stroke": stroke,
        "leg_force": (spring + s * damper) * stroke,
        "point_acceleration": rotate(turning @ turning, point),
        "line_of_sight": view.line_of_sight @ (image_motions(plates.p_BP) @ xi),
    }
