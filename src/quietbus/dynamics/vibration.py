"""Small vibration about a slow motion: what the rotors' imbalance does to the moving satellite.

The slow motion is that of the satellite with the imbalance averaged over the rotors' turns. About
it, the deviations xi of all free bodies (displacement and rotation vector of each) and of own
coordinates, and those of drives and memories (``dynamics.memory``), obey linear equations whose
coefficients change slowly. In the frame that turns with the bus they answer ``F exp(st)`` with
``xi exp(st)``, where

    (s^2 M + s C + K) xi = F + reaction of drives and memories

is solved for each order of each rotor (docs/theory.md, section 14). All matrices are derivatives,
by automatic differentiation, of the equations of motion themselves.

All vectors are along the bus axes of the slow motion at the instant looked at.
"""

import equinox as eqx
import jax
import jax.numpy as jnp
import numpy as np
from jaxtyping import Array, Complex, Float

from quietbus.dynamics.coefficients import Coefficients, Seen, SlowMotion, coefficients
from quietbus.dynamics.equations import rates_of
from quietbus.dynamics.layout import Layout
from quietbus.dynamics.memory import Answering, Memory, memory
from quietbus.dynamics.welds import Welds
from quietbus.model.element import AbstractElement
from quietbus.model.motion import Motion
from quietbus.model.report import by_name
from quietbus.model.satellite import BUS, Satellite
from quietbus.spatial.rotation import skew
from quietbus.spatial.vector import solve_small


