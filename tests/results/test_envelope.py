"""Jitter over time: what is put in comes out, the slow motion does not."""

import numpy as np
import pytest
import xarray as xr

from quietbus.analysis.signals.spectrum import detrended
from quietbus.results import summarize
from quietbus.results.envelope import jitter_over_time
from quietbus.scenario import load_scenario

ROTOR = 100.0  # [Hz] of zhang2012
AMPLITUDE = np.array([9e-6, 4e-6, 1e-6])  # [rad/s]


def vibrating(count=5001, rate=1000.0, slow=lambda t: 1e-3 * np.sin(0.3 * t), grows=0.0):
    """A run whose bus moves slowly and vibrates at the rotors' frequency."""
    scenario = load_scenario("zhang2012").with_overrides({"simulation.output_rate": rate})
    time = np.arange(count) / rate
    wave = (1.0 + grows * time) * np.sin(2.0 * np.pi * ROTOR * time + 0.3)
    rates = slow(time)[:, None] + wave[:, None] * AMPLITUDE
    speeds = np.full((count, 4), 2.0 * np.pi * ROTOR)
    return xr.Dataset(
        {"bus_rate": (("time", "axis"), rates), "rotor_speed": (("time", "cmg"), speeds)},
        {"time": time},
        {"scenario": scenario.to_yaml(), "mount": "isolated", "method": "direct"},
    )


def test_envelope_is_the_amplitude_of_the_vibration_whatever_the_slow_motion():
    time, jitter, envelope, span = jitter_over_time(vibrating())
    assert span == pytest.approx(10.0 / ROTOR)
    expected = np.broadcast_to(np.rad2deg(AMPLITUDE), envelope.shape)
    np.testing.assert_allclose(envelope, expected, rtol=2e-3)
    wave = np.sin(2.0 * np.pi * ROTOR * time + 0.3)[:, None] * np.rad2deg(AMPLITUDE)
    np.testing.assert_allclose(jitter, wave, atol=2e-3 * np.rad2deg(AMPLITUDE[0]))


def test_envelope_of_a_growing_vibration_is_its_amplitude_where_the_span_ends():
    time, _, envelope, span = jitter_over_time(vibrating(grows=0.2))
    inside = slice(200, -200)
    ends = (1.0 + 0.2 * (time[inside] + 0.5 * span))[:, None] * np.rad2deg(AMPLITUDE)
    np.testing.assert_allclose(envelope[inside], ends, rtol=3e-3)


def test_cubics_of_the_slow_motion_leave_nothing():
    run = vibrating(slow=lambda t: 1.0 + 2.0 * t - 0.5 * t**2 + 0.1 * t**3)
    run["bus_rate"] -= vibrating(slow=np.zeros_like)["bus_rate"]
    _, jitter, _, _ = jitter_over_time(run)
    assert np.max(abs(jitter)) < 1e-11


def test_slow_motion_is_that_of_the_second_around_each_instant():
    """The fit of ``detrended`` in that second, whose middle the smoothing gives at once."""
    run = vibrating()
    run["bus_rate"] += 1e-3 * np.random.default_rng(0).normal(size=run["bus_rate"].shape)
    time, jitter, _, _ = jitter_over_time(run)
    for middle in (600, 2345, 4321):
        second = slice(middle - 500, middle + 501)
        rates = np.rad2deg(run["bus_rate"].to_numpy()[second])
        expected = detrended(run["time"].to_numpy()[second], rates)[500]
        shown = jitter[np.argmin(abs(time - 1e-3 * middle))]
        np.testing.assert_allclose(shown, expected, rtol=1e-9, atol=1e-13)


def test_times_are_those_of_the_samples():
    """A single spike stays at its time."""
    run = vibrating()
    run["bus_rate"][2345, 1] += 1.0
    time, jitter, _, _ = jitter_over_time(run)
    assert time[np.argmax(jitter[:, 1])] == pytest.approx(2.345)
    assert time[0] == pytest.approx(0.51)
    assert time[-1] == pytest.approx(4.49)


def test_envelope_at_the_end_is_the_jitter_of_the_summary():
    run = vibrating()
    sizes = {"attitude_error": 3, "gimbal_rate": 4, "leg_stroke": 6, "leg_force": 6}
    sizes |= {"control_torque": 3}
    for name, size in sizes.items():
        run[name] = (("time", name), np.zeros((run.sizes["time"], size)))
    run["singularity_measure"] = ("time", np.ones(run.sizes["time"]))
    _, _, envelope, _ = jitter_over_time(run)
    peak = np.rad2deg(summarize(run).residual_rate)
    np.testing.assert_allclose(envelope[-1], peak, rtol=2e-3)


@pytest.mark.parametrize("count", [1, 2, 500, 1020])
def test_a_run_too_short_has_none(count):
    with pytest.raises(ValueError, match="too short"):
        jitter_over_time(vibrating(count))


def test_an_output_too_coarse_has_none():
    with pytest.raises(ValueError, match="cannot show the rotors' 100 Hz"):
        jitter_over_time(vibrating(rate=200.0))
