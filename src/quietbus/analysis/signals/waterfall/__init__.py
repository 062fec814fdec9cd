"""Fit of measured speed-frequency maps (waterfalls): orders, modes, broadband floor."""

from quietbus.analysis.signals.waterfall.fit import LEAST_SPEEDS, fit
from quietbus.analysis.signals.waterfall.lineshape import LineShape, segment_size, window_name
from quietbus.analysis.signals.waterfall.measured import FitError, Waterfall
from quietbus.analysis.signals.waterfall.modes import noise_passed, transmission
from quietbus.analysis.signals.waterfall.result import (
    ComponentFit,
    Estimate,
    FittedMode,
    FittedOrder,
)

__all__ = [
    "LEAST_SPEEDS",
    "ComponentFit",
    "Estimate",
    "FitError",
    "FittedMode",
    "FittedOrder",
    "LineShape",
    "Waterfall",
    "fit",
    "noise_passed",
    "segment_size",
    "transmission",
    "window_name",
]
