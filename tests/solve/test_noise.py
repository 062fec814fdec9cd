"""Noise: its realisation in time against SciPy's splines and plain sums, its spectra's grid."""

from dataclasses import replace

import jax
import jax.numpy as jnp
import numpy as np
import pytest
from scipy.integrate import quad
from scipy.interpolate import BSpline
from scipy.signal import welch

from oracles.satellites import paper_satellite, with_cluster
from quietbus.model.disturbance import Disturbance, Spectrum
from quietbus.solve.noise import Broadband, frequency_grid, with_noise

SECONDS = 40.0
AXIAL = (np.array([2.0, 9.0, 15.0]), np.array([3e-4, 1e-4, 6e-4]))  # [Hz], [N^2/Hz]
RADIAL = (np.array([4.0, 12.0]), np.array([2e-4, 5e-5]))
ROCKING = (np.array([2.0, 15.0]), np.array([1e-6, 4e-6]))  # [N^2 m^2/Hz]
BEARING, DAMPING = 10.0, 0.08  # [Hz] of the axial mode, [-]
SEEDS = (7, 8, 9, 10)
AXES = {"s": 0, "t": 1, "g": 2}


def table(frequency, psd, logarithmic=False):
    return Spectrum(jnp.asarray(frequency), jnp.asarray(psd), logarithmic)


def noisy_satellite(spectra=None, bearing=BEARING):
    """Stiff bearings but for the axial mode; orders without amplitude."""
    spectra = spectra or (table(*RADIAL), table(*AXIAL, True), table(*ROCKING), None)
    axial = 0.5 / (np.pi * bearing) if bearing else 0.0
    disturbance = Disturbance(
        orders=(1.0, 2.0),
        coefficient=jnp.zeros((4, 2, 6)),
        phase=jnp.zeros((4, 2, 6)),
        period=jnp.tile(jnp.array([0.0, axial, 0.0]), (4, 1)),
        damping=jnp.full((4, 3), DAMPING),
        broadband=(spectra,) * 4,
    )
    return with_cluster(paper_satellite(), disturbance=disturbance)


def noise_of(satellite):
    (cluster,) = satellite.clusters
    return cluster.disturbance.noise


@pytest.fixture(scope="module")
def noise():
    return noise_of(with_noise(noisy_satellite(), SEEDS, SECONDS))


@pytest.fixture(scope="module")
def spline(noise):
    """SciPy's, of the coefficients: basis functions about the knots, going on round the period."""
    coefficients, step = np.asarray(noise.coefficients), 1.0 / float(noise.rate)
    more = np.concatenate([coefficients[-5:], coefficients, coefficients[:6]])
    knots = step * (np.arange(len(more) + 6) - 8.0)
    return BSpline(knots, more, 5)


def lines(spline, count):
    """Complex amplitudes (line, cmg, 6) at k / T, from many samples."""
    values = spline(SECONDS / count * np.arange(count))
    return np.fft.rfft(values, axis=0)[: int(SECONDS * 16.0)] * 2.0 / count


def test_noise_is_the_spline_of_its_coefficients_and_repeats(noise, spline):
    at = jax.jit(lambda t: noise.at(t))
    for t in np.random.default_rng(1).uniform(0.0, SECONDS, 40):
        value = np.asarray(at(t))
        np.testing.assert_allclose(value, spline(t), rtol=0.0, atol=1e-12)
        np.testing.assert_allclose(at(t + SECONDS), value, rtol=0.0, atol=1e-9)


def test_spline_is_the_sum_of_sines_between_its_knots_too(spline):
    """To 1e-4 of the largest, with eight knots in a turn of the fastest sine."""
    amplitude = lines(spline, 8 * 4096)
    omega = 2.0 * np.pi / SECONDS * np.arange(len(amplitude))
    size = np.max(np.abs(spline(np.arange(0.0, SECONDS, 0.01))))
    for t in np.random.default_rng(2).uniform(0.0, SECONDS, 20):
        expected = np.einsum("k,kjc->jc", np.exp(1j * omega * t), amplitude).real
        np.testing.assert_allclose(spline(t), expected, rtol=0.0, atol=1e-4 * size)


def passed(f):
    """|H|^2 of a mass that a spring and a damper hold, from it to its base."""
    r = f / BEARING
    damper = (2.0 * DAMPING * r) ** 2
    return (1.0 + damper) / ((1.0 - r**2) ** 2 + damper)


def logarithmic(f):
    frequency, psd = AXIAL
    return np.exp(np.interp(np.log(f), np.log(frequency), np.log(psd)))


def test_every_line_of_the_axial_force_has_the_size_of_its_table(spline):
    """sqrt(2 S |H|^2 / T); phases are of all directions, and each rotor has its own."""
    amplitude = lines(spline, 8 * 4096)[:, :, AXES["s"]]
    k = np.arange(len(amplitude))
    inside = (k >= 2.0 * SECONDS) & (k <= 15.0 * SECONDS)
    f = k[inside] / SECONDS
    expected = np.sqrt(2.0 * logarithmic(f) * passed(f) / SECONDS)
    found = amplitude[inside]
    np.testing.assert_allclose(np.abs(found), np.repeat(expected[:, None], 4, 1), rtol=1e-4)
    assert np.max(np.abs(amplitude[~inside])) < 1e-5 * np.max(expected)
    direction = found / np.abs(found)
    alike = np.abs(direction.conj().T @ direction) / len(f)
    assert np.max(alike - np.eye(4)) < 0.15
    assert np.max(np.abs(np.mean(direction, axis=0))) < 0.15


