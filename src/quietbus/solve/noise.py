"""Broadband disturbance: a realisation in time (direct solver), spectra (harmonic solver)."""

from collections.abc import Sequence
from dataclasses import dataclass, replace

import jax
import jax.numpy as jnp
import numpy as np
import scipy  # which loads its parts when they are used

from quietbus.dynamics.disturbance_response import CROSS, noise_psd
from quietbus.dynamics.vibration import Vibration
from quietbus.dynamics.views import NOTHING_SEEN, View
from quietbus.model.cluster import Cluster
from quietbus.model.disturbance import AbstractDisturbance, Noise
from quietbus.model.satellite import Satellite

KNOTS = 8.0  # of a realisation in a period of the highest frequency
PEAK = 48  # frequencies about a mode at which spectra are computed
BROAD = 240  # frequencies over the band, besides
CHUNK = 256  # frequencies that programs share


@dataclass(frozen=True)
class Broadband:
    """Spectra of the steady response to noise at some instants of a motion."""

    instants: np.ndarray  # (look,) numbers of the output instants
    frequency: np.ndarray  # (f,) [Hz]
    psd: dict[str, np.ndarray]  # (look, f, cmg, ...) by output, unit squared per Hz
    # (look, f, cmg, line, pair) of lines of sight, real part of the cross-spectra of yz, zx, xy
    cospectrum: np.ndarray

    def variance(self, name: str, count: int) -> np.ndarray:
        """Mean square (n, ...) of an output at instants 0 to ``count`` - 1, all rotors.

        Linear in time between the looks.
        """
        square = np.trapezoid(self.psd[name], self.frequency, axis=1).sum(axis=1)
        flat = square.reshape(len(square), -1)
        at = [np.interp(np.arange(count), self.instants, column) for column in flat.T]
        return np.array(at).T.reshape(count, *square.shape[1:])


def with_noise(satellite: Satellite, seeds: Sequence[int], duration: float) -> Satellite:
    """The satellite with a realisation of its rotors' broadband disturbance.

    A sum of sines 1/T apart with random phases, T being the duration at least: its mean square
    over T is exactly that of the spectra at these frequencies. It repeats after T.

    Args:
        seeds: of the rotors; the same one gives the same noise.
        duration: [s] that it is to last without repeating.
    """
    realised = []
    for cluster, own in satellite.numbered():
        numbered = list(enumerate(seeds[own], own.start))
        realised.append(_realised(cluster, numbered, duration))
    return replace(satellite, clusters=tuple(realised))


