"""Pictures of runs, good enough for a paper; they show what the results hold."""

from quietbus.plots.analysis import analysis_figures
from quietbus.plots.compare import compare_figures, envelope_comparison
from quietbus.plots.jitter import jitter_figures
from quietbus.plots.pointing import pointing_figures
from quietbus.plots.run import run_figures
from quietbus.plots.style import save_figures
from quietbus.plots.sweep import run_up_figure, sweep_figures

__all__ = [
    "analysis_figures",
    "compare_figures",
    "envelope_comparison",
    "jitter_figures",
    "pointing_figures",
    "run_figures",
    "run_up_figure",
    "save_figures",
    "sweep_figures",
]
