"""What motion during an exposure takes of an image's contrast (modulation transfer function, MTF).

Spatial frequencies are in cycles per radian of the line of sight: a detector whose pixels are
p rad wide has its Nyquist frequency at 1/(2 p).
"""

import numpy as np
from numpy.typing import ArrayLike
from scipy.special import j0


def mtf_gaussian_jitter(sigma: ArrayLike, spatial_frequency: ArrayLike) -> np.ndarray:
    """exp(-2 pi^2 sigma^2 nu^2): of jitter with a Gaussian distribution of RMS ``sigma`` [rad]."""
    return np.exp(-2.0 * (np.pi * np.asarray(sigma) * np.asarray(spatial_frequency)) ** 2)


def mtf_sine_jitter(amplitude: ArrayLike, spatial_frequency: ArrayLike) -> np.ndarray:
    """abs(J0(2 pi a nu)): of a sine of amplitude a [rad] over whole periods."""
    return np.abs(j0(2.0 * np.pi * np.asarray(amplitude) * np.asarray(spatial_frequency)))


def mtf_smear(smear: ArrayLike, spatial_frequency: ArrayLike) -> np.ndarray:
    """abs(sin(pi nu s) / (pi nu s)): of a steady drift by s [rad] during the exposure."""
    return np.abs(np.sinc(np.asarray(smear) * np.asarray(spatial_frequency)))


def mtf_of_motion(motion: np.ndarray, spatial_frequency: float) -> np.ndarray:
    """MTF of any motion, without an assumption: abs of the mean of exp(-2 pi i nu x).

    Args:
        motion: (n, ...) [rad] evenly sampled over the exposure.
    """
    return np.abs(np.mean(np.exp(-2j * np.pi * spatial_frequency * np.asarray(motion)), axis=0))


def mtf_loss(
    covariance: np.ndarray, smear: np.ndarray, spatial_frequency: float, directions: np.ndarray
) -> np.ndarray:
    """1 - MTF of Gaussian jitter and smear together, in the worst direction of the grating.

    Args:
        covariance: (..., c, c) of the jitter about the smear [rad^2].
        smear: (..., c) [rad].
        directions: (d, c) unit vectors.
    """
    variance = np.einsum("da,...ab,db->...d", directions, covariance, directions)
    sigma = np.sqrt(np.maximum(variance, 0.0))
    drift = smear @ directions.T
    mtf = mtf_gaussian_jitter(sigma, spatial_frequency) * mtf_smear(drift, spatial_frequency)
    return 1.0 - np.min(mtf, axis=-1)
