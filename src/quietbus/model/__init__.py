"""The physical parts of the satellite, each a pytree of parameters with its own small physics."""

import quietbus.jaxconfig  # noqa: F401
