"""Pointing metrics: closed forms of sine, ramp and noise, time against frequency, statistics."""

import numpy as np
import pytest
from scipy.stats import chi2, norm

from quietbus.analysis.pointing.gaussian import gaussian_radius
from quietbus.analysis.pointing.image_quality import (
    mtf_gaussian_jitter,
    mtf_of_motion,
    mtf_sine_jitter,
    mtf_smear,
)
from quietbus.analysis.pointing.metrics import contributions, evaluate
from quietbus.analysis.pointing.motion import ImageMotion, Lines, SampledSignal
from quietbus.analysis.pointing.statistic import INTERPRETATIONS, Statistic
from quietbus.analysis.pointing.windows import (
    LINEAR,
    METRICS,
    Metric,
    mean_square_of_density,
    weight,
)

RMS = Statistic()
GIVEN = Statistic(phases="given")
T, TAU, NU = 0.013, 0.21, 20.0  # no whole number of periods of anything


def metric(name, window=T):
    return Metric(name, 0.0 if name == "stability" else window, TAU, 10.0, NU)


def sampled(function, end=10.0, rate=1000.0):
    t = np.arange(int(end * rate) + 1) / rate
    y = np.asarray(function(t))
    return SampledSignal(t, y.reshape(len(t), -1))


def still(components, end=10.0):
    return sampled(lambda t: np.zeros((len(t), components)), end, 10.0)


def with_lines(amplitude, frequency, rotor=None, order=None, phase=0.0):
    """Constant lines (line, c) on a motion that rests."""
    amplitude = np.atleast_2d(np.asarray(amplitude, complex))
    n = len(amplitude)
    signal = still(amplitude.shape[1])
    lines = Lines(
        np.broadcast_to(amplitude, (len(signal.time), *amplitude.shape)),
        np.broadcast_to(np.asarray(frequency, float), n),
        np.broadcast_to(np.asarray(phase, float), n),
        np.arange(n) if rotor is None else np.asarray(rotor),
        np.ones(n) if order is None else np.asarray(order),
    )
    return ImageMotion(signal, lines)


# ---- a pure sine: A = 2, 60 Hz

A, F = 2.0, 60.0
SINE = ImageMotion(sampled(lambda t: A * np.cos(2 * np.pi * F * t + 0.4)))
SINE_LINE = with_lines([[A]], 2 * np.pi * F, phase=0.4)
U = np.pi * F * T
SINC = np.sin(U) / U
J1 = (np.sin(U) / U - np.cos(U)) / U
SINE_AMPLITUDE = {
    "APE": A,
    "MPE": A * abs(SINC),
    "displacement": A * abs(SINC),
    "smear": A * 6 * abs(J1),
    "PDE": A * 2 * abs(np.sin(np.pi * F * TAU) * SINC),
    "PRE": A * 2 * abs(np.sin(np.pi * F * TAU) * SINC),
    "windowed_stability": A * 2 * abs(np.sin(np.pi * F * TAU) * SINC),
    "stability": A * 2 * abs(np.sin(np.pi * F * TAU)),
}


@pytest.mark.parametrize("motion", [SINE, SINE_LINE], ids=["time", "frequency"])
@pytest.mark.parametrize("name", SINE_AMPLITUDE)
def test_sine_in_every_linear_metric(motion, name):
    """The metric is a sine too: RMS A/sqrt(2), quantile by the arcsine law A sin(pi p/2)."""
    amplitude = SINE_AMPLITUDE[name]
    stretch = (0.5, 9.5)
    found = evaluate(motion, metric(name), stretch, RMS)
    assert found == pytest.approx(amplitude / np.sqrt(2.0), rel=2e-3)
    for way in ("temporal", "mixed"):
        found = evaluate(motion, metric(name), stretch, Statistic(0.9, way))
        assert found == pytest.approx(amplitude * np.sin(0.45 * np.pi), rel=3e-3)
    found = evaluate(motion, metric(name), stretch, Statistic(0.9, "ensemble"))
    assert found == pytest.approx(amplitude, rel=1e-4)


