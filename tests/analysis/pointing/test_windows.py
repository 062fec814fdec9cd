"""Window gains and weights against averaging, closed forms, and tables of densities."""

import numpy as np
import pytest
from scipy.integrate import quad
from scipy.special import sici

from quietbus.analysis.pointing.windows import (
    LINEAR,
    METRICS,
    Metric,
    gain,
    mean_square_of_density,
    weight,
)


def averaged(metric: Metric, frequency_hz: float) -> float:
    """Mean square over phases of a metric of cos(w t + phase), by fitting lines to samples."""
    T, tau = metric.window, metric.tau
    s = (np.arange(4000) + 0.5) / 4000 - 0.5
    total = 0.0
    phases = 2 * np.pi * np.arange(16) / 16
    for phase in phases:
        x = np.cos(2 * np.pi * frequency_hz * T * s + phase)
        slope, mean = np.polyfit(s, x, 1)
        match metric.name:
            case "APE" | "rms":
                total += np.mean(x**2)
            case "MPE" | "displacement":
                total += mean**2
            case "RPE" | "MTF_loss":
                total += np.mean((x - mean) ** 2)
            case "smear":
                total += slope**2
            case "jitter":
                total += np.mean((x - mean - slope * s) ** 2)
            case _:
                later = np.cos(2 * np.pi * frequency_hz * (T * s + tau) + phase)
                total += (np.mean(later) - np.mean(x)) ** 2
    return total / len(phases)


@pytest.mark.parametrize("name", METRICS)
@pytest.mark.parametrize("turns", [0.004, 0.1, 0.31, 0.33, 1.0, 2.7])
def test_weight_is_what_averaging_finds(name, turns):
    """A sine of mean square one half, from a slow drift to many periods in the window."""
    T = 0.02
    metric = Metric(name, 0.0 if name == "stability" else T, 0.013, 0.0, 1.0)
    f = turns / T
    expected = 2.0 * averaged(metric, f)
    assert weight(metric, np.array([f]))[0] == pytest.approx(expected, rel=2e-5, abs=1e-13)


@pytest.mark.parametrize("name", LINEAR)
def test_gain_has_amplitude_and_phase_of_the_middle(name):
    f, T, at = 37.0, 0.02, 0.3
    metric = Metric(name, 0.0 if name == "stability" else T, 0.013)
    T = metric.window
    s = ((np.arange(20000) + 0.5) / 20000 - 0.5) * T
    x = lambda t: np.exp(2j * np.pi * f * t)  # noqa: E731
    expected = {
        "APE": 1.0,
        "MPE": np.mean(x(s)),
        "displacement": np.mean(x(s)),
        "smear": 12.0 * np.mean(s / (T or 1.0) * x(s)),
        "RPE": x(at * T) - np.mean(x(s)),
    }.get(name, np.mean(x(s + 0.5 * metric.tau)) - np.mean(x(s - 0.5 * metric.tau)))
    assert gain(metric, np.array([f]), at)[0] == pytest.approx(expected, rel=1e-6)


def test_known_weights():
    """As in the literature: sinc squared, and 1 less sinc squared; small windows see no jitter."""
    f, T, tau = np.array([0.0, 3.0, 40.0, 170.0]), 0.02, 0.5
    u = np.pi * f * T
    sinc = np.sinc(f * T) ** 2
    assert weight(Metric("displacement", T), f) == pytest.approx(sinc)
    assert weight(Metric("RPE", T), f) == pytest.approx(1.0 - sinc, abs=1e-12)
    stability = 2.0 * (1.0 - np.cos(2 * np.pi * f * tau)) * sinc
    assert weight(Metric("windowed_stability", T, tau), f) == pytest.approx(stability, abs=1e-12)
    change = 2.0 * (1.0 - np.cos(2 * np.pi * f * tau))  # of the line of sight itself
    assert weight(Metric("stability", tau=tau), f) == pytest.approx(change, abs=1e-12)
    smear = np.array([0.0, *(36 * ((np.sin(u[1:]) / u[1:] - np.cos(u[1:])) / u[1:]) ** 2)])
    assert weight(Metric("smear", T), f) == pytest.approx(smear, abs=1e-12)
    jitter = 1.0 - sinc - smear / 12.0
    assert weight(Metric("jitter", T), f) == pytest.approx(jitter, abs=1e-12)
    slow = 1e-3 / T  # four digits of 1e-14, where differences would have none left
    assert weight(Metric("jitter", T), np.array([slow]))[0] == pytest.approx(
        (np.pi * 1e-3) ** 4 / 45.0, rel=1e-4
    )


