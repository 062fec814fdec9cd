"""Directions in the image, all around."""

import numpy as np

DIRECTIONS = 120  # around the circle


def half_circle(components: int) -> np.ndarray:
    """Directions (d, c) of which each opposite pair has one."""
    return full_circle(components)[: max(1, DIRECTIONS // 2)] if components > 1 else np.ones((1, 1))


def full_circle(components: int) -> np.ndarray:
    """Unit vectors (d, c) all around, of one or two components."""
    if components == 1:
        return np.array([[1.0], [-1.0]])
    if components != 2:
        raise ValueError(f"image motion has one or two components, got {components}")
    angle = 2.0 * np.pi * np.arange(DIRECTIONS) / DIRECTIONS
    return np.column_stack([np.cos(angle), np.sin(angle)])
