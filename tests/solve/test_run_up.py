"""Rotors that run up through the isolator's resonance, by the direct solver."""

import numpy as np
import pytest
from scipy.integrate import solve_ivp

import quietbus as qb

NOTHING = {"mass": 0, "distance": 0.1, "transverse_inertia": 0, "axial_inertia": 0}
STATIC = 5e-5  # [kg m] of the one unbalanced rotor
START, DURATION, FINAL = 0.5, 5.0, 60.0  # [s], [s], [rad/s]


@pytest.fixture(scope="module")
def run():
    """One of four rotors unbalanced; heavy bus; resonance of the vertical motion at 22 rad/s."""
    zhang = qb.load_scenario("zhang2012").to_dict()
    cluster = zhang["cluster"] | {"gimbal_bandwidth": 50, "run_up": RUN_UP}
    del cluster["pyramid"]
    cluster["rotor"] |= {"static_imbalance": 0, "dynamic_imbalance": 0, "speed": FINAL}
    cluster["rotor"] |= {"spin_inertia": 0.024, "momentum": None}
    cluster["units"] = [
        {
            "position": [x, y, 0],
            "gimbal_axis": [0, 0, 1],
            "spin_axis": [-y / 0.42, x / 0.42, 0],
            "rotor": {"static_imbalance": STATIC if x > 0 else 0},
        }
        for x, y in ((0.42, 0), (0, 0.42), (-0.42, 0), (0, -0.42))
    ]
    return qb.simulate(
        qb.Scenario.from_dict(
            zhang
            | {
                "bus": {"mass": 1e12, "inertia": np.diag([1e12] * 3).tolist()},
                "cluster": cluster,
                "control": "none",
                "initial": {},
                "simulation": {"duration": 6.0, "output_rate": 200.0},
                "isolator": zhang["isolator"]
                | {
                    "legs": zhang["isolator"]["legs"]
                    | {"damping": 50, "upper_part": NOTHING, "lower_part": NOTHING}
                    | {"spherical_friction": 0, "universal_friction": 0}
                },
            }
        )
    )


RUN_UP = {"initial_speed": 0, "start": START, "duration": DURATION, "shape": "smooth"}


def speed(t):
    """3 x^2 - 2 x^3 of the final speed."""
    x = np.clip((t - START) / DURATION, 0.0, 1.0)
    return FINAL * x**2 * (3.0 - 2.0 * x)


def angle(t):
    x = np.clip((t - START) / DURATION, 0.0, 1.0)
    return FINAL * (DURATION * x**3 * (1.0 - 0.5 * x) + np.maximum(t - START - DURATION, 0.0))


def test_speed_and_angle_are_those_of_the_profile(run):
    t = run["time"].to_numpy()
    np.testing.assert_allclose(run["rotor_speed"], np.tile(speed(t)[:, None], 4), atol=1e-7)
    np.testing.assert_allclose(run["rotor_angle"][:, 3] - 2.1, angle(t), atol=1e-7)


def test_through_resonance_agrees_with_a_scalar_equation(run):
    """M z'' + c z' + k z = -m e (sin phi)'', the rotor's own z = e sin phi, from rest to 60 rad/s.

    Struts along (1, 1, 1)/sqrt(3) and the like: a third of six stiffnesses is along z.
    """
    mass, stiffness, damping = 6.8 + 4 * 19.0, 2.0 * 20e3, 2.0 * 50.0

    def rate(t, y):
        x = (t - START) / DURATION
        spin_up = 6.0 * FINAL / DURATION * x * (1.0 - x) if 0.0 <= x <= 1.0 else 0.0
        push = STATIC * (speed(t) ** 2 * np.sin(angle(t)) - spin_up * np.cos(angle(t)))
        return [y[1], (push - damping * y[1] - stiffness * y[0]) / mass]

    t = run["time"].to_numpy()
    expected = solve_ivp(rate, (0, 6), [0, 0], "DOP853", t, rtol=1e-10, atol=1e-14, max_step=0.01)
    z = run["platform_position"][:, 2].to_numpy() - run["platform_position"][0, 2].to_numpy()
    peak = np.max(np.abs(expected.y[0]))
    natural = np.sqrt(stiffness / mass)
    at_peak = speed(t[np.argmax(np.abs(expected.y[0]))])
    assert natural < at_peak < 1.6 * natural  # the response lags behind the speed
    assert np.max(np.abs(z[t < START])) < 1e-12
    np.testing.assert_allclose(z, expected.y[0], atol=3e-5 * peak)


def test_motor_torque_is_spin_inertia_times_acceleration(run):
    """Of a balanced rotor on a plate that hardly turns about its spin axis."""
    t = run["time"].to_numpy()
    x = np.clip((t - START) / DURATION, 0.0, 1.0)
    expected = 0.024 * FINAL / DURATION * 6.0 * x * (1.0 - x)
    np.testing.assert_allclose(run["rotor_torque"][:, 2], expected, atol=2e-3 * expected.max())
    assert run["rotor_torque"].attrs["units"] == "N m"