WHITE = {  # of one-sided density S0 over all frequencies, times T / S0
    "MPE": 0.5,
    "smear": 6.0,
    "PDE": 1.0,
    "windowed_stability": 1.0,
}


@pytest.mark.parametrize(("name", "expected"), WHITE.items())
def test_white_noise_has_closed_forms(name, expected):
    """Up to 2000 periods in a window; what lies beyond falls as one over that."""
    T = 0.1
    f = np.array([0.0, 2000.0 / T])
    found = mean_square_of_density(Metric(name, T, 0.35), f, np.array([3.0, 3.0]))
    assert found * T / 3.0 == pytest.approx(expected, rel=1e-3)


def test_band_limited_noise_has_closed_forms():
    """From 0 to B: int sinc^2 = (Si(2 pi B T) - sin^2(pi B T)/(pi B T)) / (pi T)."""
    S0, B, T = 2.0, 73.0, 0.05
    x = np.pi * B * T
    mean = S0 * (sici(2 * x)[0] - np.sin(x) ** 2 / x) / (np.pi * T)
    f, S = np.array([0.0, B]), np.array([S0, S0])
    of = lambda metric: mean_square_of_density(metric, f, S)  # noqa: E731
    assert of(Metric("APE")) == pytest.approx(S0 * B, rel=1e-9)
    assert of(Metric("MPE", T)) == pytest.approx(mean, rel=1e-9)
    assert of(Metric("RPE", T)) == pytest.approx(S0 * B - mean, rel=1e-9)
    j1 = lambda u: (np.sin(u) / u - np.cos(u)) / u  # noqa: E731
    smear = quad(lambda f: S0 * 36 * j1(np.pi * f * T) ** 2, 1e-9, B, epsabs=1e-13)[0]
    assert of(Metric("smear", T)) == pytest.approx(smear, rel=1e-8)
    assert of(Metric("jitter", T)) == pytest.approx(S0 * B - mean - smear / 12.0, rel=1e-8)
    assert of(Metric("rms", above=20.0)) == pytest.approx(S0 * (B - 20.0), rel=1e-12)
    both = np.column_stack([S, 4 * S])
    assert mean_square_of_density(Metric("MPE", T), f, both) == pytest.approx([mean, 4 * mean])


@pytest.mark.parametrize(
    ("frequency", "density", "said"),
    [
        ([0.0, 2.0, 1.0], [1, 1, 1], "increasing"),
        ([0.0, 1.0], [1, -1], "no negative"),
        ([0.0, 1.0], [1, np.nan], "finite"),
        ([0.0], [1], "two or more"),
        ([0.0, 1.0], [1, 1, 1], "a value for each"),
        ([0.0, 1e9], [1, 1], "too many periods"),
    ],
)
def test_tables_that_are_no_density_are_refused(frequency, density, said):
    with pytest.raises(ValueError, match=said):
        mean_square_of_density(Metric("MPE", 10.0), np.array(frequency), np.array(density))


@pytest.mark.parametrize(
    ("arguments", "said"),
    [
        (("RPEE", 1.0), "expected one of APE, MPE, RPE, PDE, PRE, .* got 'RPEE'"),
        (("RPE",), "RPE: expected a positive window, got 0.0"),
        (("PDE", 1.0), "PDE: expected a positive tau, got 0.0"),
        (("MTF_loss", 1.0), "expected a positive spatial_frequency"),
        (("rms", 0.0, 0.0, -1.0), "expected a frequency for above, got -1.0"),
    ],
)
def test_metrics_that_are_none_are_refused(arguments, said):
    with pytest.raises(ValueError, match=said):
        Metric(*arguments)