def test_mean_square_is_the_sum_of_the_spectrum_s_lines(spline):
    """Parseval: sum of S(k/T)/T, of both axes together where forces turn forward and backward."""
    square = np.mean(spline(SECONDS / 65536 * np.arange(65536)) ** 2, axis=0)  # (cmg, 6)
    k = np.arange(1, int(16.0 * SECONDS))
    f = k / SECONDS

    def total(values, low, high):
        return np.sum(values[(f >= low) & (f <= high)]) / SECONDS

    axial = total(logarithmic(f) * passed(f), 2.0, 15.0)
    radial = total(np.interp(f, *RADIAL), 4.0, 12.0)
    torque = total(np.interp(f, *ROCKING), 2.0, 15.0)
    np.testing.assert_allclose(square[:, 0], axial, rtol=1e-4)
    np.testing.assert_allclose(square[:, 1] + square[:, 2], 2.0 * radial, rtol=1e-4)
    np.testing.assert_allclose(square[:, 4] + square[:, 5], 2.0 * torque, rtol=1e-4)
    assert np.all(square[:, 3] == 0.0)


def test_welch_s_spectrum_is_the_table():
    """White in two bands at once, six minutes: to 3 % in the mean, nothing beyond the bands."""
    flat = (table([3.0, 11.0], [2e-4, 2e-4]), table([5.0, 14.0], [5e-4, 5e-4]), None, None)
    noise = noise_of(with_noise(noisy_satellite(flat, bearing=0.0), SEEDS, 360.0))
    rate = float(noise.rate)
    signal = jax.jit(jax.vmap(lambda t: noise.at(t)))(np.arange(0.0, 360.0, 1.0 / rate))
    f, psd = welch(signal, rate, nperseg=int(8.0 * rate), detrend=False, axis=0)
    for axis, low, high, expected in ((0, 5.0, 14.0, 5e-4), (1, 3.0, 11.0, 2e-4), (2, 3, 11, 2e-4)):
        inside, outside = (f > low + 0.5) & (f < high - 0.5), (f < low - 1.0) | (f > high + 1.0)
        assert np.mean(psd[inside, :, axis]) == pytest.approx(expected, rel=0.03)
        assert np.max(psd[outside][:, :, axis]) < 1e-5 * expected
    assert np.max(np.abs(np.mean(signal, axis=0))) < 1e-12


def test_seeds_and_numbers_of_rotors_tell_their_noise_apart():
    """Over clusters rotors are numbered on: the same seed is another noise for another rotor."""
    satellite = noisy_satellite()
    (cluster,) = satellite.clusters
    two = replace(satellite, clusters=(cluster, replace(cluster, name="second")))
    first, second = (
        np.asarray(c.disturbance.noise.coefficients)
        for c in with_noise(two, (7, 7, 9, 10, 7, 8, 9, 10), 5.0).clusters
    )
    alone = np.asarray(noise_of(with_noise(satellite, (7, 1, 9, 10), 5.0)).coefficients)
    np.testing.assert_array_equal(first[:, [0, 2, 3]], alone[:, [0, 2, 3]])
    drawn = np.concatenate([first, second, alone[:, 1:2]], axis=1)[:, :, 0]
    alike = np.corrcoef(drawn.T) - np.eye(9)
    assert np.max(np.abs(alike)) < 0.7  # of 66 lines each


@pytest.mark.parametrize("damping", [0.3, 1e-2, 1e-3, 1e-4, 1e-5])
def test_the_grid_resolves_the_peak_of_a_mode(damping):
    """Mean square of a mass on a spring that noise shakes: trapezoids against adaptive steps.

    To 1 % of the RMS value, however little damping there is.
    """
    natural = 2.0 * np.pi * 6.0
    mode = np.array([natural * (-damping + 1j * np.sqrt(1.0 - damping**2))])
    f = frequency_grid(noisy_satellite(), mode)

    def answer(f):
        r = 2.0 * np.pi * f / natural
        return logarithmic(f) / ((1.0 - r**2) ** 2 + (2.0 * damping * r) ** 2)

    flanks = np.geomspace(1.0, 1e4, 9)
    about = 6.0 * (1.0 + damping * np.concatenate([-flanks, [0.0], flanks]))
    breaks = sorted({9.0, *about[(about > 2.0) & (about < 15.0)]})
    expected, _ = quad(answer, 2.0, 15.0, points=breaks, limit=1000, epsabs=0.0, epsrel=1e-8)
    assert np.trapezoid(answer(f), f) == pytest.approx(expected, rel=0.02)
    assert (f[0], f[-1]) == pytest.approx((2.0, 15.0))


def test_mean_square_of_spectra_is_their_area_over_all_rotors_and_straight_between_looks():
    """Spectra a f of two rotors at the instants 0 and 10: area a (F^2 - f^2) / 2."""
    f = np.linspace(1.0, 5.0, 9)
    slopes = np.array([[[1.0, 2.0], [0.5, 3.0]], [[2.0, 0.0], [0.5, 9.0]]])  # look, rotor, axis
    spectra = {"bus_rate": f[:, None, None] * slopes[:, None]}
    noise = Broadband(np.array([0, 10]), f, spectra, np.zeros(0))
    found = noise.variance("bus_rate", 11)
    np.testing.assert_allclose(found[0], [1.5 * 12.0, 5.0 * 12.0])
    np.testing.assert_allclose(found[10], [2.5 * 12.0, 9.0 * 12.0])
    np.testing.assert_allclose(found[4], [1.9 * 12.0, 6.6 * 12.0])
