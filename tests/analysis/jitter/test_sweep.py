"""Modes over rotor speed and critical speeds, against closed forms and the linearisation."""

from types import SimpleNamespace

import numpy as np
import pytest

import quietbus as qb
from oracles.several import with_payload
from quietbus.analysis.control.modes import free_modes
from quietbus.analysis.jitter.sweep import SpinningModes, bearing_critical_speeds, critical_speeds
from quietbus.build import build_satellite

SPEED = 2 * np.pi * 100.0


def plant(M, C, G, K):
    M, C, G, K = (np.atleast_2d(np.asarray(m, dtype=float)) for m in (M, C, G, K))
    return SpinningModes(M, C, G, K, 0.0 * K, {"plate": np.eye(12, len(M))})


def test_critical_speeds_of_a_single_axis_resonance_have_a_closed_form():
    mass, damping, stiffness = 80.0, 900.0, 40e3
    natural = np.sqrt(stiffness / mass)
    ratio = damping / (2 * np.sqrt(stiffness * mass))
    found = critical_speeds(
        plant(mass, damping, 0, stiffness), np.array([SPEED]), (0.37, 1, 2), 1.2
    )
    assert [critical.order for critical in found] == [2, 1, 0.37]
    for critical in found:
        expected = natural * np.sqrt(1 - ratio**2) / critical.order
        assert critical.speed == pytest.approx(expected, rel=1e-10)
        assert critical.factor == pytest.approx(expected / SPEED, rel=1e-10)
        assert critical.mode.damping == pytest.approx(ratio, rel=1e-10)
        assert critical.amplification == pytest.approx(1 / (2 * ratio), rel=1e-10)
        assert critical.cmgs == (0,)


def test_modes_split_and_meet_the_orders_where_the_gyroscopic_closed_form_says():
    """I a'' + f H b' + k a = 0, I b'' - f H a' + k b = 0: ways of whirl +-."""
    inertia, momentum, stiffness = 2.0, 300.0, 5000.0
    gyro = plant(
        np.eye(2) * inertia,
        np.zeros((2, 2)),
        [[0, momentum], [-momentum, 0]],
        np.eye(2) * stiffness,
    )
    for factor in (0.0, 0.4, 1.1):
        half = factor * momentum / (2 * inertia)
        root = np.sqrt(stiffness / inertia + half**2)
        assert gyro.frequencies(factor) == pytest.approx([root - half, root + half], rel=1e-10)
    found = critical_speeds(gyro, np.array([SPEED]), (1,), 1.5)
    signs = (1, -1)  # the slow whirl is met first
    expected = [np.sqrt(stiffness / (inertia * SPEED**2 + s * SPEED * momentum)) for s in signs]
    assert [critical.factor for critical in found] == pytest.approx(expected, rel=1e-10)
    assert all(np.isinf(critical.amplification) for critical in found)


def test_a_ray_that_never_meets_an_overdamped_mode_and_rotors_by_speed():
    decaying = plant(1.0, 100.0, 0, 100.0)
    assert critical_speeds(decaying, np.array([SPEED]), (1, 2), 1.0) == ()
    two = critical_speeds(plant(1.0, 0.1, 0, 100.0), SPEED * np.array([1, -1, 0.5, 0]), (1,), 1.0)
    assert [critical.cmgs for critical in two] == [(0, 1), (2,)]
    assert [critical.speed for critical in two] == pytest.approx([10.0, 10.0], rel=1e-4)


def test_matrices_that_do_not_follow_the_speed_are_refused():
    factor = np.array([0.0, 0.5, 1.0])
    C = (factor**2)[:, None, None] * np.eye(2)
    still = np.broadcast_to(np.eye(2), (3, 2, 2))
    small = SimpleNamespace(M=still, C=C, K=still, projection=None)
    with pytest.raises(ValueError, match="does not follow"):
        SpinningModes.between(small, factor)


@pytest.fixture(scope="module")
def turned():
    """A study with net momentum, so that modes split."""
    return qb.jitter("zhang2012", np.deg2rad([80.0, 75.0, -70.0, 60.0]))


@pytest.fixture(scope="module")
def sweep(turned):
    return turned.sweep()


def at_speed(scenario, rpm):
    """The scenario with other rotors' speeds and the same rotors."""
    return scenario.with_overrides(
        {
            "cluster.rotor.momentum": None,
            "cluster.rotor.spin_inertia": scenario.number("cluster.rotor.momentum") / SPEED,
            "cluster.rotor.speed": f"{rpm} rpm",
        }
    )


@pytest.mark.parametrize("rpm", [0, 2000, 7000])
def test_modes_at_a_speed_are_those_of_the_linearisation(turned, sweep, rpm):
    linear = qb.linearize(
        at_speed(turned.scenario, rpm), gimbal_angles=turned.gimbal_angle, actuator="ideal"
    )
    elastic = [mode for mode in free_modes(linear) if mode.frequency_hz > 1]
    assert len(elastic) == 6
    found = [mode for mode in sweep.modes["isolated"].modes(rpm / 6000) if mode is not None]
    for ours, theirs in zip(found[-6:], elastic, strict=True):
        assert ours.pole == pytest.approx(theirs.pole, rel=1e-8)
        assert ours.name == theirs.name
    if rpm == 7000:  # the split counts: without it the modes would be elsewhere
        still = sweep.modes["isolated"].frequencies(0.0)[-6:]
        assert np.max(np.abs([m.pole.imag for m in elastic] / still - 1)) > 0.01


