"""The multi-loop disk margin, against spectral radii, one loop's own and python-control."""

from dataclasses import replace

import control
import numpy as np
import pytest
from scipy.optimize import brute, minimize

import quietbus as qb
from oracles.linear_systems import random_system
from quietbus.analysis.control.controlled import ControlledSatellite
from quietbus.analysis.control.disk_margin import disk_margin, structured_singular_value
from quietbus.analysis.control.loop import attitude_loop
from quietbus.analysis.control.pid import PID


def multiplied(system, factors):
    """Poles with a complex factor on each axis at the actuator."""
    torque = system.B @ np.diag(factors) @ (system.gain * system.F)
    return np.linalg.eigvals(system.A - torque)


def disk(alpha, rng, count):
    """Random factors in the symmetric disk: (1 + d/2) / (1 - d/2), abs(d) < alpha."""
    size = alpha * np.sqrt(rng.uniform(size=(count, 3)))
    delta = size * np.exp(2j * np.pi * rng.uniform(size=(count, 3)))
    return (1.0 + 0.5 * delta) / (1.0 - 0.5 * delta)


def largest_radius(M):
    """Largest spectral radius of M U over diagonal unitary U: mu of three complex scalars."""

    def radius(phases):
        turned = M * np.exp(1j * np.array([0.0, *phases]))
        return -np.abs(np.linalg.eigvals(turned)).max()

    start = brute(radius, [(0.0, 2 * np.pi)] * 2, Ns=24, finish=None)
    return -minimize(radius, start, method="Nelder-Mead", options={"xatol": 1e-9}).fun


@pytest.mark.parametrize("seed", range(6))
def test_structured_singular_value_is_the_largest_spectral_radius(seed):
    """Packard and Doyle 1993; the bound by scaling is tight for three scalars."""
    rng = np.random.default_rng(seed)
    M = rng.normal(size=(3, 3)) + 1j * rng.normal(size=(3, 3))
    assert structured_singular_value(M) == pytest.approx(largest_radius(M), rel=1e-6)


@pytest.mark.parametrize("which", ["paper", *range(3)])
def test_disk_margin_is_safe_inside_and_reached_at_its_edge(which):
    """No factor inside destabilises; at the worst frequency one on the edge does."""
    system = qb.analyze("zhang2012").controlled if which == "paper" else _stable_random(which)
    alpha = disk_margin(system)
    rng = np.random.default_rng(0)
    for factors in disk(0.999 * alpha, rng, 1000):
        assert multiplied(system, factors).real.max() < 0.0
    omega = np.geomspace(1e-3, 1e3, 20_000)
    M = np.linalg.inv(np.eye(3) + system.loop(omega)) - 0.5 * np.eye(3)
    worst = max(
        np.argsort(np.linalg.norm(M, 2, axis=(1, 2)))[-300:],
        key=lambda i: structured_singular_value(M[i]),
    )
    assert largest_radius(M[worst]) == pytest.approx(1.0 / alpha, rel=1e-4)


def _stable_random(seed):
    system = random_system(100 + seed)
    while system.abscissa(system.gain) >= 0.0:
        system = replace(system, gain=0.5 * system.gain)
    return replace(system, gain=0.5 * system.gain)  # not at the very edge


@pytest.mark.parametrize(
    ("channel", "pid"),
    [
        ((0.1, 1.0), PID(20.0, 0.0, 30.0)),
        ((1.0, 6e-3, 53.0), PID(1e-4, 0.0, 0.03)),  # a sharp resonance sets the margin
    ],
)
def test_disk_margin_of_one_loop_is_the_distance_to_the_critical_point(channel, pid):
    """Three equal loops side by side: 1 / max abs(S - 1/2) of one."""
    n, loop = 3, attitude_loop((channel[-1],), channel, 10.0, pid)
    plant = control.ss(control.tf(loop.numerator, loop.denominator))
    blocks = [np.kron(np.eye(n), np.asarray(M)) for M in (plant.A, plant.B, plant.C)]
    system = ControlledSatellite(blocks[0], blocks[1], blocks[2], 1.0)
    assert system.abscissa(1.0) < 0.0
    near = np.sqrt(53.0) + np.linspace(-0.1, 0.1, 20_001)
    omega = np.concatenate([np.geomspace(1e-4, 100.0, 40_000), near])
    worst = np.abs(1.0 / (1.0 + loop.response(omega)) - 0.5).max()
    assert (channel[-1] == 53.0) == (worst > 1.0)
    assert disk_margin(system) == pytest.approx(1.0 / worst, rel=1e-5)


def test_disk_margin_against_python_control():
    pytest.importorskip("slycot")
    system = qb.analyze("zhang2012").controlled
    L = control.ss(system.A, system.B, system.gain * system.F, np.zeros((3, 3)))
    omega = np.geomspace(1e-3, 1e3, 3000)
    assert disk_margin(system) == pytest.approx(control.disk_margins(L, omega)[0], rel=1e-3)
