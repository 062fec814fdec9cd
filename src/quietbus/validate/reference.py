"""Accelerations of the satellite by MuJoCo's multibody algorithms, legs as bodies.

MuJoCo gives the mass matrix, the bias force, passive forces and Jacobians of two trees of bodies
(plate, gimbals and rotors; bus and both parts of each leg). Its soft constraints are not used: what
ties the trees together is solved here exactly. The constraints on the joint accelerations a are

    (J_tip - J_U) a = -(dJ_tip/dt - dJ_U/dt) v     each leg's tip stays in its spherical joint
    a_gimbal = given,  a_rotor = given             the servos; 0 for rotors of constant speed

With N a basis of the accelerations that they leave free and a0 one solution of them,
``a = a0 + N x`` and ``N^T M N x = N^T (f - M a0)``: the constraint forces do no virtual work.
"""

import numpy as np
from jaxtyping import Array, Float
from scipy.linalg import null_space

from quietbus.dynamics.equations import Accelerations, Wrench
from quietbus.dynamics.state import State
from quietbus.model.satellite import Satellite
from quietbus.validate.engine import import_mujoco
from quietbus.validate.mjcf import coordinates, write_mjcf


class Reference:
    """Accelerations of one satellite by MuJoCo."""

    def __init__(self, satellite: Satellite, state: State) -> None:
        """Build the model; ``state`` only has to be a valid one."""
        self._mujoco = mujoco = import_mujoco()
        self._satellite = satellite
        self._model = mujoco.MjModel.from_xml_string(write_mjcf(satellite, state, legs="bodies"))
        self._model.dof_armature[:] = 0.0  # servos are constraints here
        self._model.opt.disableflags |= mujoco.mjtDisableBit.mjDSBL_CONSTRAINT
        self._data = mujoco.MjData(self._model)
        self._legs = range(len(satellite.legs.stiffness))
        self._servos = {
            kind: [
                self._model.joint(f"{kind}{j}").dofadr[0]
                for j in range(len(satellite.cluster.rotor_speed))
            ]
            for kind in (("rotor",) if satellite.cluster.wheels else ("gimbal", "rotor"))
        }

    def accelerations(
        self,
        state: State,
        rotor_angle: Float[Array, " cmg"],
        gimbal_acceleration: Float[Array, " cmg"],
        wrench: Wrench,
        rotor_acceleration: Float[Array, " cmg"] | None = None,
    ) -> Accelerations:
        """As ``quietbus.dynamics.equations.accelerations``; wheels have no gimbal accelerations."""
        model, data = self._model, self._data
        self._set(state, rotor_angle)
        force = data.qfrc_passive - data.qfrc_bias + self._friction() + self._loads(wrench)
        M = self._mass_matrix()
        still = np.zeros(len(rotor_angle))
        spin_up = still if rotor_acceleration is None else np.asarray(rotor_acceleration)
        G, given = self._constraints({"gimbal": np.asarray(gimbal_acceleration), "rotor": spin_up})
        a0, N = np.linalg.lstsq(G, given, rcond=None)[0], null_space(G)
        a = a0 + N @ np.linalg.solve(N.T @ M @ N, N.T @ (force - M @ a0))
        blocks = []
        for name in ("plate", "bus"):
            J, J_rate, Jw, Jw_rate = self._jacobians(data.body(name).xpos, model.body(name).id)
            blocks += [J @ a + J_rate @ data.qvel, Jw @ a + Jw_rate @ data.qvel]
        return Accelerations(*blocks)

    def _set(self, state: State, rotor_angle: Float[Array, " cmg"]) -> None:
        """Bring the model to a state; its legs have to reach the plate and follow it."""
        model, data = self._model, self._data
        joints = coordinates(self._satellite, state, np.asarray(rotor_angle))
        if self._satellite.mount == "rigid":
            del joints["plate"]
        for name, (position, velocity) in joints.items():
            joint = model.joint(name)
            data.qpos[joint.qposadr[0] :][: len(position)] = position
            data.qvel[joint.dofadr[0] :][: len(velocity)] = velocity
        self._mujoco.mj_forward(model, data)
        for i in self._legs:
            tip, on_plate = self._leg_end(i)
            gap = np.linalg.norm(data.site(f"tip{i}").xpos - data.site(f"U{i}").xpos)
            gap_rate = np.linalg.norm((tip[0] - on_plate[0]) @ data.qvel)
            if gap > 1e-9 or gap_rate > 1e-9 * (1.0 + np.linalg.norm(on_plate[0] @ data.qvel)):
                raise RuntimeError(
                    f"leg {i} of the MuJoCo model does not follow the plate: its tip is off by "
                    f"{gap:.3g} m and {gap_rate:.3g} m/s"
                )

    def _mass_matrix(self) -> np.ndarray:
        n = self._model.nv
        M, column = np.zeros((n, n)), np.zeros(n)
        for i, unit in enumerate(np.eye(n)):
            self._mujoco.mj_mulM(self._model, self._data, column, unit)
            M[:, i] = column
        return M

    def _constraints(self, servos: dict[str, np.ndarray]) -> tuple[np.ndarray, np.ndarray]:
        """Matrix and right-hand side of the constraints on the joint accelerations."""
        rows, given = [], []
        for i in self._legs:
            tip, on_plate = self._leg_end(i)
            rows.append(tip[0] - on_plate[0])
            given.append(-(tip[1] - on_plate[1]) @ self._data.qvel)
        for kind, freedoms in self._servos.items():
            rows.append(np.eye(self._model.nv)[freedoms])
            given.append(servos[kind])
        return np.concatenate(rows), np.concatenate(given)

    def _leg_end(self, i: int) -> tuple[tuple[np.ndarray, ...], tuple[np.ndarray, ...]]:
        """Jacobians of leg i's tip and of its spherical joint on the plate."""
        tip, on_plate = self._data.site(f"tip{i}").xpos, self._data.site(f"U{i}").xpos
        upper, plate = self._model.body(f"upper{i}").id, self._model.body("plate").id
        return self._jacobians(tip, upper), self._jacobians(on_plate, plate)

    def _loads(self, wrench: Wrench) -> np.ndarray:
        """Generalised force of the external loads."""
        total = np.zeros(self._model.nv)
        for name, force, torque in (
            ("bus", wrench.force_B, wrench.torque_B),
            ("plate", wrench.force_P, wrench.torque_P),
        ):
            body = self._data.body(name)
            self._mujoco.mj_applyFT(
                self._model,
                self._data,
                np.array(force),
                np.array(torque),
                body.xpos,
                body.id,
                total,
            )
        return total

    def _friction(self) -> np.ndarray:
        """Generalised force of the spherical joints; the universal joints' is in the model."""
        force = np.zeros(self._model.nv)
        plate = self._data.body("plate")
        for i in self._legs:
            upper = self._data.body(f"upper{i}")
            Jw = self._jacobians(upper.xpos, upper.id)[2]
            Jw = Jw - self._jacobians(plate.xpos, plate.id)[2]
            friction = float(self._satellite.legs.spherical_friction[i])
            force -= friction * Jw.T @ (Jw @ self._data.qvel)
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
