"""A group of like actuators on one body: single-gimbal CMGs, or reaction wheels."""

from collections.abc import Mapping
from dataclasses import replace

import equinox as eqx
import jax
import jax.numpy as jnp
from jaxtyping import Array, Bool, Complex, Float

from quietbus.model.disturbance import AbstractDisturbance, quiet_rotors
from quietbus.model.element import (
    NOTHING,
    AbstractActuator,
    Around,
    Authority,
    Driven,
    Own,
    Rates,
    RigidParts,
)
from quietbus.model.gimbal_motor import AbstractGimbalMotor, SmoothMotor
from quietbus.model.gimbals import AbstractGimbals
from quietbus.model.moments import ORDERS, ClusterMoments, Turning
from quietbus.model.report import UNIT, Output, Quantity
from quietbus.model.rotor_torques import rotor_torques
from quietbus.model.rotors import AbstractRotors, ConstantSpeed
from quietbus.model.unit import ControlMomentGyro, balanced
from quietbus.spatial.vector import rotate

GIMBAL_ANGLE = Quantity("gimbal_angle", UNIT, "rad", "gimbal angles")
GIMBAL_RATE = Quantity("gimbal_rate", UNIT, "rad/s", "gimbal rates")
ROTOR_ANGLE = Quantity("rotor_angle", UNIT, "rad", "rotor angles")
ROTOR_SPEED = Quantity("rotor_speed", UNIT, "rad/s", "rotor speeds, relative to the unit's body")
ROTOR_TORQUE = Quantity(
    "rotor_torque", UNIT, "N m", "torque of the motor on its rotor", "whose rotor speeds change"
)
QUANTITIES = (GIMBAL_ANGLE, GIMBAL_RATE, ROTOR_ANGLE, ROTOR_SPEED, ROTOR_TORQUE)


class Units(eqx.Module):
    """How all units of a cluster turn at one instant."""

    gimbal: Turning
    rotor: Turning