@pytest.mark.parametrize("motion", [SINE, SINE_LINE], ids=["time", "frequency"])
def test_sine_in_the_others(motion):
    stretch = (0.5, 9.5)
    of = lambda name, *statistic: evaluate(motion, metric(name), stretch, Statistic(*statistic))  # noqa: E731
    assert of("RPE") == pytest.approx(A * np.sqrt(0.5 * (1 - SINC**2)), rel=5e-3)
    assert of("RPE", 1 - 1e-9) <= A * (1.0 + abs(SINC))
    assert of("jitter") == pytest.approx(A * np.sqrt(0.5 * (1 - SINC**2 - 3 * J1**2)), rel=2e-3)
    assert of("rms") == pytest.approx(A / np.sqrt(2.0), rel=1e-3)
    beyond = Metric("rms", above=61.0)
    assert evaluate(motion, beyond, stretch, RMS) < 1e-3 * A


# ---- a ramp

RATE = 3e-2
RAMP = ImageMotion(sampled(lambda t: RATE * t, rate=10.0))


def test_ramp_in_every_metric():
    stretch = (2.0, 8.0)
    of = lambda name, *statistic: evaluate(RAMP, metric(name), stretch, Statistic(*statistic))  # noqa: E731
    assert of("APE", 0.9) == pytest.approx(RATE * (2.0 + 0.9 * 6.0), rel=1e-3)
    assert of("APE", 0.9, "ensemble") == pytest.approx(RATE * 8.0, rel=1e-3)
    assert of("APE") == pytest.approx(RATE * np.sqrt((8**3 - 2**3) / 18.0), rel=1e-3)
    assert of("MPE", 0.5) == pytest.approx(RATE * 5.0, rel=1e-3)
    assert of("RPE") == pytest.approx(RATE * T / np.sqrt(12.0), rel=2e-2)
    assert of("RPE", 0.9) == pytest.approx(RATE * T * 0.45, rel=2e-2)
    for name in ("PDE", "PRE", "windowed_stability", "stability"):
        assert of(name, 0.3) == pytest.approx(RATE * TAU, rel=1e-9)
    assert of("smear", 0.3) == pytest.approx(RATE * T, rel=1e-9)
    assert of("jitter") < 1e-12 * RATE
    assert of("rms") < 1e-9
    assert of("MTF_loss") == pytest.approx(1.0 - np.sinc(NU * RATE * T), rel=1e-9)


# ---- noise, within the bounds of chi-square

NOISE_RATE, SIGMA, LENGTH = 1000.0, 0.7, 200.0


def noise(band):
    """Gaussian, flat up to ``band`` [Hz], nothing above."""
    n = int(LENGTH * NOISE_RATE) + 1
    rng = np.random.default_rng(8)
    spectrum = np.fft.rfft(rng.normal(size=n))
    f = np.fft.rfftfreq(n, 1.0 / NOISE_RATE)
    spectrum[f > band] = 0.0
    y = np.fft.irfft(spectrum, n)
    y *= SIGMA / np.std(y)
    return SampledSignal(np.arange(n) / NOISE_RATE, y[:, None])


@pytest.fixture(scope="module", params=[120.0, 390.0], ids=["band-limited", "nearly white"])
def random_motion(request):
    return request.param, ImageMotion(noise(request.param))


@pytest.mark.parametrize("name", [n for n in METRICS if n != "MTF_loss"])
def test_noise_in_time_agrees_with_its_density(random_motion, name):
    """Within chi-square's bound at 1e-4, for as many independent windows as there are."""
    band, motion = random_motion
    which = Metric(name, 0.0 if name == "stability" else 0.05, 0.33, 10.0)
    f = np.array([0.0, band])
    expected = mean_square_of_density(which, f, np.full(2, SIGMA**2 / band))
    found = evaluate(motion, which, (0.0, LENGTH), RMS) ** 2
    free = LENGTH / 0.05 * (0.7 if name in ("PDE", "PRE", "windowed_stability") else 1.0)
    low, high = chi2.ppf([1e-4, 1 - 1e-4], 0.5 * free) / (0.5 * free)
    assert low < found / expected < high


def test_white_noise_in_time_has_its_closed_forms(random_motion):
    """Density S0 = 2 sigma^2 / rate: the mean of a window has S0 / (2 T), its smear 6 S0 / T."""
    band, motion = random_motion
    S0, window = SIGMA**2 / band, 0.1
    for name, expected in (("MPE", 0.5), ("smear", 6.0), ("PDE", 1.0)):
        found = evaluate(motion, Metric(name, window, 0.4), (0.0, LENGTH), RMS) ** 2
        edge = 0.02 if name != "smear" else 0.06  # what lies beyond the band
        assert found * window / S0 == pytest.approx(expected, rel=0.12 + edge)
    total = evaluate(motion, Metric("jitter", window), (0.0, LENGTH), RMS) ** 2
    assert total == pytest.approx(SIGMA**2 - S0 / window, rel=0.02)


