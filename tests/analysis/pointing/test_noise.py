"""Noise in every metric: closed forms, realisations in time, largest values by many members."""

import numpy as np
import pytest
from scipy.integrate import quad
from scipy.optimize import brentq
from scipy.stats import norm

from quietbus.analysis.pointing.gaussian import gaussian_radius
from quietbus.analysis.pointing.metrics import contributions, evaluate
from quietbus.analysis.pointing.motion import ImageMotion, Lines, SampledSignal
from quietbus.analysis.pointing.noise import Noise
from quietbus.analysis.pointing.statistic import INTERPRETATIONS, Statistic
from quietbus.analysis.pointing.windows import Metric, gain, weight

RMS = Statistic()
LOW, HIGH = 15.0, 130.0  # [Hz]
FLAT = np.array([[1.0, 0.55], [0.55, 0.6]]) / (HIGH - LOW)  # one-sided density: mean squares 1, 0.6
LENGTH, RATE = 200.0, 1000.0


def still(components, end=LENGTH):
    t = np.linspace(0.0, end, 4001)
    return SampledSignal(t, np.zeros((len(t), components)))


def flat(matrix=FLAT, shares=(0.3, 0.7)):
    """Two contributors of equally coloured noise, always."""
    density = np.einsum("p,ab->pab", shares, np.atleast_2d(matrix))
    names = tuple(f"part {i}" for i in range(len(shares)))
    return Noise(np.array([0.0]), np.array([LOW, HIGH]), np.tile(density, (1, 2, 1, 1, 1)), names)


def realised(matrix, length, rate, seed, gains=np.ones_like):
    """Gaussian noise of that density (n, c), or its metric, by independent lines 1/length apart."""
    n = int(length * rate)
    f = np.fft.rfftfreq(n, 1.0 / rate)
    rng = np.random.default_rng(seed)
    drawn = rng.normal(size=(len(f), len(matrix))) + 1j * rng.normal(size=(len(f), len(matrix)))
    lines = drawn @ np.linalg.cholesky(matrix).T * np.sqrt(1.0 / length) * gains(f)[:, None]
    lines[(f < LOW) | (f > HIGH)] = 0.0
    return np.fft.irfft(0.5 * n * lines, n, axis=0)


DIFFERENT = ("APE", "MPE", "RPE", "PDE", "smear", "jitter", "rms", "MTF_loss")
LINE, TURN = np.array([0.9, 0.5j]), 2 * np.pi * 40.3
LINES = Lines(
    np.tile(LINE, (4001, 1, 1)), np.array([TURN]), np.zeros(1), np.zeros(1, int), np.ones(1)
)
QUIET = Lines(0.0 * LINES.amplitude, np.array([TURN]), np.zeros(1), np.zeros(1, int), np.ones(1))


@pytest.fixture(scope="module")
def pair():
    """Line and noise as spectra, and one long realisation of both in time."""
    t = np.arange(int(LENGTH * RATE)) / RATE
    y = realised(FLAT, LENGTH, RATE, 4) + (LINE * np.exp(1j * TURN * t)[:, None]).real
    return ImageMotion(still(2), LINES, flat()), ImageMotion(SampledSignal(t, y))


@pytest.mark.parametrize(
    ("name", "window"),
    [*((n, 0.02) for n in DIFFERENT), ("jitter", 0.002), ("MTF_loss", 0.002), ("jitter", 0.3)],
)
def test_spectra_agree_with_a_realisation_in_time(pair, name, window):
    """RMS and a quantile, from windows far shorter than the noise's periods to many of them."""
    by_spectra, in_time = pair
    which = Metric(name, window, 0.33, 60.0, 0.5 if window < 0.01 else 0.1)
    for confidence in (None, 0.95):
        wanted = Statistic(confidence, "temporal", "given")
        found = evaluate(by_spectra, which, (1.0, 199.0), wanted, 0.4)
        expected = evaluate(in_time, which, (1.0, 199.0), wanted, 0.4)
        close = 0.06 if name == "MTF_loss" else 0.03  # its parts are taken as independent
        assert found == pytest.approx(expected, rel=close)


@pytest.mark.parametrize("name", ["APE", "MPE", "RPE", "PDE", "smear"])
def test_noise_alone_has_the_gaussian_radius_of_its_weights(name):
    """Independently: the weight integrated by quad; its radius by ``gaussian_radius``."""
    which = Metric(name, 0.02, 0.033)
    share = quad(lambda f: weight(which, f), LOW, HIGH, limit=400)[0]
    motion = ImageMotion(still(2), QUIET, flat())
    covariance = share * FLAT
    found = evaluate(motion, which, (1.0, 199.0), RMS)
    assert found == pytest.approx(np.sqrt(np.trace(covariance)), rel=1e-6)
    if name == "RPE":  # a mixture over the instants of the window
        return
    for p in (0.5, 1.0 - 1e-7):
        for way in ("temporal", "mixed"):
            found = evaluate(motion, which, (1.0, 199.0), Statistic(p, way), 0.1)
            assert found == pytest.approx(gaussian_radius(p, covariance), rel=1e-4)
            one = evaluate(motion.component(1), which, (1.0, 199.0), Statistic(p, way), 0.1)
            expected = np.sqrt(covariance[1, 1]) * norm.isf(0.5 * (1.0 - p))
            assert one == pytest.approx(expected, rel=1e-4)


