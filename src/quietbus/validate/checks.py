"""A user's scenario by quietbus, by MuJoCo, and against the conservation laws.

The reference (``quietbus.reference``) is made from the scenario's data by code that knows nothing
of quietbus's own model. It is flown as the scenario says, from its start with the plate pushed,
turned and moving, so that every term of the equations of motion is at work.
"""

from collections.abc import Callable, Iterator

import numpy as np

from quietbus.reference.mjcf import write_mjcf
from quietbus.reference.satellite import ReferenceSatellite
from quietbus.scenario import Problem, Scenario, ScenarioError
from quietbus.scenario.sites import BUS
from quietbus.validate.flight import check_energy, check_flight, check_momentum, fly_both
from quietbus.validate.harmonic import check_harmonic
from quietbus.validate.instants import check_instants, check_start
from quietbus.validate.motions import kicked
from quietbus.validate.subject import Check, Subject
from quietbus.validate.trajectory import fastest_rate

FLIGHT = 100.0  # [rad] that the fastest rotor, or mode, turns in a flight


def validate(
    scenario: Scenario,
    random_states: int = 20,
    duration: float | None = None,
    seed: int = 0,
    progress: Callable[[str], None] | None = None,
    *,
    built_from: Scenario | None = None,
) -> list[Check]:
    """Check a scenario; needs MuJoCo (``pip install 'quietbus[validate]'``).

    What the checks do not reach is told by ``not_covered``.

    Args:
        scenario: what both programs read.
        random_states: how many states to compare at.
        duration: of the flights [s]; by default up to 1 s, less for fast rotors.
        seed: of the random states.
        progress: called with the name of each check before it runs.
        built_from: what quietbus's satellite is built from instead, to see a check fail.

    Raises:
        ImportError: MuJoCo is not installed.
        ScenarioError: a part that the program to compare with does not know.
    """
    return list(run_checks(scenario, random_states, duration, seed, progress, built_from))


def run_checks(
    scenario: Scenario,
    random_states: int = 20,
    duration: float | None = None,
    seed: int = 0,
    progress: Callable[[str], None] | None = None,
    built_from: Scenario | None = None,
) -> Iterator[Check]:
    """The checks of ``validate`` one by one, the quickest first."""
    refuse_unknown(scenario)
    tell = progress or (lambda _: None)
    rng = np.random.default_rng(seed)
    subject = Subject(scenario, built_from or scenario)
    tell("start")
    yield check_start(subject)
    tell("instants")
    yield from check_instants(subject, random_states, rng)
    tell("flight")
    if duration is None:
        duration = flight_duration(subject)
    start = kicked(subject.reference, subject.reference.initial(), rng)
    flight = fly_both(subject, start, duration)
    yield check_flight(subject, flight)
    tell("momentum")
    yield from check_momentum(subject, flight)
    tell("energy")
    yield check_energy(subject, flight)
    tell("harmonic")
    yield from check_harmonic(subject, flight)


def flight_duration(subject: Subject) -> float:
    """As long as the fastest rotor, or mode, takes for a few turns; at most 1 s."""
    fastest = fastest_rate(subject.satellite)
    return min(1.0, FLIGHT / fastest, subject.scenario.simulation.duration)


def export_mjcf(scenario: Scenario) -> str:
    """The scenario's satellite at its start as a MuJoCo model (XML), struts without mass."""
    reference = ReferenceSatellite(scenario.to_dict())
    return write_mjcf(reference.mechanism, reference.initial())


def refuse_unknown(scenario: Scenario) -> None:
    """Raise ScenarioError for parts of which the program to compare with knows nothing."""
    unknown = "the program that validate compares with knows none"
    problems = []
    for site in scenario.sites:
        if site.on != BUS:
            said = f"expected {BUS!r}, got {site.on!r}: a body on another platform; {unknown}"
            problems.append(Problem(said, (*site.path, "on")))
        strut = site.isolator.legs.strut
        if strut and not strut.spring_and_damper():
            said = f"expected spring_damper, got {strut.type!r}: a law of your own; {unknown}"
            problems.append(Problem(said, (*site.path, "isolator", "legs", "strut", "type")))
    for name, actuator in scenario.actuators.items():
        said = f"expected none, got one of type {actuator.type!r}; {unknown}"
        problems.append(Problem(said, ("actuators", name)))
    if problems:
        raise ScenarioError(scenario.name, problems)


def not_covered(scenario: Scenario) -> list[str]:
    """What of a scenario ``validate`` does not check, one sentence each."""
    said, units = [], scenario.units
    rotors = [unit.rotor for unit in units.placed() if unit.rotor]
    if any(rotor.disturbance and rotor.disturbance.broadband.given() for rotor in rotors):
        said.append("broadband disturbance of the rotors: both programs fly without it")
    if units.ripple:
        said.append("lines of the gimbal motors in harmonic runs; direct ones are checked")
    if units.run_up:
        said.append("harmonic runs while rotors change speed; `jitter` is checked at their own")
    if any(site.isolator.mount == "rigid" for site in scenario.sites):
        said.append("joint forces of the legs, which a rigid mount leaves undetermined")
    if scenario.lines_of_sight or scenario.requirements:
        said.append("lines of sight and requirements: what is computed from the motion")
    if any(site.isolator.legs.free_length is not None for site in scenario.sites):
        said.append("`jitter` at rest, if the struts' preload leaves no rest")
    return said
