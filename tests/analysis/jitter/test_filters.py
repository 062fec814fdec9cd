"""Six low-pass filters for the isolator: exact where nothing couples, and where not."""

from dataclasses import replace

import jax
import jax.numpy as jnp
import numpy as np
import pytest

from oracles.satellites import awkward_satellite, paper_satellite, with_units
from oracles.satellites import uncontrolled as without_control
from quietbus.analysis.control.isolator import SingleAxisIsolator, transmissibility
from quietbus.analysis.jitter.filters import filtered_jitter_of_designs, platform_at_rest
from quietbus.analysis.jitter.lines import steady_jitter
from quietbus.model.satellite import Satellite
from quietbus.model.variants import without_friction, without_leg_mass

STIFFNESS, DAMPING, SEPARATION = 2e4, 500.0, 0.25 * np.sqrt(2.0)
CENTRE = -0.5 * SEPARATION  # of the hexapod's stiffness, from the upper joint plane
HZ = np.array([0.5, 2.5, 3.8, 5.0, 20.0, 100.0, 200.0])


def uncontrolled(satellite: Satellite) -> Satellite:
    return without_friction(without_leg_mass(without_control(satellite)))


def heavy(satellite: Satellite) -> Satellite:
    """A bus that does not move to speak of, without products of inertia."""
    bus, plate = satellite.bodies
    inertia = 1e12 * jnp.diag(jnp.array([1.1, 0.9, 0.8]))
    bus = replace(bus, mass_X=jnp.array(1e12), I_XXcm_X=inertia)
    return replace(satellite, bodies=(bus, plate))


def with_mass_centre(satellite: Satellite, height: float) -> Satellite:
    """Plate and CMGs moved along plate z against the joints."""
    shift = jnp.array([0.0, 0.0, height])
    bus, plate = satellite.bodies
    plate = replace(plate, p_XXcm_X=plate.p_XXcm_X + shift)
    moved = with_units(satellite, p_PC_P=satellite.clusters[0].units.p_PC_P + shift)
    return replace(moved, bodies=(bus, plate))


def at_speeds(satellite: Satellite) -> list[Satellite]:
    ones = jnp.ones(satellite.count)
    return [with_units(satellite, rotor_speed=2.0 * np.pi * hz * ones) for hz in HZ]


@pytest.fixture(scope="module")
def found():
    """Jitter (speed, cmg, order, axis) of several satellites, one program for all."""
    paper = uncontrolled(paper_satellite())
    turned = uncontrolled(awkward_satellite())
    (legs,) = turned.hexapods
    strut = replace(legs.strut, free_length=legs.geometry.nominal_length)  # no preload
    turned = heavy(replace(turned, hexapods=(replace(legs, strut=strut),)))
    cases = {
        "paper": paper,
        "heavy": heavy(paper),
        "centred": heavy(with_mass_centre(paper, CENTRE)),
        "awkward": turned,
    }
    angles = {name: np.zeros(4) for name in cases} | {"awkward": np.array([0.4, -0.9, 1.3, 0.2])}
    designs = [design for satellite in cases.values() for design in at_speeds(satellite)]
    each = np.concatenate([np.tile(angles[name], (len(HZ), 1)) for name in cases])
    whole = filtered_jitter_of_designs(designs, each)
    split = lambda values, i: values[i * len(HZ) : (i + 1) * len(HZ)]  # noqa: E731
    return {
        name: replace(whole, **{k: split(v, i) for k, v in vars(whole).items()})
        for i, name in enumerate(cases)
    }


def test_filters_are_exact_about_z_where_nothing_couples_with_it(found):
    """Held bus, centred platform, no net momentum: the z channel is one mass on one strut."""
    jitter = found["heavy"]
    assert np.max(jitter.error("filters")[:, 2]) < 1e-7
    assert np.max(jitter.error("springs")[-1, 2]) > 0.9  # what dampers pass on is most at 200 Hz
    # eq. 2 with the hexapod's 0.75 k about z, over what a bolted CMG does
    ratio = np.abs(jitter.full[:, :, 0, 2] / jitter.rigid[:, :, 0, 2])
    isolator = SingleAxisIsolator(15.0, 0.75 * STIFFNESS, 0.75 * DAMPING)
    expected = isolator.transmissibility(2.0 * np.pi * HZ)
    inertia = np.asarray(platform_at_rest(uncontrolled(paper_satellite()), np.zeros(4)).M)[5, 5]
    assert inertia == pytest.approx(15.0, rel=2e-3)
    assert ratio == pytest.approx(np.tile(expected[:, None], 4), rel=5e-3)


def test_filters_are_exact_on_all_axes_if_the_mass_centre_is_that_of_the_stiffness(found):
    assert np.max(found["centred"].error("filters")) < 1e-7
    assert np.min(found["heavy"].error("filters")[:, :2]) > 1e-2


def test_one_filter_of_six_by_six_is_exact_on_a_held_bus(found):
    """Tilted plate, mass centre off the axes, rotors with net momentum, unlike legs."""
    assert np.max(found["awkward"].error("coupled")) < 1e-7
    assert np.min(found["awkward"].error("filters")[1:]) > 1e-2


def test_each_filter_is_the_single_axis_isolator_of_that_freedom():
    platform = platform_at_rest(uncontrolled(paper_satellite()), np.zeros(4))
    mass = np.asarray(platform.M).diagonal()
    share = np.array([2.0, 2.0, 2.0, 0.25, 0.25, 0.75])  # hexapod stiffness over k, eq. 31-33
    frequency = np.sqrt(share * STIFFNESS / mass)
    assert mass[:3] == pytest.approx(82.8 * np.ones(3))
    assert np.asarray(platform.frequency_hz) == pytest.approx(frequency / (2.0 * np.pi), rel=1e-9)
    damping = 0.5 * share * DAMPING / np.sqrt(share * STIFFNESS * mass)
    assert np.asarray(platform.damping_ratio) == pytest.approx(damping, rel=1e-9)
    for hz in HZ:
        omega = 2.0 * np.pi * hz
        passed = np.abs(np.asarray(platform.filters(1j * omega)).diagonal())
        assert passed == pytest.approx(transmissibility(omega / frequency, damping), rel=1e-9)
        spring = np.asarray(platform.filters(1j * omega, damper=False)).diagonal()
        closed = share * STIFFNESS / (share * (STIFFNESS + 1j * omega * DAMPING) - mass * omega**2)
        assert spring == pytest.approx(closed, rel=1e-9)


def test_the_full_model_is_that_of_the_jitter_analysis(found):
    k = int(np.argmax(HZ == 100.0))
    satellite = at_speeds(uncontrolled(paper_satellite()))[k]
    rate = jax.jit(steady_jitter)(satellite, jnp.zeros(4))[0]["bus_rate"]
    assert found["paper"].full[k] == pytest.approx(np.asarray(rate), rel=1e-9, abs=1e-18)


def test_error_and_ratio_are_root_sums_of_squares_over_rotors_and_orders(found):
    jitter = found["paper"]
    k, axis = 3, 1
    full, filters = jitter.full[k, :, :, axis], jitter.filters[k, :, :, axis]
    norm = np.linalg.norm(full)
    assert jitter.ratio("filters")[k, axis] == pytest.approx(np.linalg.norm(filters) / norm)
    assert jitter.error("filters")[k, axis] == pytest.approx(np.linalg.norm(filters - full) / norm)
