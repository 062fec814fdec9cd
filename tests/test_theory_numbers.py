"""Numbers of the built-in satellite that docs/theory.md quotes, from the scenario by hand."""

from pathlib import Path

import numpy as np
import pytest
from scipy.spatial.transform import Rotation

import quietbus as qb
from oracles.pages import assert_says
from quietbus.build import build_satellite

THEORY = (Path(__file__).parents[1] / "docs" / "theory.md").read_text(encoding="utf-8")


@pytest.fixture(scope="module")
def slew():
    return qb.load_scenario("zhang2012-slew")


@pytest.fixture(scope="module")
def legs(slew):
    """Directions (leg, 3), lengths, and the universal joints' fixed axes, nominal pose."""
    legs, up = slew.isolator.legs, np.array([0.0, 0.0, slew.isolator.separation])
    S = np.array(legs.upper_joints) + up - np.array(legs.lower_joints)
    length = np.linalg.norm(S, axis=1)
    axes = np.array(legs.universal_axes)
    return S / length[:, None], length, axes / np.linalg.norm(axes, axis=1)[:, None]


def test_force_and_torque_of_imbalance(slew):
    rotor = slew.cluster.rotor
    square = rotor.speed**2
    assert_says(
        THEORY,
        "at 6000 rpm these are # N and # N m",
        rotor.static_imbalance * square,
        rotor.dynamic_imbalance * square,
    )


def test_what_the_papers_leg_spin_misses(slew, legs):
    s, _, k = legs
    kappa = np.abs(np.sum(k * s, axis=1))
    assert np.ptp(kappa) < 1e-12
    rate = slew.target.guidance.max_rate
    axial = (
        slew.isolator.legs.upper_part.axial_inertia + slew.isolator.legs.lower_part.axial_inertia
    )
    spin = rate / np.sqrt(1.0 - kappa[0] ** 2)
    assert_says(
        THEORY,
        r"($|\kappa| = #$, # deg/s, axial inertia $#$ kg m² per leg)",
        kappa[0],
        np.degrees(rate),
        axial,
    )
    assert_says(THEORY, r"\sqrt{1-\kappa^2} = #$ rad/s, or $#$ N m s per leg", spin, axial * spin)
    start = Rotation.from_euler("ZYX", slew.initial.attitude[::-1])
    turn = (start.inv() * Rotation.from_euler("ZYX", slew.target.attitude[::-1])).as_rotvec()
    inertia = np.asarray(build_satellite(slew).control.controller.J_feedforward_B)
    momentum = rate * np.linalg.norm(inertia @ turn) / np.linalg.norm(turn)
    assert_says(
        THEORY,
        "That is $#$ of the satellite's momentum of # N m s",
        axial * spin / momentum,
        momentum,
    )


def test_term_that_the_papers_joint_force_lacks(slew, legs):
    _, length, _ = legs
    upper = slew.isolator.legs.upper_part
    missing = 2.0 * upper.mass * (1.0 - upper.distance / length[0]) * 1e-4 * 1e-3
    assert_says(THEORY, r"$|\dot s_l| = 1e-3$ rad/s it is $#$ N", missing)


def test_singularity_measure_and_damping_of_the_pyramid(slew):
    """A = [t_1 ... t_4] at zero gimbal angles, for four units alike."""
    skew = slew.cluster.pyramid.skew
    around = 0.5 * np.pi * np.arange(4)
    tangent = np.stack([-np.sin(around), np.cos(around), np.zeros(4)])
    outward = np.stack([np.cos(around), np.sin(around), np.zeros(4)])
    gimbal = np.sin(skew) * outward + np.cos(skew) * np.array([[0.0], [0.0], [1.0]])
    t = np.cross(gimbal, tangent, axis=0)
    determinant = np.linalg.det(t @ t.T)
    assert_says(THEORY, "cannot be had; # for the built-in pyramid", np.sqrt(determinant))
    damping = 0.01 * np.exp(-10.0 * determinant)
    square = np.linalg.eigvalsh(t @ t.T)
    assert_says(THEORY, r"($\lambda = #$)", damping)
    assert_says(THEORY, "delivered: $#$ at the start", damping / square.max())
