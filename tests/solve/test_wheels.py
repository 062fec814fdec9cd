"""Direct runs of reaction wheels: limits that are met are told, and do not stop the run."""

import numpy as np
import pytest

import quietbus as qb
from quietbus.api import QuietbusWarning
from quietbus.results import summarize


def test_limits_that_a_run_meets_are_told_with_their_times():
    """Four wheels at 2000 rpm; two are asked for more speed than their limit lets them have."""
    scenario = qb.load_scenario("wheels-demo").with_overrides(
        {
            "simulation.duration": 2.0,
            "target.guidance": {
                "max_rate": 0.004,
                "max_acceleration": 2.5e-4,
                "max_jerk": 1e-3,
            },
            "cluster.motor.speed_limit": "2050 rpm",
            "cluster.motor.torque_limit": "0.1 N*m",
        }
    )
    with pytest.warns(QuietbusWarning) as said:
        run = qb.simulate(scenario)
    notes = [str(note.message) for note in said]
    speed, time = np.abs(run["rotor_speed"].to_numpy()), run["time"].to_numpy()
    limit = 2050 * np.pi / 30
    (wheel,) = np.flatnonzero(speed.max(axis=0) > (1 - 1e-6) * limit)
    assert speed.max() < (1 + 1e-5) * limit
    first = time[np.argmax(speed[:, wheel] > (1 - 1e-6) * limit)]
    assert any(f"wheel {wheel} reached its speed limit" in note for note in notes)
    assert any(f"at t = {first:.4g} s" in note for note in notes)
    assert any("limits cut the torque to" in note for note in notes)
    assert run.attrs["status"] == "complete"
    summary = summarize(run)
    np.testing.assert_allclose(
        summary.rotor_speeds, [run["rotor_speed"].min(), run["rotor_speed"].max()]
    )
    assert summary.peak_rotor_torque == pytest.approx(float(np.abs(run["rotor_torque"]).max()))
    assert not np.any(run["gimbal_angle"])
