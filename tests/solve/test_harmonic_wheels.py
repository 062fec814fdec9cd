"""The harmonic solver with wheels whose speeds change, against the direct one."""

import numpy as np
import pytest

import quietbus as qb

BRISK = {"max_rate": 0.004, "max_acceleration": 2.5e-4, "max_jerk": 1e-3}


@pytest.fixture(scope="module")
def runs():
    """Four seconds of a turn as brisk as the motors allow, from the periodic solution."""
    scenario = qb.load_scenario("wheels-demo").with_overrides(
        {"initial": "steady", "simulation.duration": 4.0, "target.guidance": BRISK}
    )
    return qb.simulate(scenario), qb.simulate(scenario, method="harmonic", output_rate=50.0)


def test_signal_agrees_with_the_direct_solver_while_wheels_change_speed(runs):
    """Amplitudes and phases: the phase counts turns at a changing speed."""
    direct, harmonic = runs
    change = np.abs(direct["rotor_speed"][-1] - direct["rotor_speed"][0]).to_numpy()
    assert change.max() > 30.0
    for around in (2.0, 3.7):
        signal = qb.reconstruct(harmonic, around=around, span=0.4, rate=1000.0)
        first = round(float(signal["time"][0]) * 1000.0)
        truth = direct["bus_rate"][first : first + len(signal)].to_numpy()
        u = np.linspace(-1.0, 1.0, len(truth))
        jitter = (
            truth
            - np.polynomial.polynomial.polyvander(u, 3)
            @ np.linalg.lstsq(np.polynomial.polynomial.polyvander(u, 3), truth, rcond=None)[0]
        )
        assert np.max(np.abs(signal.to_numpy() - truth)) < 1e-3 * np.max(np.abs(jitter))
    np.testing.assert_allclose(
        harmonic["rotor_speed"], direct["rotor_speed"][::20], rtol=0, atol=1e-3
    )


def test_motor_torques_agree_but_for_the_imbalance(runs):
    direct, harmonic = runs
    mean = direct["rotor_torque"][1000:3000].mean("time")
    np.testing.assert_allclose(harmonic["rotor_torque"][50:150].mean("time"), mean, atol=1e-3)
    assert np.abs(mean).max() > 0.05


def test_lines_of_wheels_that_part_are_added_without_phases(runs):
    """Speeds agree at the start alone, so that the lines beat: their amplitudes add."""
    _, harmonic = runs
    sizes = harmonic["bus_rate_jitter_amplitude"].sum(("cmg", "order"))
    np.testing.assert_allclose(harmonic["bus_rate_jitter_envelope"], sizes, rtol=1e-9)
    assert harmonic["bus_rate_jitter_envelope"].sizes["time"] == 201
    assert float(harmonic["jitter_change_error"].max()) < 0.01