def test_gaussian_noise_has_gaussian_quantiles(random_motion):
    _, motion = random_motion
    found = evaluate(motion, Metric("APE"), (0.0, LENGTH), Statistic(0.9))
    assert found == pytest.approx(SIGMA * norm.ppf(0.95), rel=0.05)


def test_gaussian_radius_of_one_and_two_components():
    assert gaussian_radius(0.997, np.array([[4.0]])) == pytest.approx(2 * norm.ppf(0.9985))
    assert gaussian_radius(0.9, 4.0 * np.eye(2)) == pytest.approx(2 * np.sqrt(-2 * np.log(0.1)))
    assert gaussian_radius(0.9, np.diag([4.0, 0.0])) == pytest.approx(2 * norm.ppf(0.95))
    covariance = np.array([[4.0, 1.2], [1.2, 0.5]])
    drawn = np.random.default_rng(1).multivariate_normal([0, 0], covariance, 400_000)
    expected = np.quantile(np.linalg.norm(drawn, axis=1), 0.95)
    assert gaussian_radius(0.95, covariance) == pytest.approx(expected, rel=5e-3)
    assert gaussian_radius(0.9, np.zeros((2, 2))) == 0.0


# ---- several lines

SEVERAL = with_lines(
    [[1.0, 0.3j], [0.4 - 0.6j, 1.0], [0.2, 0.5j], [0.7j, 0.1]],
    2 * np.pi * np.array([60.0, -60.0, 120.0, 87.3]),
    rotor=[0, 1, 0, 2],
    order=[1, 1, 2, 1],
    phase=[0.3, 1.0, 0.6, 2.0],
)


def signal_of(motion):
    """The same motion with its lines in the samples."""
    t = np.arange(20001) / 2000.0
    return ImageMotion(SampledSignal(t, motion.phasors(t).sum(axis=1).real + motion.signal.at(t)))


@pytest.mark.parametrize("name", METRICS)
@pytest.mark.parametrize("confidence", [None, 0.8])
def test_lines_as_given_are_the_signal_that_they_make(name, confidence):
    """Frequency domain, exactly and with coherent lines, against windows of samples."""
    which = Metric(name, 0.0 if name == "stability" else T, TAU, 70.0, 0.05)
    wanted = Statistic(confidence, "temporal", "given")
    in_time = evaluate(signal_of(SEVERAL), which, (1.0, 9.0), wanted)
    by_lines = evaluate(SEVERAL, which, (1.0, 9.0), wanted)
    assert by_lines == pytest.approx(in_time, rel=1.5e-2)


def test_windows_of_samples_are_those_of_fitted_lines():
    """SampledSignal.windows against a least-squares fit to finely reconstructed motion."""
    motion = signal_of(SEVERAL)
    centers = np.array([2.0, 3.3, 7.123])
    parts = motion.signal.windows(centers, T)
    for i, c in enumerate(centers):
        s = (np.arange(20000) + 0.5) / 20000 - 0.5
        y = SEVERAL.phasors(c + T * s).sum(axis=1).real
        slope, mean = np.polyfit(s, y, 1)
        rest = y - mean - np.outer(s, slope)
        assert parts.mean[i] == pytest.approx(mean, abs=1e-4)
        assert parts.smear[i] == pytest.approx(slope, abs=2e-4)
        assert parts.about_line[i] == pytest.approx(rest.T @ rest / len(s), abs=2e-4)
        around = y - mean
        assert parts.about_mean[i] == pytest.approx(around.T @ around / len(s), abs=2e-4)


def test_independent_phases_add_squares():
    for name in METRICS:
        if name == "MTF_loss":
            continue
        which = Metric(name, 0.0 if name == "stability" else T, TAU, 70.0)
        lines = SEVERAL.lines
        f = np.abs(lines.frequency) / (2 * np.pi)
        squares = 0.5 * np.sum(np.abs(lines.amplitude[0]) ** 2, axis=1)
        expected = np.sqrt(weight(which, f) @ squares)
        assert evaluate(SEVERAL, which, (1.0, 9.0), RMS) == pytest.approx(expected, rel=1e-9)
        parts = contributions(SEVERAL, which, (1.0, 9.0))
        assert np.linalg.norm(list(parts.values())) == pytest.approx(expected, rel=1e-9)
        assert set(parts) == {"slow motion", *lines.names}


