"""The harmonic solver against the direct one: slow motion, jitter and its start."""

import warnings
from dataclasses import replace

import jax
import numpy as np
import pytest

import quietbus as qb
from quietbus.build import build_initial_state, build_satellite
from quietbus.dynamics.views import NOTHING_SEEN
from quietbus.solve.direct import Tolerances, integrate
from quietbus.solve.harmonic import integrate_harmonic, respond
from quietbus.solve.periodic import on_periodic_solution

STILL = {"control": "none", "initial.attitude": [0, 0, 0]}
MOUNTS = ("isolated", "rigid")


def lines(time, signal, frequency=100.0):
    """Complex amplitudes (axis,) of order 1 in a signal with a smooth rest, by least squares."""
    u = (time - time.mean()) / (time[-1] - time[0])
    turn = 2 * np.pi * frequency * time
    columns = [f(h * turn) for h in (1, 2) for f in (np.cos, np.sin)] + [u**k for k in range(8)]
    found = np.linalg.lstsq(np.stack(columns, axis=1), signal, rcond=None)[0]
    return found[0] - 1j * found[1]


def with_jitter(satellite, time, run):
    """Slow bus rate and jitter together at all output instants."""
    phi = np.asarray(satellite.rotor_phase) + np.outer(time, satellite.rotor_speed)
    turn = np.exp(1j * phi[:, :, None] * np.array([1, 2]))
    return (
        run.slow.outputs["bus_rate"]
        + np.einsum("tjo,tjoa->ta", turn, run.jitter.amplitudes["bus_rate"]).real
    )


@pytest.mark.slow
@pytest.mark.parametrize("mount", MOUNTS)
@pytest.mark.parametrize(
    ("name", "moving", "quiet", "duration"),
    [("zhang2012", (0.5, 1.0), (5.0, 6.0), 6.0), ("zhang2012-slew", (1.0, 2.0), None, 2.0)],
)
def test_agrees_with_the_direct_solver(name, moving, quiet, duration, mount):
    """The issue's bounds: 1e-4 in amplitude, 1 % while gimbals move, 1e-3 rad, 1e-6 rad/s."""
    scenario = qb.load_scenario(name)
    if name == "zhang2012-slew":  # its first two seconds as brisk as the CMGs allow
        brisk = {"max_rate": 0.03, "max_acceleration": 0.004, "max_jerk": 0.008}
        scenario = scenario.with_overrides({"target.guidance": brisk})
    satellite = build_satellite(scenario, mount)
    state = build_initial_state(scenario, satellite)
    direct = integrate(satellite, state, duration, 1000.0, Tolerances(1e-10, 1e-12))
    run = integrate_harmonic(satellite, state, duration, 1000.0)
    whole = with_jitter(satellite, direct.time, run)
    truth = direct.outputs["bus_rate"]
    for window, amplitude in ((moving, 1e-2), (quiet, 1e-4)):
        if window is None:
            continue
        here = (direct.time >= window[0]) & (direct.time < window[1])
        found, expected = (lines(direct.time[here], rate[here]) for rate in (whole, truth))
        assert np.max(np.abs(np.abs(found / expected) - 1.0)) < amplitude
        assert np.max(np.abs(np.angle(found / expected))) < 1e-3
        assert np.max(np.abs((whole - truth)[here].mean(axis=0))) < 1e-6
        if window is moving:
            # faster than asked for; and the estimate tells how far the signal is off, ring-down
            # included, at the worst instant
            assert np.max(np.abs(direct.outputs["gimbal_rate"][here])) > 0.1
            missing = np.max(np.linalg.norm((whole - truth)[here], axis=1))
            assert 0.3 < missing / np.max(run.jitter.missing.bus_rate[here]) < 2.0
    assert run.jitter.warnings == ()


