"""What changes in time."""

import equinox as eqx
from jaxtyping import Array, Float

from quietbus.model.rotor import RotorState


class State(eqx.Module):
    """Motion of bus, plate and gimbals, and the controller's memory.

    The legs add no freedom of their own: their two ends fix them. Angles of rotors that turn at
    constant speed are a function of time.
    """

    p_NB_N: Float[Array, "3"]  # [m] bus mass centre
    q_NB: Float[Array, "4"]  # [-] bus attitude
    p_NP_N: Float[Array, "3"]  # [m] plate origin
    q_NP: Float[Array, "4"]  # [-] plate attitude
    v_NB_N: Float[Array, "3"]  # [m/s]
    w_NB_B: Float[Array, "3"]  # [rad/s]
    v_NP_N: Float[Array, "3"]  # [m/s]
    w_NP_P: Float[Array, "3"]  # [rad/s]
    gimbal_angle: Float[Array, " cmg"]  # [rad]
    gimbal_rate: Float[Array, " cmg"]  # [rad/s]
    error_integral: Float[Array, "3"]  # [rad s] integral of the attitude error, bus frame
    rotor: RotorState | None = None  # None: the rotors turn at constant speed
