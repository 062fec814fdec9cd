"""The direct solver: accuracy, output, stops. Physics is tested in tests/dynamics and validate."""

import warnings

import numpy as np
import pytest

import quietbus as qb
from quietbus.build import build_initial_state, build_satellite
from quietbus.scenario import load_scenario
from quietbus.solve.direct import SLOW, Scheme, Tolerances, integrate

QUIET = {"control": "none", "initial.attitude": [0, 0, 0]}


def fly(overrides=None, duration=0.5, output_rate=1000.0, tolerances=None, **options):
    scenario = load_scenario("zhang2012").with_overrides(overrides or {})
    satellite = build_satellite(scenario)
    state = build_initial_state(scenario, satellite)
    return integrate(satellite, state, duration, output_rate, tolerances, **options)


@pytest.fixture(scope="module")
def exact():
    return fly(tolerances=Tolerances(1e-13, 1e-15))


def final_error(run, exact):
    """Error of the bus rate at the last instant, where no interpolation is involved."""
    return np.max(np.abs(run.outputs["bus_rate"][-1] - exact.outputs["bus_rate"][-1]))


def test_error_falls_as_the_tolerance_does(exact):
    errors = [final_error(fly(tolerances=Tolerances(r, r / 100)), exact) for r in (1e-8, 1e-10)]
    scale = np.max(np.abs(exact.outputs["bus_rate"][-1]))
    assert errors[1] < errors[0] / 20  # a hundredth of the tolerance
    assert errors[0] / scale < 1e-8
    assert errors[1] / scale < 1e-10


def test_error_and_steps_follow_an_eighth_order_method(exact):
    """Error per step ~ h^9, controlled by an estimate ~ h^8: error ~ steps^-8 or better."""
    runs = [fly(tolerances=Tolerances(r, r / 100)) for r in (1e-8, 3e-9, 1e-9, 3e-10)]
    steps = np.log([run.steps - run.rejected for run in runs])
    errors = np.log([final_error(run, exact) for run in runs])
    order = -np.polyfit(steps, errors, 1)[0]
    assert 7.0 < order < 11.0


def test_jitter_in_the_output_is_as_accurate_as_the_default_tolerance_promises(exact):
    """Interpolation between steps is the largest error; it stays below 1e-4 of the jitter."""
    jitter = lambda run: run.outputs["bus_rate"][-100:] - run.outputs["bus_rate"][-101:-1]  # noqa: E731
    difference = jitter(fly()) - jitter(exact)
    assert np.max(np.abs(difference)) < 1e-4 * np.max(np.abs(jitter(exact)))


def test_motion_does_not_depend_on_the_output_rate():
    coarse, fine = fly(duration=1.5, output_rate=100.0), fly(duration=1.5, output_rate=1000.0)
    assert coarse.steps == fine.steps
    # two programs, which may round apart
    np.testing.assert_allclose(
        coarse.outputs["bus_rate"], fine.outputs["bus_rate"][::10], atol=1e-12
    )
    np.testing.assert_allclose(coarse.final.bus.w_NX_X, fine.final.bus.w_NX_X, atol=1e-12)


@pytest.mark.parametrize("rate", [0.7, 30.0, 128.5])
def test_outputs_come_at_the_asked_instants(rate):
    run = fly(duration=2.3, output_rate=rate)
    np.testing.assert_allclose(run.time, np.arange(len(run.time)) / rate, rtol=1e-15)
    assert run.time[-1] <= 2.3 < run.time[-1] + 1 / rate
    assert np.all(np.isfinite(run.outputs["bus_attitude"]))


@pytest.mark.parametrize("duration", [1.2 - 2e-16, 1.2 + 2e-16, 1.2 + 5e-10])
def test_duration_a_rounding_off_changes_nothing(duration):
    expected, run = fly(duration=1.2), fly(duration=duration)
    np.testing.assert_array_equal(run.time, expected.time)
    np.testing.assert_allclose(run.outputs["bus_rate"], expected.outputs["bus_rate"], atol=1e-15)
    assert run.stopped is None


@pytest.mark.parametrize("duration", [0.1 * 3 * 10, 1.0000000000000002, 1e-6])
def test_instants_a_rounding_apart_do_not_stop_a_run(duration):
    run = fly(duration=duration)
    assert run.stopped is None
    assert len(run.time) == int(duration * 1000.0 + 1e-6) + 1


def test_load_with_a_steep_edge_and_a_corner_at_a_piece_end_does_not_stop_a_run():
    table = {"times": [0, 0.01, 0.0100000001, 0.05, 1.0000000000000002], "values": [0, 0, 1, 1, 0]}
    load = {"body": "bus", "force": [1.0, 0, 0], "profile": {"table": table}}
    run = fly(QUIET | {"loads": [load]}, duration=1.2)
    assert run.stopped is None
    assert len(run.time) == 1201


def test_stiff_run_can_be_watched_and_stopped_within_a_piece():
    """A slipped unit prefix on the damping: thousands of steps a second of flight."""
    reached = []

    def watch(t):
        reached.append(t)
        if len(reached) == 2:
            raise KeyboardInterrupt

    run = fly({"isolator.legs.damping": "5 MN*s/m"}, duration=1.0, progress=watch)
    assert run.interrupted
    assert 0.0 < reached[0] < reached[1] < 1.0
    assert len(run.time) == pytest.approx(reached[1] * 1000.0, abs=1.0)


