"""A scenario against an independent program (MuJoCo) and against conservation laws."""

import quietbus.jaxconfig  # noqa: F401
from quietbus.validate.checks import export_mjcf, not_covered, validate
from quietbus.validate.mjcf import write_mjcf
from quietbus.validate.subject import Check

__all__ = ["Check", "export_mjcf", "not_covered", "validate", "write_mjcf"]
