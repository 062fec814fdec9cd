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
        "build.py",
        "rotor.static_imbalance / rotor.mass",
        "2.0 * rotor.static_imbalance / rotor.mass",
        "static imbalance doubled",
    ),
    Mutation(
        "build.py",
        "p_BA_B=_array(isolator.offset + base.apply(lower))",
        "p_BA_B=_array(isolator.offset + lower)",
        "base orientation not applied to the lower joints",
    ),
    Mutation(
        "build.py",
        "k_B=_array(base.apply(legs.universal_axes))",
        "k_B=_array(legs.universal_axes)",
        "base orientation not applied to the axes of the universal joints",
    ),
    Mutation(
        "build.py",
        'Rotation.from_euler("ZYX", angles[::-1])',
        'Rotation.from_euler("zyx", angles[::-1])',
        "Euler angles taken about fixed axes",
    ),
    Mutation(
        "build.py",
        "[error.chi, error.beta, error.alpha]",
        "[error.chi, error.alpha, error.beta]",
        "two angles of the installation error exchanged",
    ),
    Mutation(
        "build.py",
        "np.add(body.center_of_mass, rotor.offset)",
        "np.array(rotor.offset)",
        "rotor's offset taken from the unit's point instead of the gimbal's mass centre",
    ),
    Mutation(
        "build.py",
        "1.0 / np.sqrt(ki * kd)",
        "1.0 / np.sqrt(kd / ki)",
        "anti-windup with the tracking time alone, not Ki times it",
    ),
    Mutation(
        "build.py",
        "(legs.upper, upper, -1.0)",
        "(legs.upper, upper, 1.0)",
        "upper leg parts above the plate in the feedforward inertia",
    ),
    Mutation(
        "build.py",
        "0.5 / (np.pi * mode.frequency)",
        "1.0 / (np.pi * mode.frequency)",
        "resonances of the rotors' bearings an octave low",
    ),
    Mutation(
        "build.py",
        "phases = own.phases(first_unit + j)",
        "phases = own.phases(first_unit)",
        "random phases of the order tables alike for all rotors",
    ),
    # the parts
    Mutation(
        "model/controller.py",
        "self.ki * integral_B + self.kd * rate_error_B",
        "self.ki * integral_B - self.kd * rate_error_B",
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
        "jnp.cross(R_NX @ self.point, force)",
        "jnp.cross(force, R_NX @ self.point)",
        "wrong sign of a load's lever",
    ),
    Mutation(
        "model/load.py",
        "jnp.sin(jnp.pi * jnp.clip(",
        "jnp.sin(0.5 * jnp.pi * jnp.clip(",
        "half-sine profile is a quarter of a sine",
    ),
    Mutation(
        "model/hexapod.py",
        "self.stiffness * (length - self.free_length)",
        "self.stiffness * (length - self.nominal_length)",
        "preload of the struts ignored",
        (WHEELS,),
    ),
    Mutation(
        "model/cmg.py",
        "J_G @ w_G + I_R @ w_R + jnp.cross(r_R, p_R)",
        "J_G @ w_G + I_R @ w_R",
        "orbital part of the rotor's momentum left out",
    ),
    Mutation(
        "model/cmg.py",
        "b2 = b2 + rotor_acceleration * g[0] * f[1]",
        "b2 = b2 - rotor_acceleration * g[0] * f[1]",
        "sign of what the wheels' acceleration does to the imbalance",
        (WHEELS,),
    ),
    Mutation(
        "model/cmg.py",
        "spin = 1j * h * self.rotor_speed[:, None] if h else 0.0",
        "spin = -1j * h * self.rotor_speed[:, None] if h else 0.0",
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
        "dynamics/equations.py",
        "+ 2.0 * carried.p)",
        "+ carried.p)",
        "half of the Coriolis force of what moves on the plate",
    ),
    Mutation(
        "dynamics/equations.py",
        "u_rate = jnp.concatenate([dv_B + cross(dw_B, r) + bias, dw_B, dv_B, dw_B])",
        "u_rate = jnp.concatenate([dv_B + cross(dw_B, r), dw_B, dv_B, dw_B])",
        "no centripetal acceleration of the plate on a rigid mount",
        (RIGID,),
    ),
    Mutation(
        "dynamics/legs.py",
        "-legs.universal_friction[:, None] * (motion.w - plates.w_B)",
        "-legs.universal_friction[:, None] * (motion.w - plates.w_P)",
        "friction of the universal joints by the wrong plate's rate",
    ),
    Mutation(
        "dynamics/kinematics.py",
        "spin = (n_rate + 2.0 * kappa * kappa_rate * motion.spin) / (1.0 - kappa**2)",
        "spin = (n_rate + kappa * kappa_rate * motion.spin) / (1.0 - kappa**2)",
        "half a term of the legs' spin acceleration",
    ),
    Mutation(
        "dynamics/kinematics.py",
        "2.0 * motion.length_rate[:, None] * s_rate",
        "motion.length_rate[:, None] * s_rate",
        "half of the legs' Coriolis acceleration",
    ),
    Mutation(
        "dynamics/joint_forces.py",
        "m_u * a_u + m_d * a_d - F_s",
        "F_s - m_u * a_u - m_d * a_d",
        "wrong sign of the universal joints' force",
    ),
    Mutation(
        "dynamics/joint_forces.py",
        "inertia - friction.at_U - friction.at_A",
        "inertia - friction.at_A",
        "spherical joints' friction left out of the joint forces",
    ),
    Mutation(
        "dynamics/closed_loop.py",
        "satellite.steering.rates(A, -R_BP.T @ torque / h_rms, t)",
        "satellite.steering.rates(A, -R_BP @ torque / h_rms, t)",
        "torque turned into the plate the wrong way",
    ),
    Mutation(
        "dynamics/closed_loop.py",
        "rate_error = state.w_NB_B - R_BR @ reference.w_NR_R",
        "rate_error = state.w_NB_B - reference.w_NR_R",
        "slew's rate not turned into the bus",
    ),
    Mutation(
        "dynamics/rotor_torques.py",
        "about_centre + cmg.rotor_mass * jnp.cross(e, centre)",
        "about_centre",
        "motor torque of an unbalanced rotor about its mass centre",
        (WHEELS,),
    ),
    Mutation(
        "dynamics/vibration.py",
        "C = all_.M @ (W + V) - all_.by_speed",
        "C = all_.M @ (W + V) + all_.by_speed",
        "dampers drive in the equations of small vibration",
    ),
    Mutation(
        "dynamics/vibration.py",
        'return Z.at[:, -3:].add(-jnp.einsum("kia,kab->ib", self.control.reaction, angles))',
        'return Z.at[:, -3:].add(jnp.einsum("kia,kab->ib", self.control.reaction, angles))',
        "wrong sign of the gimbals' reaction to jitter",
    ),
    # the solvers
    Mutation(
        "solve/direct.py",
        "moments, satellite = moments.averaged(), without_disturbance(satellite)",
        "satellite = without_disturbance(satellite)",
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
        "solve/harmonic.py",
        "return _moved_by(satellite, state, small, -xi)",
        "return _moved_by(satellite, state, small, xi)",
        "jitter added to the true start instead of taken from it",
    ),
    Mutation(
        "solve/harmonic.py",
        "s, now = 1j * h * speed, xi * jnp.exp(1j * h * phase)",
        "s, now = 1j * h * speed, xi * jnp.exp(-1j * h * phase)",
        "lines start at the wrong phase",
    ),
    Mutation(
        "solve/harmonic.py",
        "s = 1j * slow.rotor_speed[:, None] * orders_of(satellite.disturbance)",
        "s = -1j * slow.rotor_speed[:, None] * orders_of(satellite.disturbance)",
        "rates of the lines from the wrong frequency",
    ),
    Mutation(
        "solve/harmonic.py",
        "return (1.0 - part) * self.values[left] + part * self.values[right]",
        "return part * self.values[left] + (1.0 - part) * self.values[right]",
        "legs' linearisation interpolated backwards",
    ),
)
