"""Mistakes that `quietbus validate` is to see, each one line of the package changed."""

from dataclasses import dataclass

CMG, WHEELS, RIGID = "awkward_scenario", "awkward_wheels", "awkward_rigid"


@dataclass(frozen=True)
class Mutation:
    """One mistake."""

    file: str  # below src/quietbus
    old: str  # occurs once
    new: str
    means: str
    scenarios: tuple[str, ...] = (CMG, RIGID, WHEELS)  # of oracles.scenarios, in this order


MUTATIONS = (
    # from the file to the model
    Mutation(
        "build/cluster.py",
        "rotor.static_imbalance / rotor.mass",
        "2.0 * rotor.static_imbalance / rotor.mass",
        "static imbalance doubled",
    ),
    Mutation(
        "build/legs.py",
        "p_BA_B=array(isolator.offset + base.apply(lower))",
        "p_BA_B=array(isolator.offset + lower)",
        "base orientation not applied to the lower joints",
    ),
    Mutation(
        "build/legs.py",
        "k_B=array(base.apply(legs.universal_axes))",
        "k_B=array(legs.universal_axes)",
        "base orientation not applied to the axes of the universal joints",
    ),
    Mutation(
        "build/arrays.py",
        'Rotation.from_euler("ZYX", angles[::-1])',
        'Rotation.from_euler("zyx", angles[::-1])',
        "Euler angles taken about fixed axes",
    ),
    Mutation(
        "build/cluster.py",
        "[error.chi, error.beta, error.alpha]",
        "[error.chi, error.alpha, error.beta]",
        "two angles of the installation error exchanged",
    ),
    Mutation(
        "build/cluster.py",
        "np.add(body.center_of_mass, rotor.offset)",
        "np.array(rotor.offset)",
        "rotor's offset taken from the unit's point instead of the gimbal's mass centre",
    ),
    Mutation(
        "build/control.py",
        "1.0 / np.sqrt(ki * kd)",
        "1.0 / np.sqrt(kd / ki)",
        "anti-windup with the tracking time alone, not Ki times it",
    ),
    Mutation(
        "model/legs/rigid_parts.py",
        "(legs.upper, joints.p_U, joints.v_U, -1.0)",
        "(legs.upper, joints.p_U, joints.v_U, 1.0)",
        "upper leg parts above the plate in the feedforward inertia",
    ),
    Mutation(
        "build/disturbance.py",
        "0.5 / (np.pi * mode.frequency)",
        "1.0 / (np.pi * mode.frequency)",
        "resonances of the rotors' bearings an octave low",
    ),
    Mutation(
        "build/disturbance.py",
        "phases = own.phases(first_unit + j)",
        "phases = own.phases(first_unit)",
        "random phases of the order tables alike for all rotors",
    ),
    # the parts
    Mutation(
        "model/controller.py",
        "self.ki * z + self.kd * measured.rate_error_B",
        "self.ki * z - self.kd * measured.rate_error_B",
        "wrong sign of Kd",
    ),
    Mutation(
        "model/controller.py",
        "error_B + self.unwinding * (asked_B - delivered_B)",
        "error_B - self.unwinding * (asked_B - delivered_B)",
        "anti-windup winds up",
    ),
    Mutation(
        "model/load.py",
        "cross(rotate(body.R_AX, self.point), force)",
        "cross(force, rotate(body.R_AX, self.point))",
        "wrong sign of a load's lever",
    ),
    Mutation(
        "model/load.py",
        "jnp.sin(jnp.pi * jnp.clip(",
        "jnp.sin(0.5 * jnp.pi * jnp.clip(",
        "half-sine profile is a quarter of a sine",
    ),
    Mutation(
        "build/legs.py",
        "length if legs.free_length is None else legs.free_length",
        "length",
        "preload of the struts ignored",
        (WHEELS,),
    ),
    Mutation(
        "model/unit.py",
        "J_G @ w_G + I_R @ w_R + jnp.cross(r_R, p_R)",
        "J_G @ w_G + I_R @ w_R",
        "orbital part of the rotor's momentum left out",
    ),
    Mutation(
        "model/moments.py",
        "+ spin_up * g[0] * f[1]",
        "- spin_up * g[0] * f[1]",
        "sign of what the wheels' acceleration does to the imbalance",
        (WHEELS,),
    ),
    Mutation(
        "model/moments.py",
        "spin = 1j * h * speed if h else 0.0",
        "spin = -1j * h * speed if h else 0.0",
        "lines turn against the rotor in the harmonic expansion",
    ),
    Mutation(
        "model/disturbance.py",
        "_TILT = np.array([0.0, 0.0, 0.0, 1.0, -1.0])",
        "_TILT = np.array([0.0, 0.0, 0.0, -1.0, 1.0])",
        "whirl modes split the wrong way",
    ),
    Mutation(
        "model/gimbal_motor.py",
        "shared = square / (square + self.holding**2)",
        "shared = square / (square + self.holding)",
        "holding bandwidth of the gimbal motor not squared",
        (RIGID,),
    ),
    Mutation(
        "model/guidance.py",
        "rate = jnp.sum(tau * (self.acceleration + tau * self.jerk / 2.0))",
        "rate = jnp.sum(tau * (self.acceleration + tau * self.jerk / 3.0))",
        "slew's rate is not the derivative of its angle",
    ),
    # the equations of motion
    Mutation(
        "model/rigid.py",
        "+ 2.0 * self.p)",
        "+ self.p)",
        "half of the Coriolis force of what moves on the plate",
    ),
    Mutation(
        "dynamics/welds.py",
        "dv = dv + cross(turning, cross(turning, r))",
        "dv = dv + 0.0 * cross(turning, cross(turning, r))",
        "no centripetal acceleration of the plate on a rigid mount",
        (RIGID,),
    ),
    Mutation(
        "model/legs/inertia.py",
        "-legs.universal_friction[:, None] * (motion.w - B.w)",
        "-legs.universal_friction[:, None] * (motion.w - P.w)",
        "friction of the universal joints by the wrong plate's rate",
    ),
    Mutation(
        "model/legs/kinematics.py",
        "spin = (n_rate + 2.0 * kappa * kappa_rate * motion.spin) / (1.0 - kappa**2)",
        "spin = (n_rate + kappa * kappa_rate * motion.spin) / (1.0 - kappa**2)",
        "half a term of the legs' spin acceleration",
    ),
    Mutation(
        "model/legs/kinematics.py",
        "2.0 * motion.length_rate[:, None] * s_rate",
        "motion.length_rate[:, None] * s_rate",
        "half of the legs' Coriolis acceleration",
    ),
    Mutation(
        "model/legs/joints.py",
        "m_u * a_u + m_d * a_d - F_s",
        "F_s - m_u * a_u - m_d * a_d",
        "wrong sign of the universal joints' force",
    ),
    Mutation(
        "model/legs/joints.py",
        "inertia - friction.at_U - friction.at_A",
        "inertia - friction.at_A",
        "spherical joints' friction left out of the joint forces",
    ),
    Mutation(
        "model/cluster.py",
        "R_AG = around.hosts[0].R_AX @ R_PG",
        "R_AG = around.hosts[0].R_AX.T @ R_PG",
        "torque turned into the plate the wrong way",
    ),
    Mutation(
        "model/control.py",
        "w_NB_B - R_BR @ reference.w_NR_R",
        "w_NB_B - reference.w_NR_R",
        "slew's rate not turned into the bus",
    ),
    Mutation(
        "model/control.py",
        "self.steering.rates(R.T @ axes, R.T @ torque / actuators.torque, t)",
        "self.steering.rates(axes, torque / actuators.torque, t)",
        "moving terms of the generalised steering law along bus axes",
        (RIGID,),
    ),
    Mutation(
        "model/rotor_torques.py",
        "about_centre + cmg.rotor_mass * jnp.cross(e, centre)",
        "about_centre",
        "motor torque of an unbalanced rotor about its mass centre",
        (WHEELS,),
    ),
    Mutation(
        "dynamics/vibration.py",
        "C = M @ (W + V) - by_speed",
        "C = M @ (W + V) + by_speed",
        "dampers drive in the equations of small vibration",
    ),
    Mutation(
        "dynamics/vibration.py",
        "return Z.at[:, columns].add(-self.memory.force(s, self.answer(s)))",
        "return Z.at[:, columns].add(self.memory.force(s, self.answer(s)))",
        "wrong sign of the gimbals' reaction to jitter",
    ),
    # the solvers
    Mutation(
        "solve/direct.py",
        "satellite.averaged() if scheme.averaged else satellite.prepared()",
        "satellite.prepared()",
        "slow motion keeps the imbalance",
    ),
    Mutation(
        "solve/direct.py",
        "state, t = piece.final, reached",
        "state, t = piece.final, end + 1e-3 * (end - t)",
        "clock and state part at the end of a piece",
    ),
    Mutation(
        "solve/direct.py",
        "time = np.arange(count) / output_rate",
        "time = np.arange(count) * (duration / count)",
        "output instants closer than the output rate says",
    ),
    Mutation(
        "solve/periodic.py",
        "return _moved_by(satellite, state, small, -xi)",
        "return _moved_by(satellite, state, small, xi)",
        "jitter added to the true start instead of taken from it",
    ),
    Mutation(
        "solve/periodic.py",
        "s, now = 1j * h * speed, xi * jnp.exp(1j * h * phase)",
        "s, now = 1j * h * speed, xi * jnp.exp(-1j * h * phase)",
        "lines start at the wrong phase",
    ),
    Mutation(
        "solve/along.py",
        "s = 1j * rotor_speeds(satellite, small)[:, None]",
        "s = -1j * rotor_speeds(satellite, small)[:, None]",
        "rates of the lines from the wrong frequency",
    ),
    Mutation(
        "solve/along.py",
        "return (1.0 - part) * self.values[left] + part * self.values[right]",
        "return part * self.values[left] + (1.0 - part) * self.values[right]",
        "legs' linearisation interpolated backwards",
    ),
)