class Vibration(eqx.Module):
    """Equations of small vibration at one instant, on the free bodies and own coordinates."""

    slow: SlowMotion
    free: Layout = eqx.field(static=True)
    M: Float[Array, "m m"]
    C: Float[Array, "m m"]
    K: Float[Array, "m m"]
    memory: Memory
    projection: Float[Array, "n m"]  # xi of all bodies by that of the free ones
    speed: Float[Array, "n n"]  # what u = (s + speed) xi has more than xi's time derivative
    seen: dict[str, Seen]  # what elements tell, by xi and u of all bodies, and memory

    @property
    def turning(self) -> Float[Array, "3 3"]:
        """[w_B x]: what the time derivative of a vector has more than that of its components."""
        return skew(self.slow.now.motions[BUS].w)

    @property
    def turn(self) -> Float[Array, "m m"]:
        """The same of xi of the free bodies."""
        return _of_bodies(self.free, [self.turning] * (2 * len(self.free.names)))

    @property
    def rows(self) -> slice:
        """Rows of the bus's rotation vector among the free ones."""
        rows = self.free.rows(BUS)
        return slice(rows.start + 3, rows.stop)

    def given(self, s: Complex[Array, ""]) -> Complex[Array, "m c"]:
        """What drives and memories are given by the bodies' deviations that they depend on."""
        turns = len(self.memory.layout.columns) // 3
        turn = jnp.kron(jnp.eye(turns), self.turning)
        rate = s * jnp.eye(3 * turns) + turn
        return self.memory.by_pose + self.memory.by_rate @ rate

    def answer(self, s: Complex[Array, ""]) -> Complex[Array, "m c"]:
        """Deviations of drives and memories by those of the bodies that they depend on."""
        return self.memory.answer(s, self.given(s))

    def remembered(self, s: Complex[Array, ""], xi: Complex[Array, " f"]) -> Complex[Array, " m"]:
        """Deviations of drives and memories in a response xi of the free bodies."""
        return self.answer(s) @ xi[np.array(self.memory.layout.columns, int)]

    def stiffness(self, s: Complex[Array, ""]) -> Complex[Array, "m m"]:
        """Dynamic stiffness of the controlled satellite."""
        Z = s**2 * self.M + s * self.C + self.K
        columns = np.array(self.memory.layout.columns, int)
        if not len(columns):
            return Z
        return Z.at[:, columns].add(-self.memory.force(s, self.answer(s)))

    def respond(self, s: Complex[Array, ""], force: Complex[Array, "n k"]) -> Complex[Array, "m k"]:
        """xi of the free bodies for forces F exp(st) on the speeds of all."""
        return solve_small(self.stiffness(s), self.onto_free(force))

    def onto_free(self, force: Complex[Array, "n k"]) -> Complex[Array, "m k"]:
        """Forces on the speeds of all bodies as forces on the free ones."""
        return force if self.free == self.slow.now.layout else self.projection.T @ force

    def state_matrix(self) -> np.ndarray:
        """A of dx/dt = A x (NumPy); x: xi, its rate, driven coordinates, their rates, memory."""
        m, memory = len(self.M), self.memory
        ny, nz = memory.layout.driven, memory.layout.kept
        pull, damp = (np.linalg.solve(self.M, -np.asarray(matrix)) for matrix in (self.K, self.C))
        columns = np.array(memory.layout.columns, int)
        turn = np.kron(np.eye(len(columns) // 3), np.asarray(self.turning))
        pose, rate = np.zeros((2, ny + nz, m))
        pose[:, columns] = memory.by_pose + memory.by_rate @ turn
        rate[:, columns] = memory.by_rate
        decided = np.hstack([pose, rate, memory.by_y, memory.by_y_rate, memory.by_z])
        angle, speed, acceleration = np.linalg.solve(self.M, memory.reaction)
        push = np.linalg.solve(self.M, memory.push)
        moved = np.hstack([pull, damp, angle, speed, push]) + acceleration @ decided[:ny]
        unit = np.eye(decided.shape[1])
        return np.vstack([unit[m : 2 * m], moved, unit[2 * m + ny : 2 * m + 2 * ny], decided])


Shares = list[tuple[AbstractElement, Coefficients]]


def actuator_reactions(averaged: Satellite, slow: SlowMotion) -> Float[Array, "3 n command"]:
    """Forces on all speeds by what actuators drive, its rates and second derivatives.

    Whether the control acts or not; a command is the rate of gimbals, the torque of wheels.
    """
    layout, parts = slow.now.layout, [jnp.zeros((3, slow.now.layout.size, 0))]
    for actuator in averaged.actuators:
        around, rates = slow.now.around(actuator), rates_of(slow.rates, actuator)
        each = actuator.answer(around, rates, layout.gathered(actuator, slow.u_rate))
        parts.append(jnp.stack([layout.vector([(actuator, part)]) for part in each]))
    return jnp.concatenate(parts, axis=2)


def sampled_coefficients(satellite: Satellite, slow: SlowMotion) -> tuple[Coefficients, ...]:
    """What the elements contribute whose linearisation is sampled along a motion."""
    return tuple(coefficients([e for e in satellite.elements if e.sampled], slow))


def vibration(averaged: Satellite, slow: SlowMotion) -> Vibration:
    """Equations of small vibration about a slow motion of ``Satellite.averaged()``."""
    return vibration_with(averaged, slow, sampled_coefficients(averaged, slow))


def vibration_with(
    averaged: Satellite, slow: SlowMotion, sampled: tuple[Coefficients, ...]
) -> Vibration:
    """The same with known ``sampled_coefficients``."""
    known = iter(sampled)
    others = iter(coefficients([e for e in averaged.elements if not e.sampled], slow))
    shares: Shares = [(e, next(known if e.sampled else others)) for e in averaged.elements]
    layout, motions = slow.now.layout, slow.now.motions
    M, by_pose, by_speed = (
        layout.matrix((e, getattr(c, name)) for e, c in shares)
        for name in ("M", "by_pose", "by_speed")
    )
    force = layout.vector((e, c.force) for e, c in shares)
    # du/dt = (s + W) u and u = (s + V) xi, in the frame that turns with the bus
    W, V = _turning(layout, motions)
    C = M @ (W + V) - by_speed
    K = M @ W @ V - by_pose - by_speed @ V
    welds = Welds(averaged, layout, motions)
    T = welds.speeds()
    if welds.welded:
        M, C, K = (T.T @ matrix @ T for matrix in (M, C, K))
        K = K - _by_arms(averaged, layout, motions, T, force)
    answering = Answering.of(averaged, slow.state, welds.free)
    remembers = memory(averaged, slow, answering, shares)
    where = lambda m: (m.reaction, m.push)  # noqa: E731
    onto_free = (jnp.einsum("nm,kna->kma", T, remembers.reaction), T.T @ remembers.push)
    remembers = eqx.tree_at(where, remembers, onto_free)
    seen = _seen(layout, answering, shares)
    return Vibration(slow, welds.free, M, C, K, remembers, T, V, seen)


def _turning(layout: Layout, motions: dict[str, Motion]):
    """W and V of ``du/dt = (s + W) u``, ``u = (s + V) xi``, for all speeds."""
    W = skew(motions[BUS].w)
    V = []
    for name in layout.names:
        V += [W, W - skew(motions[name].w)]
    return _of_bodies(layout, [W] * len(V)), _of_bodies(layout, V)


def _of_bodies(layout: Layout, blocks: list[Array]) -> Float[Array, "n n"]:
    """A matrix of blocks for the bodies' vectors, with nothing for own speeds."""
    own = layout.size - 3 * len(blocks)
    return jax.scipy.linalg.block_diag(*blocks, jnp.zeros((own, own)))


def _by_arms(satellite, layout, motions, T, force):
    """Change of forces on free bodies as the arms of what is welded to them turn."""

    def onto_free(xi):
        moved = {}
        for name, motion in motions.items():
            r = T[layout.rows(name)][:3] @ xi
            moved[name] = eqx.tree_at(lambda m: m.p, motion, motion.p + r)
        return Welds(satellite, layout, moved).onto_free(force)

    return jax.jacfwd(onto_free)(jnp.zeros(T.shape[1]))


def _seen(layout: Layout, answering: Answering, shares: Shares) -> dict[str, Seen]:
    """What the elements tell, those of like parts one after the other."""
    told = []
    for element, share in shares:
        for name, seen in share.seen.items():
            by_pose, by_speed = (
                layout.spread(element, each) for each in (seen.by_pose, seen.by_speed)
            )
            shape = by_pose.shape[:-1]
            each_z = [
                seen.by_z if owner == element.name else jnp.zeros((*shape, n))
                for owner, n in answering.z
            ]
            by_z = jnp.concatenate([jnp.zeros((*shape, 0)), *each_z], axis=-1)
            told.append((name, Seen(by_pose, by_speed, by_z)))
    return by_name(told)
