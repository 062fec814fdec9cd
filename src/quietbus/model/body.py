"""Rigid bodies."""

import equinox as eqx
from jaxtyping import Array, Float


class Bus(eqx.Module):
    """The satellite without its platform; frame B has its origin at this body's mass centre."""

    mass: Float[Array, ""]  # [kg]
    I_BBcm_B: Float[Array, "3 3"]  # [kg m^2] about the mass centre, bus axes


class Plate(eqx.Module):
    """The upper plate without its CMGs; frame P has its origin at the plate's reference point."""

    mass: Float[Array, ""]  # [kg]
    p_PPcm_P: Float[Array, "3"]  # [m] mass centre in P
    I_PPcm_P: Float[Array, "3 3"]  # [kg m^2] about the mass centre, plate axes
