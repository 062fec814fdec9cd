"""The satellite against an independent engine (MuJoCo) and against conservation laws."""

from quietbus.validate.checks import Check, validate
from quietbus.validate.mjcf import write_mjcf

__all__ = ["Check", "validate", "write_mjcf"]
