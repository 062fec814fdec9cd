"""What physics refuses: impossible inertias and legs that do not hold the plate."""

from __future__ import annotations

from collections.abc import Iterable

import numpy as np
from numpy.typing import ArrayLike, NDArray

Vector = NDArray[np.float64]


def inertia_defect(inertia: ArrayLike, relative_tolerance: float = 1e-6) -> str | None:
    """Why no rigid body can have this inertia matrix [kg m^2], or None if one can.

    A body's principal moments are positive, and each is at most the sum of the other two (the
    triangle inequality: the second moments of mass are not negative). The tolerance lets a thin
    disc through, for which equality holds, with its moments rounded and a small imbalance.
    """
    matrix = np.asarray(inertia, dtype=float)
    if not np.allclose(matrix, matrix.T, rtol=0.0, atol=1e-9 * np.abs(matrix).max()):
        return "it is not symmetric"
    principal = np.linalg.eigvalsh(matrix)
    listed = ", ".join(f"{value:.6g}" for value in principal)
    if principal[0] <= 0.0:
        return f"it is not positive definite: its principal moments are {listed} kg m^2"
    if principal[2] > (principal[0] + principal[1]) * (1.0 + relative_tolerance):
        return (
            f"its principal moments {listed} kg m^2 break the triangle inequality: "
            "the largest exceeds the sum of the other two, which no mass distribution can do"
        )
    return None


def free_directions(
    start: ArrayLike, end: ArrayLike, relative_tolerance: float = 1e-6
) -> list[str]:
    """Motions of the plate that no leg resists, in words; empty if the legs hold it.

    A leg from ``start`` to ``end`` (n x 3) [m] resists a small motion (v, w) of the plate by
    ``s . v + (r x s) . w``, its Plücker line; the plate is held if these lines span all six
    directions.
    """
    start, end = np.asarray(start, dtype=float), np.asarray(end, dtype=float)
    s = (end - start) / np.linalg.norm(end - start, axis=1, keepdims=True)
    centre = end.mean(axis=0)
    arm = end - centre
    size = np.sqrt(np.mean(np.sum(arm**2, axis=1))) or 1.0  # makes rotations comparable
    # rotation first, so that row reduction leaves pure translations at the bottom
    lines = np.hstack([np.cross(arm, s) / size, s])
    _, values, rows = np.linalg.svd(lines)
    rank = int(np.sum(values > relative_tolerance * values[0]))
    return [
        _motion(row[3:], row[:3] / size, centre) for row in _reduced(rows[rank:], tolerance=1e-6)
    ]


def _reduced(rows: Vector, tolerance: float) -> Vector:
    """Reduced row echelon form: the same space in the plainest vectors."""
    rows, done = rows.copy(), 0
    for column in range(rows.shape[1]):
        if done == len(rows):
            break
        pivot = done + int(np.argmax(np.abs(rows[done:, column])))
        if abs(rows[pivot, column]) < tolerance:
            continue
        rows[[done, pivot]] = rows[[pivot, done]]
        rows[done] /= rows[done, column]
        others = np.arange(len(rows)) != done
        rows[others] -= np.outer(rows[others, column], rows[done])
        done += 1
    rows[np.abs(rows) < tolerance] = 0.0
    return rows


def _motion(v: Vector, w: Vector, centre: Vector) -> str:
    """A motion in words: velocity v at ``centre`` and angular velocity w."""
    if not np.any(w):
        return f"translation along {listed(v / np.linalg.norm(v))}"
    axis = w / np.linalg.norm(w)
    point = centre + np.cross(w, v) / (w @ w)
    pitch = (v @ w) / (w @ w)
    through = f"about {listed(axis)} through {listed(point)}"
    if abs(pitch) < 1e-6:
        return f"rotation {through}"
    return f"screw motion {through}, {pitch:.4g} m/rad"


def listed(vector: Iterable[float], digits: int = 4) -> str:
    """A vector as the user would write it."""
    return "[" + ", ".join(f"{round(float(value), 9) + 0.0:.{digits}g}" for value in vector) + "]"
