"""Transmissibility against the hexapod on a fixed base, momentum, and the limit of slow motion."""

from dataclasses import replace

import jax.numpy as jnp
import numpy as np

import quietbus as qb
from oracles.satellites import paper_satellite
from quietbus.analysis.control.hexapod import hexapod_isolator
from quietbus.analysis.control.transmissibility import Places, transmissibility
from quietbus.dynamics.linearize import OperatingPoint, linearize, platform_inertia
from quietbus.model.variants import with_base_fixed, with_mount, without_rotation
from quietbus.spatial.rotation import quaternion_to_matrix
from quietbus.validate.trajectory import massless_legs

REST = OperatingPoint(np.zeros(3), np.zeros(4))
HZ = np.array([0.2, 2.5, 4.4, 30.0, 100.0])
BASE = np.array([0.0, 0.0, 0.6])


def passed(satellite, frequency=HZ):
    places = Places(
        mass=float(satellite.bus.mass_X),
        inertia=np.asarray(satellite.bus.I_XXcm_X),
        base=BASE,
        R_BP=np.asarray(quaternion_to_matrix(satellite.mounts[0].q_BX)),
        center=platform_inertia(satellite, np.zeros(4), "plate")[1],
    )
    rigid = linearize(with_mount(satellite, welded=True), REST, "ideal")
    return transmissibility(linearize(satellite, REST, "ideal"), rigid, places, frequency)


def uneven():
    """Massless legs of unlike stiffness and damping under a plate that is not balanced."""
    satellite = without_rotation(massless_legs(paper_satellite(imbalance=0.0)))
    (legs,), (bus, plate) = satellite.hexapods, satellite.bodies
    strut = replace(
        legs.strut,
        stiffness=legs.strut.stiffness * jnp.linspace(0.7, 1.4, 6),
        damping=legs.strut.damping * jnp.linspace(1.5, 0.6, 6),
    )
    plate = replace(plate, p_XXcm_X=jnp.array([0.1, -0.2, 0.15]))
    return replace(satellite, hexapods=(replace(legs, strut=strut),), bodies=(bus, plate))


def test_fixed_base_is_the_hexapod_isolator():
    satellite = uneven()
    mass, center, inertia = platform_inertia(satellite, np.zeros(4), "plate")
    isolator = hexapod_isolator(
        np.asarray(satellite.hexapods[0].geometry.p_PU_P),
        np.asarray(satellite.hexapods[0].geometry.p_BA_B) - BASE,
        0.25 * np.sqrt(2.0),
        mass,
        inertia,
        center,
        np.asarray(satellite.hexapods[0].strut.stiffness),
        np.asarray(satellite.hexapods[0].strut.damping),
    )
    expected = isolator.transmissibility(2 * np.pi * HZ)
    size = np.abs(expected).max(axis=(1, 2), keepdims=True)
    np.testing.assert_allclose(
        passed(with_base_fixed(satellite)).base / size, expected / size, atol=1e-8
    )


def test_what_the_base_does_not_get_the_plate_keeps():
    """Momentum of the plate and its CMGs, from the motion of the plate alone."""
    satellite = uneven()
    mass, center, inertia = platform_inertia(satellite, np.zeros(4), "plate")
    model = linearize(satellite, REST, "ideal")
    s = 2j * np.pi * HZ[:, None, None]
    outputs = ["plate_velocity", "bus_velocity", "plate_rate"]
    motion = model.select(["plate_force", "plate_torque"], outputs).response(HZ)
    cross = np.cross(np.eye(3), center)  # c x v = cross v
    drive = np.block([[np.eye(3), np.zeros((3, 3))], [cross, np.eye(3)]])
    motion = motion @ drive
    v_P, w = motion[:, :3] + motion[:, 3:6], motion[:, 6:]
    v = v_P - cross @ w  # of the mass centre: w x c
    result = passed(satellite).base
    kept = s * mass * v
    np.testing.assert_allclose(result[:, :3], np.eye(6)[:3] - kept, atol=1e-9)
    arm = np.array([0.0, 0.0, 0.25 * np.sqrt(2.0)]) + center  # from the base's centre
    at_center = np.eye(6)[3:] - s * inertia @ w
    moment = at_center + np.cross(np.eye(3), arm) @ result[:, :3]
    np.testing.assert_allclose(result[:, 3:], moment, atol=1e-9)


def test_slow_wrenches_pass_and_fast_ones_do_not():
    study = qb.analyze("zhang2012")
    slow, fast = study.transmissibility(np.array([1e-3, 100.0])).rate_ratio
    np.testing.assert_allclose(slow, 1.0, atol=1e-3)
    assert np.all(fast < 0.05)


def test_line_of_sight_is_the_integral_of_the_rate():
    study = qb.analyze("zhang2012")
    result = study.transmissibility(HZ)
    wrench = ["plate_force", "plate_torque"]
    attitude = study.linear("ideal").select(wrench, ["bus_attitude"]).response(HZ)
    np.testing.assert_allclose(result.line_of_sight, attitude, rtol=1e-8, atol=1e-15)


def test_bus_rate_on_the_rigid_mount_is_that_of_one_body():
    study = qb.analyze("zhang2012")
    result = study.transmissibility(HZ)
    rates = result.rigid_bus_rate * HZ[:, None, None]
    np.testing.assert_allclose(rates, np.broadcast_to(rates[0], rates.shape), rtol=1e-9, atol=1e-15)
