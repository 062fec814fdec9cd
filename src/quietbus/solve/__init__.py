"""Solvers: from a satellite and an initial state to its motion."""

import quietbus.jaxconfig  # noqa: F401
