"""Accelerations and joint forces by MuJoCo's multibody algorithms, legs as bodies.

MuJoCo gives the mass matrix, the bias force, passive forces and Jacobians of trees of bodies: each
free body with its gimbals and rotors, and both parts of each leg that stands on it. Its soft
constraints are not used: what ties the trees together is solved here exactly. The constraints on
the joint accelerations a are

    (J_tip - J_U) a = -(dJ_tip/dt - dJ_U/dt) v     each leg's tip stays in its spherical joint
    a_gimbal = given,  a_rotor = given             the servos; 0 for rotors of constant speed

The legs' own joints follow the bodies: with ``a = a0 + N x``, x the accelerations of free bodies,
``N^T M N x = N^T (f - M a0)``, since the constraint forces do no virtual work. What is then missing
in ``M a = f`` is theirs: the forces in the spherical joints and the motors' torques.
"""

from dataclasses import dataclass

import numpy as np

from quietbus.reference.engine import import_mujoco, model_of
from quietbus.reference.mechanism import Mechanism
from quietbus.reference.mjcf import (
    LEG_JOINTS,
    free_coordinates,
    leg_coordinates,
    write_mjcf,
)
from quietbus.reference.motion import Motion


@dataclass(frozen=True)
class Accelerations:
    """Of all bodies, inertial components, and what the constraints need for them."""

    v: np.ndarray  # (body, 3) [m/s^2] of their origins
    w: np.ndarray  # (body, 3) [rad/s^2]
    joints: np.ndarray  # (nv,) of all joints of the model
    constraint: np.ndarray  # (nv,) generalised forces of the constraints


@dataclass(frozen=True)
class JointForces:
    """What the joints exert on each leg, inertial components."""

    spherical_force: np.ndarray  # (leg, 3) [N] upper body on upper part
    universal_force: np.ndarray  # (leg, 3) [N] lower body on lower part
    universal_moment: np.ndarray  # (leg,) [N m] lower body on lower part, about the axis
    universal_axis: np.ndarray  # (leg, 3) normal to both axes of the joint, on the leg's side


