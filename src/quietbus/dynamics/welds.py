"""Mounts that hold a body on its base: projections of the equations onto what moves freely."""

import jax.numpy as jnp
from jaxtyping import Array, Float

from quietbus.dynamics.layout import Layout
from quietbus.model.body import Mount
from quietbus.model.motion import Motion
from quietbus.model.satellite import Satellite
from quietbus.spatial.vector import cross


class Welds:
    """The welded mounts of a satellite in one configuration."""

    def __init__(self, satellite: Satellite, layout: Layout, motions: dict[str, Motion]):
        """Of all bodies' motions, along any common axes."""
        self.layout, self.free = layout, layout.free(satellite)
        self.welded: list[Mount] = [mount for mount in satellite.mounts if mount.welded]
        self.motions = motions

    def _arm(self, mount: Mount) -> Float[Array, "3"]:
        """From the origin of the base to that of the body [m]."""
        return self.motions[mount.body].p - self.motions[mount.base].p

    def onto_free(self, forces: Float[Array, "*k n"]) -> Float[Array, "*k m"]:
        """Forces on all speeds as forces on the free ones; along the last axis."""
        if not self.welded:
            return forces
        parts = {name: forces[..., self.layout.rows(name)] for name, _ in self.layout.parts}
        for mount in reversed(self.welded):
            moved = parts.pop(mount.body)
            force, torque = moved[..., :3], moved[..., 3:]
            torque = torque + cross(self._arm(mount), force)
            base = parts[mount.base]
            parts[mount.base] = base + jnp.concatenate([force, torque], axis=-1)
        return jnp.concatenate(list(parts.values()), axis=-1)

    def spread(self, u_rate: Float[Array, " m"]) -> Float[Array, " n"]:
        """Accelerations of all speeds from those of the free ones, as the bodies turn."""
        if not self.welded:
            return u_rate
        parts = {name: u_rate[self.free.rows(name)] for name, _ in self.free.parts}
        for mount in self.welded:
            base, r = parts[mount.base], self._arm(mount)
            dv, dw = base[:3], base[3:]
            turning = self.motions[mount.base].w
            dv = dv + cross(dw, r) + cross(turning, cross(turning, r))
            parts[mount.body] = jnp.concatenate([dv, dw])
        return jnp.concatenate([parts[name] for name, _ in self.layout.parts])

    def speeds(self) -> Float[Array, "n m"]:
        """All speeds by the free ones."""
        return self.onto_free(jnp.eye(self.layout.size))