def test_white_noise_has_its_closed_forms():
    """Density S0: the mean of a window has S0 / 2 T, its smear 6 S0 / T, a drift S0 / T."""
    T, S0 = 0.1, 3.0
    band, density = np.array([0.0, 2000.0 / T]), np.full((1, 2, 1, 1, 1), S0)
    noise = Noise(np.array([0.0]), band, density, ("white",))
    motion = ImageMotion(still(1, 10.0), QUIET_ONE, noise)
    for name, expected in (("MPE", 0.5), ("smear", 6.0), ("PDE", 1.0)):
        found = evaluate(motion, Metric(name, T, 0.4), (0.0, 10.0), RMS)
        assert found**2 * T / S0 == pytest.approx(expected, rel=1e-3)
        sigma = np.sqrt(expected * S0 / T)
        for way in ("temporal", "mixed"):
            found = evaluate(motion, Metric(name, T, 0.4), (0.0, 10.0), Statistic(0.997, way))
            assert found == pytest.approx(sigma * norm.isf(0.0015), rel=1e-3)
    above = evaluate(motion, Metric("rms", above=5000.0), (0.0, 10.0), RMS)
    assert above**2 == pytest.approx(S0 * (band[1] - 5000.0), rel=1e-9)


QUIET_ONE = Lines(
    np.zeros((4001, 1, 1), complex), np.array([TURN]), np.zeros(1), np.zeros(1, int), np.ones(1)
)


@pytest.mark.parametrize("p", [0.5, 0.95, 0.9999])
def test_a_sine_with_noise_has_the_quantile_of_their_sum(p):
    """Of A cos(phase) + n: the normal distribution, averaged over the phase."""
    A, sigma = 1.3, 0.7
    lines = Lines(
        np.full((4001, 1, 1), A + 0j), np.array([TURN]), np.zeros(1), np.zeros(1, int), np.ones(1)
    )
    motion = ImageMotion(still(1), lines, flat([[sigma**2 / (HIGH - LOW)]]))
    phase = np.pi * (np.arange(4000) + 0.5) / 4000
    sine = A * np.cos(phase)
    off = lambda r: np.mean(norm.sf((r - sine) / sigma) + norm.cdf((-r - sine) / sigma)) - (1 - p)  # noqa: E731
    expected = brentq(off, 0.0, 20.0)
    for way in ("temporal", "mixed"):
        found = evaluate(motion, Metric("APE"), (1.0, 199.0), Statistic(p, way))
        assert found == pytest.approx(expected, rel=6e-3)


@pytest.mark.parametrize("components", [1, 2])
@pytest.mark.parametrize("name", ["APE", "MPE", "PDE", "smear"])
def test_ensemble_is_the_quantile_of_the_largest_value_in_the_stretch(name, components):
    """400 members of 5 s each, in time, against the mean number of crossings."""
    which = Metric(name, 0.01, 0.33)
    matrix = FLAT[:components, :components]
    y = realised(matrix, 2000.0, RATE, 5, lambda f: gain(which, f))
    maxima = np.linalg.norm(y, axis=1).reshape(400, 5000)[:, :4200].max(axis=1)
    quiet = QUIET if components == 2 else QUIET_ONE
    motion = ImageMotion(still(components), quiet, flat(matrix))
    half = 0.5 * which.span
    for p in (0.5, 0.9):
        found = evaluate(motion, which, (10.4 - half, 14.6 + half), Statistic(p, "ensemble"))
        assert found == pytest.approx(np.quantile(maxima, p), rel=0.03)


@pytest.mark.parametrize("name", ["APE", "jitter"])
def test_interpretations_are_ordered_and_grow_with_noise(pair, name):
    loud = pair[0]
    soft = ImageMotion(loud.signal, loud.lines, flat(1e-4 * FLAT))
    silent = ImageMotion(loud.signal, loud.lines)
    which = Metric(name, 0.01, 0.033, 0.0, 0.1)
    values = {
        way: [
            evaluate(each, which, (1.0, 31.0), Statistic(0.95, way), 0.1)
            for each in (silent, soft, loud)
        ]
        for way in INTERPRETATIONS
    }
    for way, (none, little, much) in values.items():
        assert none < 1.001 * little < much, way
        assert little < 1.25 * none, way
    assert values["mixed"][2] <= 1.01 * values["temporal"][2] <= 1.02 * values["ensemble"][2]


def test_contributors_are_named_and_their_squares_add_up(pair):
    for name in DIFFERENT:
        which = Metric(name, 0.02, 0.033, 60.0, 0.1)
        parts = contributions(pair[0], which, (1.0, 199.0))
        assert set(parts) == {"slow motion", "rotor 0, 1Ω", "part 0", "part 1"}
        assert parts["part 0"] / parts["part 1"] == pytest.approx(np.sqrt(3.0 / 7.0))
        if name != "MTF_loss":
            whole = evaluate(pair[0], which, (1.0, 199.0), RMS)
            assert np.linalg.norm(list(parts.values())) == pytest.approx(whole, rel=1e-9)


def test_noise_whose_spectrum_changes_is_taken_as_it_is_at_the_time():
    """Density linear in time: the mean square over a stretch is that in its middle."""
    density = np.tile(FLAT, (3, 2, 1, 1, 1)) * np.array([0.0, 1.0, 5.0])[:, None, None, None, None]
    noise = Noise(np.array([0.0, 100.0, 200.0]), np.array([LOW, HIGH]), density, ("part",))
    motion = ImageMotion(still(2), QUIET, noise)
    for stretch, size in (((20.0, 40.0), 0.3), ((120.0, 180.0), 3.0), ((190.0, 199.0), 4.78)):
        found = evaluate(motion, Metric("APE"), stretch, RMS)
        assert found == pytest.approx(np.sqrt(1.6 * size), rel=1e-3)
    jitter = [
        evaluate(motion, Metric("jitter", 0.3), s, RMS) for s in ((20.0, 40.0), (150.0, 199.0))
    ]
    assert jitter[1] / jitter[0] == pytest.approx(np.sqrt(3.98 / 0.3), rel=2e-3)
