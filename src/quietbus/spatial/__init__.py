"""Rotations and inertia tensors: the mathematics below the physics."""

import quietbus.jaxconfig  # noqa: F401
