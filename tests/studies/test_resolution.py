"""What a direct run's output rate cannot show; how further lines and noise combine."""

import numpy as np
import pytest

import quietbus as qb
from quietbus.analysis.jitter.combine import combine
from quietbus.studies.resolution import refuse_coarse_output, unseen


def test_ripple_beyond_the_output_rate_is_named_by_the_fastest_gimbal():
    """0.2 rad/s, 6000 lines in a turn: 191 Hz, which needs 2.56 times as many samples."""
    scenario = qb.load_scenario("zhang2012").with_overrides(
        {
            "cluster.gimbal_motor": {
                "stepping": {
                    "steps_per_turn": 3000, "frequency": 30, "damping": 0.1, "harmonics": 2
                }
            },
            "simulation.output_rate": 400.0,
        }
    )  # fmt: skip
    rates = np.array([[0.1, -0.2, 0.0, 0.05], [0.0, 0.0, 0.0, 0.0]])
    standing = np.zeros((2, 4))
    said = unseen(scenario, rates, standing)
    assert "simulation.output_rate: expected at least 488.9 Hz" in said
    assert "line 6000 in a turn, at 191 Hz" in said
    assert unseen(scenario, 0.5 * rates, standing) == ""
    assert unseen(qb.load_scenario("zhang2012"), rates, standing) == ""


def test_orders_of_wheels_count_at_the_speed_that_they_reached():
    """Order 4 at 2 pi 40 rad/s is 160 Hz, shown by 409.6 Hz and more; at the start it is slower."""
    lines = {"orders": [{"order": 4.0, "axial_force": 1e-8}]}
    scenario = qb.load_scenario("wheels-demo").with_overrides(
        {"cluster.rotor.disturbance": lines, "simulation.output_rate": 350.0}
    )
    refuse_coarse_output(scenario)
    speeds = 2.0 * np.pi * np.array([[16.0, 16.0, 16.0, 16.0], [16.0, -40.0, 20.0, 10.0]])
    said = unseen(scenario, np.zeros((2, 4)), speeds)
    assert "expected at least 409.6 Hz to show order 4 of rotor 1, at 160 Hz" in said
    assert unseen(scenario, np.zeros((2, 4)), 0.8 * speeds) == ""


def test_a_run_up_is_refused_by_the_speed_at_its_end():
    changes = {
        "cluster.rotor.disturbance": {"orders": [{"order": 4.0, "axial_force": 1e-8}]},
        "cluster.run_up": {"initial_speed": 0.0, "final_speed": "9000 rpm", "duration": 10.0},
        "simulation.output_rate": 1100.0,
    }
    scenario = qb.load_scenario("zhang2012").with_overrides(changes | {"control": "none"})
    with pytest.raises(qb.ScenarioError, match="at least 1536 Hz to show order 4 of rotor"):
        refuse_coarse_output(scenario)


def test_imbalance_alone_is_not_refused_whatever_the_output_rate():
    refuse_coarse_output(
        qb.load_scenario("zhang2012").with_overrides({"simulation.output_rate": 10.0})
    )


def test_further_lines_and_noise_add_by_closed_form():
    """A line 3 cos and a line 4 cos of other frequencies, noise of mean square 2."""
    one = combine(np.full((1, 1, 1), 3.0 + 0j), np.ones((1, 1)), np.zeros((1, 1)))
    all_ = one.with_lines(np.array([[4.0j]]), np.array([50.0]), np.zeros(1)).with_noise(
        np.array([2.0])
    )
    assert all_.envelope == pytest.approx(7.0)
    assert all_.worst_case == pytest.approx(7.0)
    assert all_.rss == pytest.approx(5.0)
    assert all_.rms == pytest.approx(np.sqrt(4.5 + 8.0 + 2.0))