def test_pieces_join_without_a_seam():
    """A free bus without rotor motion turns evenly over the joints of the pieces."""
    run = fly(
        QUIET | {"initial.rate": [0.01, 0, 0], "control": "none"}, duration=2.5 * Scheme().piece
    )
    position = run.outputs["platform_position"] - run.outputs["bus_position"]
    jumps = np.abs(np.diff(position, n=2, axis=0))
    joints = np.isclose(run.time[1:-1] % Scheme().piece, 0.0)
    assert np.max(jumps[joints]) <= 1.5 * np.max(jumps[~joints])


def test_short_load_late_in_a_calm_run_is_not_stepped_over():
    """5 ms half-sine on a satellite at rest with stopped rotors: momentum is its time integral."""
    data = load_scenario("zhang2012").to_dict()
    data["control"] = "none"
    data["initial"]["attitude"] = [0, 0, 0]
    del data["cluster"]["rotor"]["momentum"]
    data["cluster"]["rotor"] |= {"speed": 0.0, "spin_inertia": 0.0239}
    pulse = {"half_sine": {"start": 4.7312, "duration": 0.005}}
    data["loads"] = [{"body": "bus", "force": [100.0, 0, 0], "profile": pulse}]
    data["simulation"] |= {"duration": 6.0, "output_rate": 10.0}
    run = qb.simulate(qb.Scenario.from_dict(data))
    total = 1000.0 + 82.8 + 3.0
    moment = 1000.0 * run.bus_velocity[-1, 0] + (total - 1000.0) * run.platform_velocity[-1, 0]
    impulse = 100.0 * 2.0 / np.pi * 0.005
    assert run.bus_velocity[40, 0] == 0.0
    assert float(moment) == pytest.approx(impulse, rel=1e-3)


def test_unstable_loop_stops_with_the_time_and_a_reason_and_keeps_what_it_has():
    scenario = load_scenario("zhang2012").with_overrides(
        {"control.pid.kp": 2e7, "control.pid.kd": 2.5e8, "simulation.duration": 5.0}
    )
    with pytest.raises(qb.SimulationError, match=r"at t = \d.*Likely") as stopped:
        qb.simulate(scenario)
    run = stopped.value.run
    assert run.attrs["status"] == "stopped"
    assert run.sizes["time"] > 10
    for name in run.data_vars:
        assert np.all(np.isfinite(run[name])), name


def test_singular_cluster_under_pseudo_inverse_stops_instead_of_stalling():
    """Gimbal axes all along z: no torque about z can be had, and the pseudo-inverse is infinite."""
    scenario = load_scenario("zhang2012").with_overrides(
        {
            "cluster.pyramid.skew": 0.0,
            "control.steering": {"law": "pseudo_inverse"},
            "simulation.duration": 1.0,
        }
    )
    with pytest.raises(qb.SimulationError, match="singular cluster with steering by pseudo_inv"):
        qb.simulate(scenario)


def test_interrupted_run_keeps_what_it_has():
    def interrupt(t):
        if t >= 2.0:
            raise KeyboardInterrupt

    with pytest.warns(qb.QuietbusWarning, match="interrupted by the user at t = "):
        run = qb.simulate("zhang2012", duration=10.0, progress=interrupt)
    assert run.attrs["status"] == "interrupted"
    assert run.time[-1] == pytest.approx(2.0, abs=0.002)


def test_user_is_told_when_the_output_cannot_show_the_rotors():
    scenario = load_scenario("zhang2012").with_overrides(
        {"simulation.output_rate": 200.0, "simulation.duration": 0.1}
    )
    with pytest.warns(qb.QuietbusWarning, match=r"200 Hz cannot show the rotors' 100 Hz"):
        run = qb.simulate(scenario)
    assert qb.summarize(run).residual_rate is None
    with warnings.catch_warnings():
        warnings.simplefilter("error")
        qb.simulate(scenario.with_overrides({"simulation.output_rate": 256.0}))


def test_rigid_mount_keeps_the_plate_on_the_bus():
    run = fly({"isolator.mount": "rigid"}, duration=2.0)
    legs = run.outputs["leg_stroke"]
    assert np.max(np.abs(legs)) < 1e-15
    assert np.max(np.abs(run.outputs["leg_force"])) < 1e-9


def test_a_run_may_end_where_a_load_jumps():
    """The last step's last stage lies at the end, where the load is there already."""
    step = {"body": "bus", "force": [0.0, 3.0, 0.0], "profile": {"step": {"start": 0.1}}}
    tight = Tolerances(1e-10, 1e-14)
    there, beyond = (fly({"loads": [step]}, end, 100.0, tight, scheme=SLOW) for end in (0.1, 0.11))
    assert there.stopped is None
    assert len(there.time) == 11
    for name in ("p_NX_N", "v_NX_N", "w_NX_X"):
        expected = getattr(beyond.states.bus, name)[10]
        found = getattr(there.states.bus, name)[10]
        np.testing.assert_allclose(found, expected, rtol=1e-6, atol=1e-13)
