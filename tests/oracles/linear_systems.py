"""Closed loops made at random."""

import numpy as np

from quietbus.analysis.control.controlled import ControlledSatellite


def random_system(seed, n=7):
    """A plant without structure, stable on its own."""
    rng = np.random.default_rng(seed)
    A = rng.normal(size=(n, n))
    A -= (np.linalg.eigvals(A).real.max() + 0.1) * np.eye(n)
    return ControlledSatellite(A, rng.normal(size=(n, 3)), rng.normal(size=(3, n)), 1.0)