@pytest.mark.slow
@pytest.mark.parametrize("mount", MOUNTS)
def test_a_steady_start_has_no_transient(mount):
    """From rest the imbalance leaves a constant rate; from the periodic solution nothing."""
    scenario = qb.load_scenario("zhang2012").with_overrides({"initial.attitude": [0, 0, 0]})
    satellite = build_satellite(scenario, mount)
    rest = build_initial_state(scenario, satellite)
    steady = on_periodic_solution(satellite, rest)
    tight = Tolerances(1e-12, 1e-14)
    run = integrate_harmonic(satellite, rest, 1.0, 1000.0, steady=True)
    direct = integrate(satellite, steady, 1.0, 1000.0, tight).outputs["bus_rate"]
    jitter = with_jitter(satellite, run.slow.time, run)
    amplitude = np.max(np.abs(jitter))
    # every turn, 10 ms, is like the first
    turns = direct[:1000].reshape(100, 10, 3)
    assert np.max(np.abs(turns - turns[0])) < 1e-6 * amplitude
    # and is the jitter, but for products of imbalance and motion
    assert np.max(np.abs(direct - jitter)) < 1e-5 * amplitude
    started_at_rest = integrate(satellite, rest, 1.0, 1000.0, tight).outputs["bus_rate"]
    assert np.max(np.abs(started_at_rest - jitter)) > 0.1 * amplitude


def test_the_scenario_asks_for_a_steady_start():
    short = {"initial": "steady", "simulation.duration": 0.3}
    scenario = qb.load_scenario("zhang2012").with_overrides(short)
    assert scenario.initial.steady
    assert qb.Scenario.from_yaml(scenario.to_yaml()) == scenario
    run = qb.simulate(scenario)
    harmonic = qb.simulate(scenario, method="harmonic", output_rate=100.0)
    signal = qb.reconstruct(harmonic, around=0.15, span=0.3, rate=1000.0)
    amplitude = np.max(np.abs(signal))
    assert np.max(np.abs(signal.to_numpy() - run["bus_rate"][: len(signal)])) < 1e-3 * amplitude
    at_rest = qb.simulate(scenario.with_overrides({"initial.steady": False}))
    assert abs(run["bus_rate"].mean()) < 0.1 * abs(at_rest["bus_rate"].mean())


def test_reconstruction_agrees_with_a_direct_run_in_every_output():
    """Ends of the stretch included: 20 Hz outputs hold a second of 1000 Hz signal."""
    scenario = qb.load_scenario("zhang2012").with_overrides(
        {"initial": "steady", "simulation.duration": 0.5}
    )
    direct = qb.simulate(scenario)
    harmonic = qb.simulate(scenario, method="harmonic", output_rate=20.0)
    for name in ("bus_rate", "platform_rate", "leg_stroke", "leg_force"):
        signal = qb.reconstruct(harmonic, name, around=0.25, span=0.5, rate=1000.0).to_numpy()
        truth = direct[name].to_numpy()[: len(signal)]
        assert np.max(np.abs(signal - truth)) < 1e-3 * np.max(np.abs(truth)), name
    # the bus's rotation from its slow motion, and with it the line of sight
    turned = qb.reconstruct(harmonic, "bus_attitude", around=0.25, span=0.5, rate=1000.0)
    vector = 2 * direct["bus_attitude"].to_numpy()[: len(turned), 1:]
    assert np.max(np.abs(turned.to_numpy() - vector)) < 1e-2 * np.max(np.abs(vector))


def test_points_and_lines_of_sight_follow_from_rate_and_attitude():
    line, point = np.array([0.6, 0.0, 0.8]), np.array([0.2, -0.1, 1.0])
    run = qb.simulate(
        "zhang2012",
        method="harmonic",
        duration=0.2,
        points={"center": [0, 0, 0], "camera": point},
        lines_of_sight={"bore": 2 * line},
    )

    def phasor(name):
        amplitude, phase = (run[f"{name}_jitter_{p}"] for p in ("amplitude", "phase"))
        return (amplitude * np.exp(1j * phase)).isel(time=-1).to_numpy()

    s = 2j * np.pi * 100.0 * np.array([1, 2])[:, None]
    attitude, rate = phasor("bus_attitude"), phasor("bus_rate")
    assert np.max(np.abs(rate - s * attitude)) < 1e-4 * np.max(np.abs(rate))  # slow rate: small
    seen = phasor("line_of_sight")[..., 0, :]
    assert np.max(np.abs(seen - np.cross(attitude, line))) < 1e-9 * np.max(np.abs(seen))
    center, camera = np.moveaxis(phasor("point_acceleration"), 2, 0)
    expected = np.cross(s**2 * attitude, point)
    assert np.max(np.abs(camera - center - expected)) < 1e-3 * np.max(np.abs(expected))
    assert run["point_acceleration_jitter_rms"].dims == ("time", "point", "axis")
    assert list(run["point"].values) == ["center", "camera"]