def test_slow_motion_and_lines_add_squares():
    """A harmonic run: the slow motion's windows in time, the lines' in frequency."""
    slow = sampled(lambda t: 0.5 * t, rate=10.0)
    both = ImageMotion(slow, SINE_LINE.lines)
    for name in ("RPE", "smear", "jitter", "PDE"):
        parts = [
            evaluate(each, metric(name), (1.0, 9.0), RMS) for each in (ImageMotion(slow), SINE_LINE)
        ]
        assert evaluate(both, metric(name), (1.0, 9.0), RMS) == pytest.approx(
            np.hypot(*parts), rel=3e-3
        )
    whole = ImageMotion(sampled(lambda t: 0.5 * t + A * np.cos(2 * np.pi * F * t + 0.4), rate=2000))
    for confidence in (None, 0.9):
        wanted = Statistic(confidence, "temporal", "given")
        for name in ("RPE", "smear", "PDE", "APE"):
            in_time = evaluate(whole, metric(name), (1.0, 9.0), wanted)
            assert evaluate(both, metric(name), (1.0, 9.0), wanted) == pytest.approx(
                in_time, rel=1e-2
            )


# ---- the ensemble: rotor phases

TWINS = with_lines([[1.0], [1.0]], 2 * np.pi * F)


@pytest.mark.parametrize("p", [0.5, 0.9, 0.99])
def test_two_equal_lines_of_one_frequency_under_all_interpretations(p):
    """Together 2 cos(delta/2) cos(w t): the arcsine law over members, over time, and over both."""
    one = np.sin(0.5 * np.pi * p)
    of = lambda way: evaluate(TWINS, Metric("APE"), (1.0, 9.0), Statistic(p, way))  # noqa: E731
    assert of("ensemble") == pytest.approx(2.0 * one, rel=5e-2 if p < 0.9 else 1e-2)
    assert of("temporal") == pytest.approx(2.0 * one, rel=5e-3)
    angle = np.pi * (np.arange(1500) + 0.5) / 1500
    both = np.abs(2.0 * np.outer(np.cos(angle), np.cos(angle)))
    assert of("mixed") == pytest.approx(np.quantile(both, p), rel=1e-2)


def test_a_circle_has_one_radius_under_all_interpretations():
    circle = with_lines([[1.0, 1j]], 2 * np.pi * F)
    for way in INTERPRETATIONS:
        found = evaluate(circle, Metric("APE"), (1.0, 9.0), Statistic(0.9, way))
        assert found == pytest.approx(1.0, rel=1e-3)


def test_many_circles_come_to_rayleigh():
    n = 60
    many = with_lines(np.tile([[1.0, 1j]], (n, 1)), 2 * np.pi * F)
    found = evaluate(many, Metric("APE"), (1.0, 9.0), Statistic(0.9, "mixed"))
    assert found == pytest.approx(np.sqrt(n * np.log(10.0)), rel=1e-2)


def test_the_worst_member_has_all_rotors_in_phase():
    """Lines along one direction: the sum of amplitudes, whatever their phases are."""
    rng = np.random.default_rng(3)
    sizes = rng.uniform(0.2, 1.0, 5)
    line = with_lines(sizes[:, None] * np.exp(1j * rng.uniform(0, 6, 5))[:, None], 2 * np.pi * F)
    found = evaluate(line, Metric("APE"), (1.0, 9.0), Statistic(0.95))
    assert found == pytest.approx(np.sum(sizes) * np.sin(0.475 * np.pi), rel=3e-3)
    rare = evaluate(line, Metric("APE"), (1.0, 9.0), Statistic(1 - 1e-6, "ensemble"))
    assert rare == pytest.approx(np.sum(sizes), rel=1e-3)


@pytest.mark.parametrize("name", ["APE", "smear", "jitter", "rms"])
def test_no_members_tried_at_random_are_worse_than_the_worst(name):
    """Four rotors with two orders each, none of which can be neglected."""
    rng = np.random.default_rng(0)
    amplitude = rng.normal(size=(8, 2)) + 1j * rng.normal(size=(8, 2))
    order, rotor = np.tile([1, 2], 4), np.repeat(range(4), 2)
    which = Metric(name, 0.005, 0.0, 10.0)
    motion = with_lines(amplitude, 200 * np.pi * order, rotor, order)
    found = evaluate(motion, which, (1.0, 9.0), Statistic(0.95))
    tried = []
    for turns in rng.uniform(0, 2 * np.pi, (300, 4)):
        member = with_lines(amplitude, 200 * np.pi * order, rotor, order, order * turns[rotor])
        wanted = Statistic(0.95, "temporal", "given")
        tried.append(evaluate(member, which, (1.0, 9.0), wanted, 0.05))
    assert found > 0.995 * max(tried)
    assert found < 1.6 * max(tried)


