"""How much every axis of a loop may change at once: the symmetric multi-loop disk margin."""

import numpy as np
from scipy.optimize import minimize, minimize_scalar

from quietbus.analysis.control.controlled import ControlledSatellite


def disk_margin(system: ControlledSatellite) -> float:
    """Symmetric disk margin alpha with independent changes in the three axes.

    ``alpha = 1 / max_w mu(S - I/2)``, S the sensitivity at the actuator. For three scalar blocks
    the structured singular value mu is the least over scalings D of the largest singular value of
    D M D^-1, exactly (Packard and Doyle 1993). Each axis may be multiplied by any complex number
    in the disk through (2-alpha)/(2+alpha) and its inverse before the loop becomes unstable.
    """
    poles = system.poles()
    sizes, widths = np.abs(poles[np.abs(poles) > 1e-9]), np.linspace(-4.0, 4.0, 17)
    grid = np.geomspace(sizes.min() / 10.0, sizes.max() * 10.0, 200)
    peaks = poles[poles.imag > 0.0]
    around = (peaks.imag + np.abs(peaks.real) * widths[:, None]).ravel()
    omega = np.unique(np.concatenate([grid, around[around > grid[0]]]))
    upper = np.linalg.norm(_balanced(_symmetric(system, omega)), 2, axis=(1, 2))

    def mu(log_omega: float) -> float:
        return structured_singular_value(_symmetric(system, np.exp([log_omega]))[0])

    best = 0.0
    for i in np.argsort(upper)[::-1]:  # the bound is tight enough to leave few to refine
        if upper[i] <= best * (1.0 + 1e-9):
            break
        low, high = np.log(omega[[max(i - 1, 0), min(i + 1, len(omega) - 1)]])
        found = minimize_scalar(
            lambda x: -mu(x), bounds=(low, high), method="bounded", options={"xatol": 1e-5}
        )
        best = max(best, -float(found.fun), mu(float(np.log(omega[i]))))
    return 1.0 / best


def _symmetric(system: ControlledSatellite, omega: np.ndarray) -> np.ndarray:
    identity = np.eye(3)
    return np.linalg.inv(identity + system.loop(omega)) - 0.5 * identity


def _balanced(M: np.ndarray) -> np.ndarray:
    """Matrices (..., 3, 3) scaled by diagonals so that rows and columns weigh alike (Osborne)."""
    M = M.copy()
    for _ in range(8):
        for i in range(3):
            others = [j for j in range(3) if j != i]
            row = np.linalg.norm(M[:, i, others], axis=1)
            column = np.linalg.norm(M[:, others, i], axis=1)
            scale = np.sqrt(np.maximum(column, 1e-300) / np.maximum(row, 1e-300))
            M[:, i, :] *= scale[:, None]
            M[:, :, i] /= scale[:, None]
    return M


def structured_singular_value(M: np.ndarray) -> float:
    """Structured singular value of a 3 x 3 matrix for three complex scalars."""
    M = _balanced(M[None])[0]

    def norm(logs: np.ndarray) -> tuple[float, np.ndarray]:
        """Largest singular value of D M D^-1, and its slopes by the logarithms of D."""
        d = np.exp(np.append(logs, 0.0))
        left, sizes, right = np.linalg.svd(d[:, None] * M / d)
        slopes = np.abs(left[:, 0]) ** 2 - np.abs(right[0]) ** 2
        return float(sizes[0]), sizes[0] * slopes[:2]

    smooth = minimize(norm, np.zeros(2), jac=True, method="BFGS", options={"gtol": 1e-8})
    if np.max(np.abs(smooth.jac)) < 1e-7 * smooth.fun:
        return float(smooth.fun)
    # two singular values meet at the least one, which then has an edge
    edge = {"xatol": 1e-9, "fatol": 1e-12}
    return float(minimize(lambda x: norm(x)[0], smooth.x, method="Nelder-Mead", options=edge).fun)