def _realised(cluster: Cluster, seeds: Sequence[tuple[int, int]], duration: float) -> Cluster:
    """A cluster with a realisation of its noise, by numbers and seeds of its rotors."""
    disturbance = cluster.disturbance
    if not disturbance.noisy:
        return cluster
    lowest, highest = _band([disturbance])
    period = max(duration, 10.0 / lowest)
    n = scipy.fft.next_fast_len(int(np.ceil(KNOTS * highest * period)), real=True)
    rate = n / period
    frequency = np.arange(1, int(highest * period + 1e-9) + 1) / period
    size = np.sqrt(2.0 * np.asarray(disturbance.density(jnp.asarray(frequency))) / period)
    draw = [np.random.default_rng([seed, j, 1]) for j, seed in seeds]
    turn = np.stack([d.uniform(-np.pi, np.pi, (len(frequency), 6)) for d in draw], axis=1)
    units = cluster.units
    inputs = jax.jit(jax.vmap(lambda w: disturbance.unit_inputs(units, units.rotor_speed, w)))(
        jnp.asarray(2.0 * np.pi * frequency)
    )
    lines = np.einsum("fjc,fjca->fja", size * np.exp(1j * turn), np.asarray(inputs))
    angle = 2.0 * np.pi * frequency / rate
    sampled = (66.0 + 52.0 * np.cos(angle) + 2.0 * np.cos(2.0 * angle)) / 120.0  # a basis spline
    spectrum = np.zeros((n // 2 + 1, *lines.shape[1:]), complex)
    spectrum[1 : len(frequency) + 1] = 0.5 * n * lines / sampled[:, None, None]
    noise = Noise(jnp.asarray(rate), jnp.asarray(scipy.fft.irfft(spectrum, n, axis=0)))
    return replace(cluster, disturbance=disturbance.with_noise(noise))


def noise_spectra(
    satellite: Satellite, small: Vibration, modes: np.ndarray, view: View
) -> tuple[np.ndarray, dict[str, np.ndarray], np.ndarray]:
    """What ``Broadband`` holds, at some instants: frequencies, spectra, co-spectra.

    Args:
        small: equations of small vibration, with a leading axis of instants.
        modes: eigenvalues of the satellite [rad/s], about which frequencies are dense.
    """
    frequency = frequency_grid(satellite, modes)
    parts = []
    for start in range(0, len(frequency), CHUNK):
        these = frequency[start : start + CHUNK]
        padded = np.pad(these, (0, CHUNK - len(these)), mode="edge")
        part = noise_psd(satellite, small, jnp.asarray(padded), view)
        parts.append({k: np.asarray(v)[:, : len(these)] for k, v in part.items()})
    psd = {k: np.concatenate([p[k] for p in parts], axis=1) for k in parts[0]}
    return frequency, psd, psd.pop(CROSS)


def noise_at(satellite: Satellite, small: Vibration) -> Broadband:
    """Spectra of the answer to noise at one instant, of which ``small`` are the equations."""
    modes = np.linalg.eigvals(small.state_matrix())
    one = jax.tree.map(lambda leaf: np.asarray(leaf)[None], small)
    return Broadband(np.zeros(1, int), *noise_spectra(satellite, one, modes, NOTHING_SEEN))


def noisy(satellite: Satellite) -> list[AbstractDisturbance]:
    """Disturbances of the clusters that have noise."""
    each = (cluster.disturbance for cluster in satellite.clusters)
    return [disturbance for disturbance in each if disturbance.noisy]


def _tables(disturbances: Sequence[AbstractDisturbance]) -> list[np.ndarray]:
    each = [s for d in disturbances for b in d.spectra() for s in b if s is not None]
    return [np.asarray(spectrum.frequency) for spectrum in each]


def _band(disturbances: Sequence[AbstractDisturbance]) -> tuple[float, float]:
    """Lowest and highest frequency [Hz] of all tables."""
    tables = _tables(disturbances)
    return float(min(t[0] for t in tables)), float(max(t[-1] for t in tables))


def frequency_grid(satellite: Satellite, modes: np.ndarray) -> np.ndarray:
    """Frequencies [Hz] that resolve the tables, their ends, and the peaks of modes.

    Args:
        satellite: with noise.
        modes: eigenvalues [rad/s] about which frequencies are dense.
    """
    low, high = _band(noisy(satellite))
    tables = _tables(noisy(satellite))
    ends = np.array([end for table in tables for end in (table[0], table[-1])])
    found = [*tables, np.geomspace(low, high, BROAD), ends * (1 - 1e-9), ends * (1 + 1e-9)]
    peaks = np.concatenate([modes.ravel(), _whirl(satellite)])
    # in half widths, so far out that the band's own spacing holds the flanks of light damping too
    about = np.sinh(np.linspace(-7.0, 7.0, PEAK + 1))
    for mode in peaks[np.abs(peaks.imag) > 0.0]:
        found.append((abs(mode.imag) + abs(mode.real) * about) / (2.0 * np.pi))
    all_ = np.unique(np.concatenate(found))
    return all_[(all_ >= low) & (all_ <= high)]


def _whirl(satellite: Satellite) -> np.ndarray:
    """Eigenvalues [rad/s] of the rotors on their bearings."""
    found = [np.zeros(0, complex)]
    for cluster in satellite.clusters:
        disturbance, units = cluster.disturbance, cluster.units
        inertia = np.asarray(units.I_RRcm_R)
        split = inertia[:, 0, 0] * np.asarray(units.rotor_speed) / inertia[:, 1, 1]
        for periods, dampings, turning in zip(
            *map(np.asarray, disturbance.bearings()), split, strict=True
        ):
            for k, (tau, zeta) in enumerate(zip(periods, dampings, strict=True)):
                if tau > 0.0:
                    gyroscopic = 1j * turning * (k == 2)
                    found.append(np.roots([1.0, 2.0 * zeta / tau - gyroscopic, tau**-2]))
    return np.concatenate(found)