@pytest.mark.parametrize("name", LINEAR)
def test_interpretations_are_ordered(name):
    """Always for a share of members is more than a share of all; so is the worst member's."""
    ensemble, temporal, mixed = (
        evaluate(SEVERAL, metric(name), (1.0, 9.0), Statistic(0.95, way)) for way in INTERPRETATIONS
    )
    assert mixed < temporal
    assert mixed < ensemble


# ---- images


def test_mtf_of_motion_has_the_closed_forms():
    x = (np.arange(200_000) + 0.5) / 200_000
    sine = 0.3 * np.sin(2 * np.pi * 3 * x)
    assert mtf_of_motion(sine, 0.7) == pytest.approx(mtf_sine_jitter(0.3, 0.7), abs=1e-9)
    assert mtf_of_motion(0.4 * x, 1.3) == pytest.approx(mtf_smear(0.4, 1.3), abs=1e-9)
    gauss = norm.ppf(x) * 0.2
    assert mtf_of_motion(gauss, 0.8) == pytest.approx(mtf_gaussian_jitter(0.2, 0.8), abs=1e-5)
    assert mtf_gaussian_jitter(0.0, 5.0) == mtf_smear(0.0, 5.0) == mtf_sine_jitter(0.0, 5.0) == 1.0


def test_mtf_loss_of_a_fast_sine_is_the_true_one_while_it_is_small():
    """Gaussian and sine have the same loss to second order, 1 - (pi a nu)^2."""
    fast = with_lines([[A]], 2 * np.pi * 400.0)
    nu = 0.02
    found = evaluate(fast, Metric("MTF_loss", 0.1, 0, 0, nu), (1.0, 9.0), RMS)
    assert found == pytest.approx(1.0 - mtf_sine_jitter(A, nu), rel=2e-2)


def test_mtf_loss_is_that_of_the_worst_direction():
    """Motion along one oblique axis: gratings across it lose as one component does, others less."""
    oblique = with_lines([[0.6 * A, 0.8 * A]], 2 * np.pi * F)
    which = Metric("MTF_loss", T, 0, 0, 0.02)
    one = evaluate(SINE_LINE, which, (1.0, 9.0), RMS)
    assert evaluate(oblique, which, (1.0, 9.0), RMS) == pytest.approx(one, rel=5e-3)
    part = evaluate(oblique.component(0), which, (1.0, 9.0), RMS)
    assert part == pytest.approx(0.36 * one, rel=2e-2)


# ---- bad input


@pytest.mark.parametrize(
    ("which", "stretch", "said"),
    [
        (Metric("RPE", 20.0), (0.0, 10.0), "expected a window of at most 10 s, .* got 20 s"),
        (Metric("PDE", 5.0, 6.0), (0.0, 10.0), "window and tau together of at most 10 s"),
        (Metric("APE"), (5.0, 11.0), "within the run, 0 s to 10 s; got 5 s to 11 s"),
        (Metric("APE"), (5.0, 4.0), "expected a stretch"),
    ],
)
def test_windows_longer_than_the_stretch_are_refused(which, stretch, said):
    with pytest.raises(ValueError, match=said):
        evaluate(RAMP, which, stretch, RMS)


@pytest.mark.parametrize("p", [0.0, 1.0, -0.1, 1.5, np.nan])
def test_confidence_levels_lie_between_0_and_1(p):
    with pytest.raises(ValueError, match="expected a confidence level between 0 and 1"):
        Statistic(p)


def test_unknown_words_and_bad_signals_are_refused():
    with pytest.raises(ValueError, match="one of ensemble, temporal, mixed; got always"):
        Statistic(0.9, "always")
    with pytest.raises(ValueError, match="random or given, got worst"):
        Statistic(0.9, "mixed", "worst")
    t = np.array([0.0, 1.0, 3.0])
    with pytest.raises(ValueError, match="evenly spaced"):
        SampledSignal(t, np.zeros((3, 1)))
    with pytest.raises(ValueError, match="all finite"):
        SampledSignal(np.arange(3.0), np.full((3, 1), np.nan))
    with pytest.raises(ValueError, match="one or two components, got 3"):
        evaluate(
            with_lines([[1, 1, 1]], 9.0), Metric("APE"), (1.0, 9.0), Statistic(0.9, "ensemble")
        )
