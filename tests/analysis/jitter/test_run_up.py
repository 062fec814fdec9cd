"""A rotor passes a resonance: slowly it follows the quasi-steady map, fast it lags (Lewis)."""

import numpy as np
import pytest
import xarray as xr
from scipy.signal import cont2discrete, lfilter

from quietbus.analysis.jitter.run_up import compare_run_up, follow
from quietbus.analysis.jitter.sweep import SpeedSweep

W0, DAMPING = 2 * np.pi * 10.0, 0.05
SPEED = np.linspace(0.2, 2.5, 2000) * W0


def steady(speed, order=1.0):
    """Amplitude of x'' + 2 z w0 x' + w0^2 x = Omega^2 cos(order phi)."""
    w = order * speed
    return speed**2 / np.abs(W0**2 - w**2 + 2j * DAMPING * W0 * w)


def ramp(acceleration, start=0.5, end=1.8, dwell=6.0):
    """Time, speed and x: a dwell that lets x settle, then constant acceleration [rad/s^2]."""
    rate = 2000.0
    seconds = (end - start) * W0 / acceleration
    t = np.arange(-dwell, seconds, 1 / rate)
    run = np.maximum(t, 0.0)
    speed = start * W0 + acceleration * run
    phi = start * W0 * t + 0.5 * acceleration * run**2
    b, a, _ = cont2discrete(([1.0], [1.0, 2 * DAMPING * W0, W0**2]), 1 / rate, "foh")
    x = lfilter(b[0], a, speed**2 * np.cos(phi))
    kept = slice(int((dwell - 1.0) * rate), None, 5)
    return t[kept], speed[kept], x[kept, None]


def followed(acceleration):
    return follow(*ramp(acceleration), SPEED, steady(SPEED)[:, None])


def test_a_slow_run_up_is_quasi_steady_and_a_faster_one_is_less_so():
    errors = [float(followed(a).error[0]) for a in (0.3, 0.6, 1.2)]
    lag = 0.3 / (DAMPING * W0) ** 2  # of an amplitude that changes over the mode's own width
    assert errors[0] < 2 * lag < 0.07
    assert errors[0] < errors[1] < errors[2] < 0.1


@pytest.mark.parametrize("acceleration", [20.0, 60.0])
def test_a_fast_run_up_peaks_later_and_lower(acceleration):
    peaks = followed(acceleration).peaks(0)
    assert peaks["quasi_steady_speed"] == pytest.approx(W0 / np.sqrt(1 - 2 * DAMPING**2), rel=2e-3)
    assert peaks["speed"] > 1.02 * peaks["quasi_steady_speed"]
    assert peaks["amplitude"] < 0.9 * peaks["quasi_steady_amplitude"]
    slower = followed(acceleration / 2).peaks(0)
    assert peaks["speed"] > slower["speed"]
    assert peaks["amplitude"] < slower["amplitude"]


def test_another_order_is_followed_among_others():
    """Two lines at constant amplitudes: orders 1 and 2.5, told apart."""
    t = np.arange(0.0, 40.0, 1 / 400.0)
    speed = 20.0 + 1.0 * t
    phi = 20.0 * t + 0.5 * t**2
    signal = np.stack([3 * np.cos(phi) + 0.7 * np.cos(2.5 * phi + 1), np.cos(2.5 * phi)], axis=1)
    signal += 300.0 * np.tanh((t - 20.0) / 8.0)[:, None]  # slow motion, far larger
    flat = np.ones((2, 2))
    one = follow(t, speed, signal, [10.0, 100.0], flat, 1.0)
    assert one.amplitude[:, 0] == pytest.approx(3.0, rel=0.01)
    other = follow(t, speed, signal, [10.0, 100.0], flat, 2.5)
    assert other.amplitude[:, 0] == pytest.approx(0.7, rel=0.01)
    assert other.error[1] < 2e-3


def dataset(acceleration=2.0):
    t, speed, x = ramp(acceleration)
    rates = np.repeat(x, 3, axis=1)
    return xr.Dataset(
        {
            "rotor_speed": (("time", "cmg"), np.repeat(speed[:, None], 2, axis=1)),
            "bus_rate": (("time", "axis"), rates),
        },
        {"time": t},
    )


def sweep_of(phases=(0.0, 0.0)):
    """A map of two rotors, each with half of the amplitude."""
    half = 0.5 * steady(SPEED)[:, None, None, None] * np.ones((1, 2, 1, 3))
    turned = half * np.exp(-1j * np.array(phases))[None, :, None, None]
    own = np.full(2, SPEED[-1])
    return SpeedSweep(
        SPEED / SPEED[-1], own, np.array(phases), (1.0,), {"isolated": turned}, {}, {}
    )


def test_a_run_is_compared_with_the_map_of_a_sweep():
    for phases in ((0.0, 0.0), (0.4, -1.0)):
        found = compare_run_up(dataset(), sweep_of(phases), "isolated")
        assert found.error == pytest.approx(np.full(3, followed(2.0).error[0]), rel=1e-3)


def test_wrong_input_is_refused():
    run, sweep = dataset(20.0), sweep_of()
    with pytest.raises(ValueError, match="one of 1; got 3"):
        compare_run_up(run, sweep, "isolated", 3.0)
    differ = run.assign(rotor_speed=run["rotor_speed"] * np.array([1.0, 1.1]))
    with pytest.raises(ValueError, match="rotors of one speed"):
        compare_run_up(differ, sweep, "isolated")
    with pytest.raises(ValueError, match="expected a map from"):
        compare_run_up(run.assign(rotor_speed=3 * run["rotor_speed"]), sweep, "isolated")
    with pytest.raises(ValueError, match="speeds above zero"):
        compare_run_up(run.assign(rotor_speed=0 * run["rotor_speed"]), sweep, "isolated")
    with pytest.raises(ValueError, match="samples a second"):
        compare_run_up(run.isel(time=slice(None, None, 20)), sweep, "isolated")
    with pytest.raises(ValueError, match="periods of the line"):
        compare_run_up(run.isel(time=slice(0, 100)), sweep, "isolated")
