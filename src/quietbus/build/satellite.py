"""From the checked scenario to the parameters of the model; the only room that knows both."""

import dataclasses
from typing import Literal

import jax.numpy as jnp
import numpy as np

from quietbus.build.actuators import actuator_of
from quietbus.build.arrays import array, quaternion, rotation
from quietbus.build.cluster import cluster_of
from quietbus.build.control import controller_of, guidance_of, steering_of
from quietbus.build.legs import legs_of
from quietbus.build.loads import load_of
from quietbus.build.own import built, told_at
from quietbus.build.own_actuators import check_actuator, check_at_start
from quietbus.dynamics.closed_loop import initial_state
from quietbus.dynamics.invariants import rigid_parts
from quietbus.dynamics.state import State
from quietbus.model.body import Body, Mount
from quietbus.model.cluster import Cluster
from quietbus.model.control import Control
from quietbus.model.controller import NoController
from quietbus.model.element import AbstractActuator
from quietbus.model.legs.hexapod import Hexapod
from quietbus.model.satellite import BUS, Satellite
from quietbus.model.steering import NoSteering
from quietbus.model.variants import balanced
from quietbus.programs import compiled_for_few_runs
from quietbus.scenario import Scenario
from quietbus.scenario.sites import Site, from_the_bus


def build_satellite(
    scenario: Scenario,
    mount: Literal["isolated", "rigid"] | None = None,
    first_unit: int = 0,
) -> Satellite:
    """Parameters of the model.

    Args:
        scenario: the checked scenario.
        mount: of all platforms, instead of their own.
        first_unit: number of the first unit where the satellite has others, on other platforms:
            random phases go by it.

    Raises:
        ScenarioError: a part of a user's own kind that is wrong, by class and method.
    """
    if mount not in (None, "isolated", "rigid"):
        raise ValueError(f"mount must be 'isolated' or 'rigid', got {mount!r}")
    bus = scenario.bus
    bodies = [Body(BUS, array(bus.mass), array(np.zeros(3)), array(bus.inertia))]
    hexapods: list[Hexapod] = []
    clusters: list[Cluster] = []
    alone = len(scenario.sites) == 1
    mounts = tuple(_mount(site, mount) for site in from_the_bus(scenario.sites))
    welded = {each.body: each.welded for each in mounts}
    for site in scenario.sites:
        plate = site.plate
        numbers = (plate.mass, plate.center_of_mass, plate.inertia)
        bodies.append(Body(site.name, *map(array, numbers)))
        legs = "legs" if alone else f"{site.name} legs"
        hosts = (site.name, site.on)
        with told_at(scenario, site.strut_at):
            hexapods.append(legs_of(site.isolator, legs, hosts, not welded[site.name]))
        for k, block in enumerate(site.blocks):
            name = "cluster" if alone else f"{site.name} cluster"
            name = name if len(site.blocks) == 1 else f"{name} {k}"
            clusters.append(cluster_of(block, name, site.name, first_unit))
            first_unit += block.count
    actuators = []
    for name, each in scenario.actuators.items():
        with told_at(scenario, ("actuators", name)):
            actuators.append(built(actuator_of, AbstractActuator, each, name))
            check_actuator(actuators[-1], name, scenario.bodies)
    loads = [load_of(load, f"load {k}") for k, load in enumerate(scenario.loads)]
    commanded = [element.name for element in (*clusters, *actuators) if element.commands]
    said = scenario.control
    control = Control(
        guidance_of(scenario),
        NoController(),
        steering_of(said.steering) if said else NoSteering(),
        tuple(commanded),
    )
    satellite = Satellite(
        tuple(bodies),
        mounts,
        tuple(hexapods),
        tuple(clusters),
        (*actuators, *loads),
        control,
    )
    check_at_start(scenario, satellite)
    if not said:
        return satellite
    inertia = _whole_inertia(satellite, array(scenario.units.gimbal_angles))
    pid = controller_of(said, np.asarray(inertia))
    return dataclasses.replace(satellite, control=dataclasses.replace(control, controller=pid))


def build_initial_state(scenario: Scenario, satellite: Satellite) -> State:
    """State at the start of a run: all bodies moving as one, bus mass centre at the origin."""
    return _initial_state(
        satellite,
        array(quaternion(rotation(scenario.initial.attitude))),
        array(scenario.initial.rate),
        array(scenario.units.gimbal_angles),
    )


_initial_state = compiled_for_few_runs(initial_state)


def _mount(site: Site, mount: str | None) -> Mount:
    welded = (mount or site.isolator.mount) == "rigid"
    p, base = site.isolator.pose()
    return Mount(site.name, site.on, array(p), array(quaternion(base)), welded)


@compiled_for_few_runs
def _whole_inertia(satellite, gimbal_angle):
    """Inertia [kg m^2] of the whole satellite about its mass centre, bus axes.

    All bodies in their nominal pose, gimbals at their angles at the start, rotors balanced.
    """
    still = jnp.array([1.0, 0.0, 0.0, 0.0]), jnp.zeros(3)
    satellite = balanced(satellite)
    state = initial_state(satellite, *still, gimbal_angle)
    whole = rigid_parts(satellite, jnp.zeros(()), state)
    r = whole.p - whole.mass @ whole.p / jnp.sum(whole.mass)
    steiner = jnp.eye(3) * (whole.mass @ jnp.sum(r * r, axis=1)) - (whole.mass[:, None] * r).T @ r
    return jnp.sum(whole.I, axis=0) + steiner
