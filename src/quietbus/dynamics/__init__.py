"""Equations of motion of the whole satellite and what follows from them."""

import quietbus.jaxconfig  # noqa: F401