class Multibody:
    """One satellite in MuJoCo."""

    def __init__(self, mechanism: Mechanism, motion: Motion) -> None:
        """Build the model; ``motion`` only has to be a possible one."""
        self._mujoco = mujoco = import_mujoco()
        self.mechanism = mechanism
        self._model = model = model_of(write_mjcf(mechanism, motion, legs="bodies"))
        model.dof_armature[:] = 0.0  # servos are constraints here
        model.opt.disableflags |= mujoco.mjtDisableBit.mjDSBL_CONSTRAINT
        self._data = mujoco.MjData(model)
        self._legs = range(len(mechanism.legs.stiffness))

        def addresses(names: list[str], width: int = 1) -> tuple[np.ndarray, np.ndarray]:
            q = [model.joint(name).qposadr[0] for name in names]
            v = [model.joint(name).dofadr[0] for name in names]
            more = 1 if width == 6 else 0  # a quaternion has four numbers for three freedoms
            return (
                np.array([np.arange(start, start + width + more) for start in q], int).ravel(),
                np.array([np.arange(start, start + width) for start in v], int).ravel(),
            )

        self._leg = addresses([f"leg{i}_{name}" for i in self._legs for name in LEG_JOINTS])
        units = mechanism.units
        self._rotor = addresses([f"rotor{j}" for j in range(len(units.wheel))])
        self._gimballed = np.flatnonzero(~units.wheel)
        self._gimbal = addresses([f"gimbal{j}" for j in self._gimballed])
        self._free_bodies = np.flatnonzero(~mechanism.welded)
        self._free = addresses([mechanism.names[number] for number in self._free_bodies], 6)

    def set(self, motion: Motion) -> None:
        """Bring the model to a motion; its legs have to reach their bodies and follow them."""
        model, data = self._model, self._data
        angles, rates = leg_coordinates(self.mechanism, motion)
        poses, speeds = free_coordinates(motion)
        data.qpos[self._free[0]] = poses[self._free_bodies].ravel()
        data.qvel[self._free[1]] = speeds[self._free_bodies].ravel()
        data.qpos[self._leg[0]], data.qvel[self._leg[1]] = angles.ravel(), rates.ravel()
        data.qpos[self._rotor[0]] = motion.rotor_angle
        data.qvel[self._rotor[1]] = motion.rotor_speed
        data.qpos[self._gimbal[0]] = motion.gimbal_angle[self._gimballed]
        data.qvel[self._gimbal[1]] = motion.gimbal_rate[self._gimballed]
        self._mujoco.mj_fwdPosition(model, data)
        self._mujoco.mj_fwdVelocity(model, data)
        self._ends = [self._leg_end(i) for i in self._legs]
        for i, (tip, joint) in enumerate(self._ends):
            gap = np.linalg.norm(data.site(f"tip{i}").xpos - data.site(f"U{i}").xpos)
            gap_rate = np.linalg.norm((tip[0] - joint[0]) @ data.qvel)
            if gap > 1e-9 or gap_rate > 1e-9 * (1.0 + np.linalg.norm(joint[0] @ data.qvel)):
                raise RuntimeError(
                    f"leg {i} of the MuJoCo model does not follow its upper body: its tip is off "
                    f"by {gap:.3g} m and {gap_rate:.3g} m/s"
                )

    def accelerations(
        self,
        gimbal_acceleration: np.ndarray,
        rotor_acceleration: np.ndarray,
        wrenches: np.ndarray,
    ) -> Accelerations:
        """Accelerations at the motion that is set.

        Args:
            gimbal_acceleration, rotor_acceleration: (unit,) that the motors enforce [rad/s^2];
                wheels' gimbals stand still.
            wrenches: (body, 2, 3) external forces [N] and torques [N m] about each body's origin,
                inertial.
        """
        model, data = self._model, self._data
        force = data.qfrc_passive - data.qfrc_bias + self._friction() + self._loads(wrenches)
        M = np.zeros((model.nv, model.nv))
        self._mujoco.mj_fullM(model, data, M)
        legs, free = self._leg[1], self._free[1]
        G = np.concatenate([tip[0] - joint[0] for tip, joint in self._ends])
        bias = [(tip[1] - joint[1]) @ data.qvel for tip, joint in self._ends]
        follow = np.linalg.solve(G[:, legs], np.column_stack([-np.concatenate(bias), -G[:, free]]))
        a0, N = np.zeros(model.nv), np.zeros((model.nv, len(free)))
        a0[self._rotor[1]] = rotor_acceleration
        a0[self._gimbal[1]] = gimbal_acceleration[self._gimballed]
        a0[legs], N[legs] = follow[:, 0], follow[:, 1:]
        N[free] = np.eye(len(free))
        a = a0 + N @ np.linalg.solve(N.T @ M @ N, N.T @ (force - M @ a0))
        v, w = zip(*(self._acceleration(name, a) for name in self.mechanism.names), strict=True)
        return Accelerations(np.array(v), np.array(w), a, M @ a - force)

    def rotor_torques(self, found: Accelerations) -> np.ndarray:
        """Torque (unit,) [N m] of each motor on its rotor about the spin axis."""
        return found.constraint[self._rotor[1]]

    def strut_forces(self) -> np.ndarray:
        """Tension (leg,) [N] of each strut at the motion that is set: what its slide feels."""
        return -self._data.qfrc_passive[self._leg[1][2::3]]

    def strokes(self) -> np.ndarray:
        """Slide (leg,) [m] of each leg from the nominal pose."""
        return self._data.qpos[self._leg[0][2::3]].copy()

    def joint_forces(self, found: Accelerations) -> JointForces:
        """Forces in the legs' joints.

        The forces at the tips are what the legs' joints lack in ``M a = f``; those at the universal
        joints are MuJoCo's forces between bodies (``mj_rnePostConstraint``).
        """
        model, data = self._model, self._data
        tips = np.zeros((len(self._legs), 3))
        data.qacc[:] = found.joints
        data.xfrc_applied[:] = 0.0
        upper_bodies = [self.mechanism.names[number] for number in self.mechanism.legs.upper_body]
        for i in self._legs:
            own = self._leg[1][3 * i : 3 * i + 3]
            J_tip = self._ends[i][0][0][:, own]
            tips[i] = np.linalg.solve(J_tip.T, found.constraint[own])
            upper = data.body(f"upper{i}")
            lever = data.site(f"tip{i}").xpos - upper.xipos
            c = float(self.mechanism.legs.spherical_friction[i])
            torque = np.cross(lever, tips[i]) - c * (
                self._rate_of(f"upper{i}") - self._rate_of(upper_bodies[i])
            )
            data.xfrc_applied[upper.id] = np.concatenate([tips[i], torque])
        self._mujoco.mj_rnePostConstraint(model, data)
        forces, moments, axes = np.zeros_like(tips), np.zeros(len(tips)), np.zeros_like(tips)
        for i in self._legs:
            lower = data.body(f"lower{i}")
            torque, forces[i] = np.split(data.cfrc_int[lower.id], 2)
            root = model.body_rootid[lower.id]
            torque = torque - np.cross(lower.xpos - data.subtree_com[root], forces[i])
            k = data.xaxis[model.joint(f"leg{i}_k").id]
            h = np.cross(data.xaxis[model.joint(f"leg{i}_y").id], k)
            axes[i] = h / np.linalg.norm(h)
            moments[i] = axes[i] @ torque
        data.xfrc_applied[:] = 0.0
        return JointForces(tips, forces, moments, axes)

    def inertia(self) -> np.ndarray:
        """Inertia (3, 3) [kg m^2] of all bodies about their common mass centre, inertial axes."""
        model, data = self._model, self._data
        m, p = model.body_mass[1:], data.xipos[1:]
        R = data.ximat[1:].reshape(-1, 3, 3)
        r = p - m @ p / m.sum()
        own = np.einsum("bij,bj,bkj->ik", R, model.body_inertia[1:], R)
        return own + (m @ np.sum(r * r, axis=1)) * np.eye(3) - (m[:, None] * r).T @ r

    def _acceleration(self, body: str, a: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
        """Of a body's origin [m/s^2], and angular [rad/s^2]."""
        at, data = self._data.body(body), self._data
        J, J_rate, Jw, Jw_rate = self._jacobians(at.xpos, at.id)
        return J @ a + J_rate @ data.qvel, Jw @ a + Jw_rate @ data.qvel

    def _rate_of(self, body: str) -> np.ndarray:
        Jw = np.zeros((3, self._model.nv))
        self._mujoco.mj_jacBody(self._model, self._data, None, Jw, self._model.body(body).id)
        return Jw @ self._data.qvel

    def _leg_end(self, i: int) -> tuple[tuple[np.ndarray, ...], tuple[np.ndarray, ...]]:
        """Jacobians of leg i's tip and of its spherical joint on the upper body."""
        tip, joint = self._data.site(f"tip{i}").xpos, self._data.site(f"U{i}").xpos
        name = self.mechanism.names[self.mechanism.legs.upper_body[i]]
        upper, body = self._model.body(f"upper{i}").id, self._model.body(name).id
        return self._jacobians(tip, upper), self._jacobians(joint, body)

    def _loads(self, wrenches: np.ndarray) -> np.ndarray:
        """Generalised force of the external loads."""
        total = np.zeros(self._model.nv)
        for name, (force, torque) in zip(self.mechanism.names, wrenches, strict=True):
            body = self._data.body(name)
            self._mujoco.mj_applyFT(
                self._model, self._data, force, torque, body.xpos, body.id, total
            )
        return total

    def _friction(self) -> np.ndarray:
        """Generalised force of the spherical joints' friction; MuJoCo has that of the others."""
        force = np.zeros(self._model.nv)
        for friction, (tip, joint) in zip(
            self.mechanism.legs.spherical_friction, self._ends, strict=True
        ):
            Jw = tip[2] - joint[2]
            force -= float(friction) * Jw.T @ (Jw @ self._data.qvel)
        return force

    def _jacobians(
        self, point: np.ndarray, body: int
    ) -> tuple[np.ndarray, np.ndarray, np.ndarray, np.ndarray]:
        """Jacobians of a body's point, its rate, of the body's angular velocity, its rate."""
        model, data = self._model, self._data
        J, Jw, J_rate, Jw_rate = np.zeros((4, 3, model.nv))
        self._mujoco.mj_jac(model, data, J, Jw, point, body)
        self._mujoco.mj_jacDot(model, data, J_rate, Jw_rate, point, body)
        return J, J_rate, Jw, Jw_rate
