"""Measured speed-frequency maps (waterfalls) of a rotor's forces and torques: files and fit."""

from quietbus.measured.check import MapError
from quietbus.measured.fitted import WaterfallFit, fit_waterfall
from quietbus.measured.read import read_waterfall

__all__ = ["MapError", "WaterfallFit", "fit_waterfall", "read_waterfall"]