class Cluster(AbstractActuator):
    """CMGs or reaction wheels of one kind on one body, their carrier.

    Driven coordinates are the angles of what follows commands: of gimbals with servos, and of
    rotors with wheels' motors.
    """

    name: str = eqx.field(static=True)
    hosts: tuple[str] = eqx.field(static=True)
    units: ControlMomentGyro  # every field with a leading axis of units
    gimbals: AbstractGimbals
    rotors: AbstractRotors
    disturbance: AbstractDisturbance  # beyond imbalance
    motor: AbstractGimbalMotor = SmoothMotor()
    kept: ClusterMoments | None = None  # of ``units``, for callers who evaluate often

    @property
    def count(self):
        return len(self.units.rotor_mass)

    @property
    def moments(self) -> ClusterMoments:
        """The units' mass moments."""
        return ClusterMoments.expand(self.units) if self.kept is None else self.kept

    @property
    def cut(self) -> int:
        """Where the driven coordinates of rotors begin."""
        return self.gimbals.count(self.count)

    @property
    def driven(self) -> int:
        """Number of driven coordinates."""
        return self.cut + self.rotors.count(self.count)

    def driven_names(self, first):
        numbers = range(first, first + self.count)
        gimbals, rotors = ("gimbal_angle", "gimbal_rate"), ("rotor_angle", "rotor_speed")
        kinds = [gimbals] * (self.cut > 0) + [rotors] * (self.cut < self.driven)
        return [Driven(f"{a}_{j}", f"{b}_{j}") for a, b in kinds for j in numbers]

    def command_names(self, first):
        kinds = ["gimbal_rate_command"] * (self.cut > 0)
        kinds += ["rotor_torque_command"] * (self.cut < self.driven)
        return [f"{kind}_{j}" for kind in kinds for j in range(first, first + self.count)]

    def start(self):
        y, y_rate = self.rotors.start(self.units)
        still = jnp.zeros(self.cut)
        return Own.of(y=jnp.concatenate([still, y]), y_rate=jnp.concatenate([still, y_rate]))

    def with_gimbal_angles(self, own: Own, angle: Float[Array, " cmg"]) -> Own:
        """Its part of the state with gimbals at other angles [rad], where they are not held."""
        y = jnp.concatenate([angle[: self.cut], own.y[self.cut :]])
        return eqx.tree_at(lambda o: o.y, own, y)

    def turning(self, t: Float[Array, ""], own: Own, y_second: Float[Array, " y"]) -> Units:
        """How gimbals and rotors turn."""
        k = self.cut
        gimbal = self.gimbals.turning(own.y[:k], own.y_rate[:k], y_second[:k])
        rotor = self.rotors.turning(self.units, t, own.y[k:], own.y_rate[k:], y_second[k:])
        return Units(gimbal, rotor)

    def at(self, t: Float[Array, ""], own: Mapping[str, Own]) -> Units:
        """How gimbals and rotors turn, accelerations left out; of all elements' own."""
        mine = own.get(self.name, NOTHING)
        return self.turning(t, mine, jnp.zeros_like(mine.y))

    def turned(
        self, own: Mapping[str, Own], angle: Float[Array, " cmg"]
    ) -> tuple["Cluster", dict[str, Own]]:
        """Itself, and its part of the state, with its rotors at other angles [rad] at t = 0."""
        units = eqx.tree_at(lambda u: u.rotor_phase, self.units, angle)
        if self.cut == self.driven:
            return replace(self, units=units), {}
        mine = own[self.name]
        y = jnp.concatenate([mine.y[: self.cut], angle])
        return replace(self, units=units), {self.name: eqx.tree_at(lambda o: o.y, mine, y)}

    def with_lines(
        self, of_imbalance: Bool[Array, " cmg"], lines: Bool[Array, "cmg order"]
    ) -> "Cluster":
        """Itself with some lines of its rotors only, without noise and gimbal ripple."""
        moments = self.moments.with_imbalance(of_imbalance)
        disturbance = self.disturbance.silent().with_lines(lines)
        return replace(self, disturbance=disturbance, motor=SmoothMotor(), kept=moments)

    def _carried(self, around: Around, rates: Rates):
        units = self.turning(around.t, around.own, rates.y)
        return self.moments.at(units.gimbal, units.rotor)

    def mass(self, around):
        still = Rates(jnp.zeros_like(around.own.y), around.own.z)
        return self._carried(around, still).mass_matrix(around.hosts[0])

    def balance(self, around, rates, u_rate):
        (P,) = around.hosts
        units = self.turning(around.t, around.own, rates.y)
        inertia = self.moments.at(units.gimbal, units.rotor).balance(P, u_rate)
        wrench = self.disturbance.wrench_P(self.units, around.t, units.gimbal, units.rotor)
        return inertia + rotate(P.R_AX, wrench.reshape(2, 3)).reshape(6)

    def rates(self, around, command):
        own, k = around.own, self.cut
        gimbal = self.gimbals.acceleration(own.y_rate[:k], command[:k])
        gimbal = gimbal + self.motor.acceleration(self.units, own.y[:k], own.y_rate[:k])
        rotor = self.rotors.acceleration(self.units, command[k:])
        return Rates(jnp.concatenate([gimbal, rotor]), own.z)

    def answer(self, around, rates, u_rate):
        """Each unit's reaction is its own: one derivative serves all units at once."""
        (P,) = around.hosts
        own, moments = around.own, self.moments
        push = jax.vmap(lambda m: m.balance(P, u_rate))

        def reaction(y, y_rate, y_second):
            moved = eqx.tree_at(lambda o: (o.y, o.y_rate), own, (y, y_rate))
            units = self.turning(around.t, moved, y_second)
            return push(moments.order(0, units.gimbal, units.rotor))

        at = (own.y, own.y_rate, rates.y)
        parts = []
        for first, last in ((0, self.cut), (self.cut, self.driven)):
            if first == last:
                continue
            some = jnp.zeros(self.driven).at[first:last].set(1.0)
            ways = [tuple(some * float(i == k) for i in range(3)) for k in range(3)]
            parts.append(jnp.stack([jax.jvp(reaction, at, way)[1].T for way in ways]))
        return jnp.concatenate([jnp.zeros((3, 6, 0)), *parts], axis=2)

    def lines(
        self, around: Around, rates: Rates, u_rate: Float[Array, "6"]
    ) -> Complex[Array, "order cmg 6"]:
        """Amplitudes of the forces on the carrier at each order of each rotor."""
        (P,) = around.hosts
        units, moments = self.turning(around.t, around.own, rates.y), self.moments
        push = jax.vmap(lambda m: m.balance(P, u_rate))
        imbalance = jnp.stack([push(moments.order(h, units.gimbal, units.rotor)) for h in ORDERS])
        wrench = self.disturbance.lines_P(self.units, units.gimbal, units.rotor)
        lines = on_axes(P.R_AX, jnp.swapaxes(wrench, 0, 1))
        return lines.at[self.disturbance.rows].add(imbalance)

    def corners(self):
        return self.rotors.corners()

    def averaged(self) -> "Cluster":
        """Itself with what its rotors do averaged over their turns, and gimbals that run smooth."""
        return Cluster(
            self.name,
            self.hosts,
            balanced(self.units),
            self.gimbals,
            self.rotors,
            quiet_rotors(self.count),
            kept=self.moments.averaged(),
        )

    def authority(self, around):
        """Gimbals turn their rotors' momentum, wheels push against their rotors."""
        units = self.turning(around.t, around.own, jnp.zeros(self.driven))
        R_PG = eqx.filter_vmap(ControlMomentGyro.R_PG)(self.units, units.gimbal.angle)
        momentum = self.units.I_RRcm_R[:, 0, 0] * units.rotor.rate
        by_rate = (momentum[:, None] * R_PG[:, :, 1]).T[:, : self.cut]  # h t
        rates, torques = self.gimbals.full(self.count), self.rotors.full
        full = jnp.concatenate([rates, torques])
        torque_P = -jnp.concatenate([by_rate * rates, self.rotors.axes(R_PG) * torques], axis=1)
        torque_A = rotate(around.hosts[0].R_AX, torque_P.T).T
        rms = jnp.sqrt(3.0 * jnp.mean(torque_A**2)) if self.driven else jnp.ones(())
        rms = jnp.where(rms > 0.0, rms, 1.0)  # where no rotor turns
        return Authority(torque_A / rms, rms, full)

    def share(self, command):
        k = self.cut
        return jnp.minimum(self.gimbals.share(command[:k]), self.rotors.share(command[k:]))

    def possible(self, around, command):
        k = self.cut
        rotors = self.rotors.possible(command[k:], around.own.y_rate[k:])
        return jnp.concatenate([command[:k], rotors])

    def rigid_parts(self, around):
        units = self.turning(around.t, around.own, jnp.zeros(self.driven))
        (P,) = around.hosts

        def parts(cmg, gamma, gamma_rate, phi, speed):
            R_AG = P.R_AX @ cmg.R_PG(gamma)
            w_G = P.w + gamma_rate * R_AG[:, 2]
            R_AR = R_AG @ cmg.R_GR(phi)
            w_R = w_G + speed * R_AR[:, 0]
            r_C = P.R_AX @ cmg.p_PC_P
            p_C, v_C = P.p + r_C, P.v + jnp.cross(P.w, r_C)
            r_G, r_R = R_AG @ cmg.p_CGcm_G, R_AG @ cmg.p_CR_G
            e = cmg.eccentricity * R_AR[:, 1]
            I_G, I_R = R_AG @ cmg.I_GGcm_G @ R_AG.T, R_AR @ cmg.I_RRcm_R @ R_AR.T
            v_R = v_C + jnp.cross(w_G, r_R) + jnp.cross(w_R, e)
            gimbal = (cmg.gimbal_mass, I_G, p_C + r_G, v_C + jnp.cross(w_G, r_G), w_G)
            return gimbal, (cmg.rotor_mass, I_R, p_C + r_R + e, v_R, w_R)

        gimbals, rotors = jax.vmap(parts)(
            self.units, units.gimbal.angle, units.gimbal.rate, units.rotor.angle, units.rotor.rate
        )
        return RigidParts(*(jnp.concatenate(pair) for pair in zip(gimbals, rotors, strict=True)))

    def report(self, around, rates, u_rate, detailed=False):
        units = self.turning(around.t, around.own, rates.y)
        torque = rotor_torques(self.units, units.gimbal, units.rotor, around.hosts[0], u_rate)
        return (
            Output(GIMBAL_ANGLE, units.gimbal.angle),
            Output(GIMBAL_RATE, units.gimbal.rate),
            Output(ROTOR_ANGLE, units.rotor.angle),
            Output(ROTOR_SPEED, units.rotor.rate),
            Output(ROTOR_TORQUE, torque),
        )

    def modulation(self, gimbal_rate: Float[Array, "n cmg"]) -> Float[Array, ""]:
        """Largest amplitude [rad] by which a line of the motors shifts its own phase.

        Through the servos; small where the lines follow from the mean motion of the gimbals alone.
        """
        pushed = jax.vmap(lambda rate: jnp.abs(self.motor.amplitudes(self.units, rate)))
        size, omega = pushed(gimbal_rate), jnp.abs(self.motor.order * gimbal_rate[..., None])
        answer = self.gimbals.stiffness(omega)
        shift = self.motor.order * size / jnp.where(omega > 0.0, answer, 1.0)
        return jnp.max(shift, initial=0.0)

    def without_rotation(self) -> "Cluster":
        """Itself with its rotors at a standstill, which they keep."""
        units = eqx.tree_at(lambda u: u.rotor_speed, self.units, 0.0 * self.units.rotor_speed)
        return replace(self, units=units, rotors=ConstantSpeed(), kept=None)


def on_axes(R_AP: Float[Array, "3 3"], wrench: Complex[Array, "*n 6"]) -> Complex[Array, "*n 6"]:
    """Forces and torques turned from the carrier's axes to A."""
    vectors = wrench.reshape(*wrench.shape[:-1], 2, 3)
    return rotate(R_AP, vectors).reshape(wrench.shape)