def test_no_imbalance_is_no_jitter():
    none = {"cluster.rotor.static_imbalance": 0, "cluster.rotor.dynamic_imbalance": 0}
    run = qb.simulate(
        qb.load_scenario("zhang2012").with_overrides(none), method="harmonic", duration=0.2
    )
    assert np.max(run["bus_rate_jitter_amplitude"]) < 1e-15
    assert all(np.all(np.isfinite(run[name])) for name in run)


def test_a_standing_rotor_shakes_nothing():
    standing = qb.load_scenario("zhang2012").with_overrides(
        {
            "control": "none",
            "cluster.rotor": {
                "mass": 6.0,
                "spin_inertia": 0.0239,
                "speed": 0.0,
                "transverse_inertia": 0.0143,
                "static_imbalance": 1.36e-5,
            },
        }
    )
    run = qb.simulate(standing, method="harmonic", duration=0.2)
    assert np.all(run["bus_rate_jitter_amplitude"] == 0.0)
    assert np.all(run["bus_rate_jitter_envelope"] == 0.0)


UNDAMPED = {
    **STILL,
    "cluster.rotor.momentum": 0.2,
    "isolator.legs.damping": 0,
    "isolator.legs.spherical_friction": 0,
    "isolator.legs.universal_friction": 0,
    "isolator.legs.upper_part": {
        "mass": 0, "distance": 0.1, "transverse_inertia": 0, "axial_inertia": 0
    },
    "isolator.legs.lower_part": {
        "mass": 0, "distance": 0.1, "transverse_inertia": 0, "axial_inertia": 0
    },
}  # fmt: skip


def test_an_order_on_an_undamped_mode_is_named():
    """The plate bounces on its struts at sqrt(6 k s_z^2 (1/m_P + 1/m_B)), s_z^2 = 1/3."""
    bounce = np.sqrt(2 * 20e3 * (1 / 82.8 + 1 / 1000.0))
    on_it = {**UNDAMPED, "cluster.rotor.speed": bounce / 2}
    scenario = qb.load_scenario("zhang2012").with_overrides(on_it)
    for solve in (lambda: qb.simulate(scenario, method="harmonic"), lambda: qb.jitter(scenario)):
        with pytest.raises(qb.ResonanceError, match=r"order 2 of rotor 0 \(3.6\d+ Hz\).*undamped"):
            solve()
    beside = scenario.with_overrides({"cluster.rotor.speed": 0.9 * bounce / 2})
    assert np.all(np.isfinite(qb.jitter(beside).bus_rate("isolated")))


def test_an_unstable_loop_is_said_with_its_frequency():
    """Above the coupled gain limit; python-control closes the loop for comparison."""
    gains = {
        "control.pid": {"kp": 480.0, "ki": 0.24, "kd": 6000.0},
        "initial.attitude": [0, 0, 0],
    }
    scenario = qb.load_scenario("zhang2012").with_overrides(gains)
    with warnings.catch_warnings(record=True) as caught:
        warnings.simplefilter("always")
        qb.simulate(scenario, method="harmonic", duration=2.0)
    said = [str(w.message) for w in caught if w.category is qb.QuietbusWarning]
    (unstable,) = [text for text in said if "unstable" in text]
    poles = qb.analyze(scenario).controlled.poles()
    growing = poles[np.argmax(poles.real)]
    frequency = float(unstable.split("a mode at ")[1].split(" Hz")[0])
    assert growing.real > 0.0
    assert frequency == pytest.approx(abs(growing.imag) / (2 * np.pi), rel=1e-3)


