"""The legs between the base plate and the upper plate: geometry, masses, struts and joints.

Each leg runs from a universal joint A on the base plate (fixed axis k in the plate) to a
spherical joint U on the upper plate. Its lower part turns about A, its upper part slides in the
lower one. Any number of legs is one ``Hexapod``: every field has the legs as its first axis.
"""

import equinox as eqx
from jaxtyping import Array, Float


class LegParts(eqx.Module):
    """Mass properties of the lower or of the upper parts of all legs."""

    mass: Float[Array, " leg"]  # [kg]
    distance: Float[Array, " leg"]  # [m] from the joint at that part's end to its mass centre
    transverse_inertia: Float[Array, " leg"]  # [kg m^2] about the mass centre, across the leg
    axial_inertia: Float[Array, " leg"]  # [kg m^2] about the leg's axis


class Hexapod(eqx.Module):
    """Legs with struts (linear spring and damper in parallel) and viscous joints."""

    p_PU_P: Float[Array, "leg 3"]  # [m] spherical joints in the upper plate
    p_BA_B: Float[Array, "leg 3"]  # [m] universal joints in the bus frame
    k_B: Float[Array, "leg 3"]  # [-] unit fixed axes of the universal joints, bus frame
    stiffness: Float[Array, " leg"]  # [N/m]
    damping: Float[Array, " leg"]  # [N s/m]
    free_length: Float[Array, " leg"]  # [m] length at which the spring is free of force
    nominal_length: Float[Array, " leg"]  # [m] length with both plates in their nominal pose
    upper: LegParts
    lower: LegParts
    spherical_friction: Float[Array, " leg"]  # [N m s/rad]
    universal_friction: Float[Array, " leg"]  # [N m s/rad]

    def strut_force(
        self, length: Float[Array, " leg"], length_rate: Float[Array, " leg"]
    ) -> Float[Array, " leg"]:
        """Tension of each strut [N]: ``k (l - l0) + c dl/dt``."""
        return self.stiffness * (length - self.free_length) + self.damping * length_rate