def test_modes_of_several_bodies_are_named_as_in_the_analysis():
    """The satellite's own speeds; its bodies have unlike mass, so that modes part."""
    scenario = with_payload()
    expected = [mode for mode in qb.analyze(scenario).modes["free"] if mode.frequency_hz > 1]
    sweep = qb.jitter(scenario).sweep()
    found = [mode for mode in sweep.modes["isolated"].modes(1.0) if mode is not None]
    found = sorted(found, key=lambda mode: mode.frequency_hz)[-len(expected) :]
    assert len(expected) == 12
    assert {mode.name.partition(":")[0] for mode in expected} == {"plate", "payload"}
    for ours, theirs in zip(found, expected, strict=True):
        assert ours.frequency_hz == pytest.approx(theirs.frequency_hz, rel=1e-8)
        assert ours.name.partition(":")[0] == theirs.name.partition(":")[0]
        assert abs(ours.shape.conj() @ theirs.shape) == pytest.approx(
            np.linalg.norm(ours.shape) * np.linalg.norm(theirs.shape), rel=1e-6
        )
    named = {critical.mode.name.partition(":")[0] for critical in sweep.critical["isolated"]}
    assert named <= {"plate", "payload"}


@pytest.mark.parametrize("mount", ["isolated", "rigid"])
def test_the_map_is_the_jitter_study_at_its_own_and_at_another_speed(turned, sweep, mount):
    own = sweep.bus_rate[mount][np.flatnonzero(sweep.factor == 1.0)[0]]
    assert own == pytest.approx(turned.bus_rate(mount), rel=1e-12, abs=1e-20)
    i = 200
    rpm = float(sweep.speed[i] * 30 / np.pi)
    other = qb.jitter(at_speed(turned.scenario, rpm), turned.gimbal_angle).bus_rate(mount)
    assert sweep.bus_rate[mount][i] == pytest.approx(other, rel=1e-9, abs=1e-18)
    assert not sweep.bus_rate[mount][0].any()
    assert np.isfinite(sweep.bus_rate[mount]).all()


def test_critical_speeds_solve_the_eigenvalue_problem_of_the_satellite(turned, sweep):
    found = sweep.critical["isolated"]
    assert len(found) == 12  # six modes, orders 1 and 2
    assert sweep.critical["rigid"] == ()
    for critical in found:
        poles = np.linalg.eigvals(sweep.modes["isolated"].state_matrix(critical.factor))
        nearest = np.min(np.abs(poles.imag - critical.order * critical.speed))
        assert nearest < 1e-8 * critical.speed
    assert sweep.excited("isolated").tolist() == [True, False]
    # what is excited there, by a study of a satellite whose rotors turn at that speed
    worst = max(found, key=lambda critical: sweep.amplitude_at(critical, "isolated").max())
    there = qb.jitter(
        at_speed(turned.scenario, float(worst.speed) * 30 / np.pi), turned.gimbal_angle
    )
    lines = there.bus_rate("isolated")[:, there.orders.index(worst.order)]
    expected = np.abs(lines).sum(axis=0)
    assert sweep.amplitude_at(worst, "isolated") == pytest.approx(expected, rel=1e-6)


def test_rotors_of_one_speed_add_with_their_phases(turned, sweep):
    i = np.flatnonzero(sweep.factor == 1.0)[0]
    for mount in ("isolated", "rigid"):
        together = np.abs(sweep.together(mount)[i]).sum(axis=0)
        assert together == pytest.approx(turned.combined(mount).envelope)


def test_lines_of_a_table_meet_the_whirl_that_they_excite():
    """Rocking of a rotor: w^2 -+ Is/It Omega w = w0^2 (undamped), met at w = h Omega."""
    scenario = qb.load_scenario("zhang2012")
    table = {
        "orders": [
            {"order": 0.7, "radial_torque": 1e-9, "whirl": "backward"},
            {"order": 3.0, "radial_torque": 1e-9},
            {"order": 4.0, "radial_force": 1e-9},
            {"order": 5.0, "axial_torque": 1e-9},
        ],
        "resonances": {
            "radial": {"frequency": "300 Hz", "damping": 0.02},
            "rocking": {"frequency": "60 Hz", "damping": 1e-6},
        },
    }
    scenario = scenario.with_overrides({"cluster.rotor.disturbance": table})
    rotor = scenario.cluster.placed()[0].rotor
    ratio = rotor.inertia[0, 0] / rotor.inertia[1, 1]
    satellite = build_satellite(scenario)
    criticals = bearing_critical_speeds(satellite, scenario.cluster.orders, 1.2)
    found = {(c.order, c.mode.name): c.speed / (2 * np.pi) for c in criticals}
    assert found == {
        (3.0, "rotor, rocking, forward"): pytest.approx(60 / np.sqrt(9 - 3 * ratio), rel=1e-6),
        (0.7, "rotor, rocking, backward"): pytest.approx(
            60 / np.sqrt(0.49 + 0.7 * ratio), rel=1e-6
        ),
        (4.0, "rotor, radial"): pytest.approx(75 * np.sqrt(1 - 0.02**2), rel=1e-6),
    }
    # there the model's own transmission has its peak
    peaked = next(c for c in criticals if c.order == 3.0)
    column = scenario.cluster.orders.index(3.0)
    sizes = []
    for factor in peaked.factor * np.array([0.999, 1.0, 1.001]):
        amplitude = satellite.clusters[0].disturbance.amplitudes(
            satellite.clusters[0].units, factor * satellite.rotor_speed
        )
        sizes.append(float(np.abs(amplitude[0, column]).max()))
    assert sizes[1] > 100 * max(sizes[0], sizes[2])


def test_wrong_input_is_refused(turned):
    for bad in ({"max_speed": -1.0}, {"max_speed": np.nan}, {"count": 1}):
        with pytest.raises(ValueError, match=r"max_speed|count"):
            turned.sweep(**bad)