def test_fast_change_beside_a_mode_is_warned_of():
    """Light damping and an order one percent beside the mode, while the gimbals move."""
    bounce = np.sqrt(2 * 20e3 * (1 / 82.8 + 1 / 1000.0))
    scenario = qb.load_scenario("zhang2012").with_overrides(
        {
            "isolator.legs.damping": 0.5,
            "cluster.rotor.momentum": 0.2,
            "cluster.rotor.speed": 1.01 * bounce,
        }
    )
    with pytest.warns(qb.QuietbusWarning, match="moves fast against the damping"):
        run = qb.simulate(scenario, method="harmonic", duration=1.0)
    assert np.max(run["jitter_change_error"]) > 0.05


def test_the_slow_motion_keeps_to_the_scenarios_tolerances():
    """Tighter ones take more steps and are recorded; the default is coarser than a direct run's."""
    scenario = qb.load_scenario("zhang2012").with_overrides({"simulation.duration": 2.0})
    tight = {"simulation.tolerances": {"relative": 1e-11, "absolute": 1e-13}}
    runs = [
        qb.simulate(each, method="harmonic") for each in (scenario, scenario.with_overrides(tight))
    ]
    given = [(run.attrs["relative_tolerance"], run.attrs["absolute_tolerance"]) for run in runs]
    assert given == [(1e-7, 1e-9), (1e-11, 1e-13)]
    assert runs[1].attrs["steps"] > 2 * runs[0].attrs["steps"]


def test_ctrl_c_keeps_the_jitter_known_so_far():
    def stop(t):
        if t > 30.0:  # the slow motion is reported as half of the way, then the jitter
            raise KeyboardInterrupt

    with pytest.warns(qb.QuietbusWarning, match="interrupted by the user"):
        run = qb.simulate("zhang2012", method="harmonic", duration=50.0, progress=stop)
    assert 1 < run.sizes["time"] < 501
    assert run.attrs["status"] == "interrupted"
    assert run.sizes["time"] == run["bus_rate_jitter_amplitude"].sizes["time"]


def test_samples_of_the_legs_do_not_show():
    """Interpolated linearisations of the legs give what those at each instant give."""
    scenario = qb.load_scenario("zhang2012")
    satellite = build_satellite(scenario)
    state = build_initial_state(scenario, satellite)
    run = integrate_harmonic(satellite, state, 5.0, 20.0)
    for k in (3, 41, 90):  # at one instant alone, nothing is interpolated
        only = lambda tree, k=k: jax.tree.map(lambda leaf: leaf[k : k + 1], tree)  # noqa: E731
        slow = run.slow
        one = replace(
            slow, time=only(slow.time), states=only(slow.states), outputs=only(slow.outputs)
        )
        alone, _ = respond(satellite, one, NOTHING_SEEN)
        found = run.jitter.amplitudes["bus_rate"][k]
        exact = alone.amplitudes["bus_rate"][0]
        assert np.max(np.abs(found - exact)) < 3e-5 * np.max(np.abs(exact))


@pytest.mark.parametrize(
    ("options", "message"),
    [
        ({"points": {"a": [1, 2]}}, r"points\['a'\]: expected 3 finite numbers"),
        ({"lines_of_sight": {"a": [0, 0, 0]}}, "expected a direction, got zero"),
        ({"joint_forces": True}, "joint_forces needs method 'direct'"),
        ({"method": "direct", "points": {"a": [0, 0, 0]}}, "need method 'harmonic'"),
        ({"method": "spectral"}, "method: expected one of 'direct', 'harmonic'"),
    ],
)
def test_wrong_options_are_named(options, message):
    with pytest.raises(ValueError, match=message):
        qb.simulate("zhang2012", **({"method": "harmonic"} | options))


def test_reconstruction_refuses_what_is_not_there():
    run = qb.simulate("zhang2012", method="harmonic", duration=0.2)
    known = "no jitter of 'rate'; it has that of bus_attitude, bus_rate, leg_force"
    with pytest.raises(ValueError, match=known):
        qb.reconstruct(run, "rate")
    with pytest.raises(ValueError, match=r"from 0 s to 0.2 s; got 0.1 s around 5 s"):
        qb.reconstruct(run, around=5.0)
    direct = qb.simulate("zhang2012", duration=0.1)
    with pytest.raises(ValueError, match="not 'harmonic'"):
        qb.reconstruct(direct)
