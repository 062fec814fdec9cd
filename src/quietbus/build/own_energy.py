"""Whether the energy of parts of users' own kinds adds up.

A sign is soon wrong, and a motion that grows does not say whose it was.
"""

import jax
import jax.numpy as jnp
import numpy as np

from quietbus.build.own import is_own
from quietbus.model.element import Around
from quietbus.model.satellite import Satellite
from quietbus.model.struts import AbstractStrut
from quietbus.programs import compiled_for_few_runs
from quietbus.scenario import Scenario
from quietbus.scenario.errors import dotted

STROKE, RATE = 1e-3, 1e-2  # of the nominal length; [m/s]: where a strut is looked at
MOVED = 1e-3  # by which all that an actuator has of its own is moved
SAME = 1e-6  # to which parts have to add up, of the largest


def energy_notes(scenario: Scenario, satellite: Satellite) -> tuple[str, ...]:
    """Which parts of users' own kinds feed the motion, or do not tell what they take from it."""
    found = []
    for site, legs in zip(scenario.sites, satellite.hexapods, strict=True):
        if is_own(site.isolator.legs.law):
            said = _strut_note(legs.strut, np.asarray(legs.geometry.nominal_length))
            found += [f"{dotted(site.strut_at)}: {said}"] if said else []
    nominal = satellite.nominal() if scenario.actuators else {}
    for actuator in (each for each in satellite.others if each.name in scenario.actuators):
        least = float(jnp.min(_dissipated(actuator, nominal)))
        if least < 0.0:
            found.append(
                f"actuators.{actuator.name}: {type(actuator).__name__} brings energy in, which can "
                f"make motions grow: with all of its own off by {MOVED:g}, up or down, dissipated "
                f"says {least:.3g} W"
            )
    return tuple(found)


def _strut_note(strut: AbstractStrut, length: np.ndarray) -> str:
    """Of tension times rate, what does not go into springs is what dampers take."""
    name, rate = type(strut).__name__, jnp.full(length.shape, RATE)
    for way, change in (("longer", 1.0 + STROKE), ("shorter", 1.0 - STROKE)):
        try:
            parts = _power(strut, jnp.asarray(change * length), rate)
        except Exception as error:  # a law without derivatives, as of a table read by a callback
            return f"the energy of {name} is not looked at: {type(error).__name__}"
        power, gain, said = (float(each) for each in parts)
        taken, bound = power - gain, SAME * max(abs(power), abs(gain), abs(said))
        at = f"with all legs {100.0 * STROKE:g} % {way} and growing by {1e3 * RATE:g} mm/s"
        told = f"tension takes {taken:.3g} W beyond what stored gains, dissipated says {said:.3g} W"
        if min(taken, said) < -bound:
            return f"{name} brings energy in, which can make motions grow: {at} {told}"
        if abs(taken - said) > bound:
            return f"the energy of {name} does not add up: {at} {told}"
    return ""


@compiled_for_few_runs
def _power(strut, length, rate):
    """What tension takes, what springs gain, what dampers say they take [W]; memory as at rest."""
    z = strut.start()
    z_rate = strut.memory_rate(length, rate, z)
    stored = lambda length, z: strut.stored(length, rate, z)  # noqa: E731
    gain = jax.jvp(stored, (length, z), (rate, z_rate))[1]
    return strut.tension(length, rate, z) @ rate, gain, strut.dissipated(length, rate, z)


@compiled_for_few_runs
def _dissipated(actuator, nominal):
    hosts = tuple(nominal[host] for host in actuator.hosts)

    def moved(by):
        own = jax.tree.map(lambda value: value + by, actuator.start())
        return actuator.energy(Around(jnp.zeros(()), jnp.eye(3), hosts, own)).dissipated

    return jnp.stack([moved(MOVED), moved(-MOVED)])
