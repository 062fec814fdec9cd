"""Checks of struts of users' own kinds."""

import jax
import jax.numpy as jnp
import numpy as np

from quietbus.build.own import Asked, is_own, number
from quietbus.model.satellite import Satellite
from quietbus.model.struts import AbstractStrut
from quietbus.programs import compiled_for_few_runs
from quietbus.scenario import Scenario
from quietbus.scenario.errors import dotted

LAWS = ("tension", "memory_rate", "stored", "dissipated")
STROKE, RATE = 1e-3, 1e-2  # of the nominal length; [m/s]: where a strut's energy is looked at
SAME = 1e-6  # to which its parts have to add up, of the largest


def check_strut(strut: AbstractStrut, length: np.ndarray) -> None:
    """Refuse struts with methods of wrong shapes, or not finite at rest at these lengths [m].

    Raises:
        LawError: the first that is wrong.
    """
    asked, per_leg = Asked(strut), (length.shape, "one for each leg")
    asked.fields()
    asked.fits("free_length", strut.free_length, *per_leg)
    z = asked.gives("start", (), (None,), "all states in a row")
    at = (number(*length.shape), number(*length.shape), z)
    asked.gives("tension", at, *per_leg)
    asked.gives("memory_rate", at, z.shape, "as start has it")
    for name in ("stored", "dissipated"):
        asked.gives(name, at, (), "of all legs together")
    for name, value in zip(LAWS, _numbers(strut, jnp.asarray(length)), strict=True):
        asked.finite(name, value)


def energy_notes(scenario: Scenario, satellite: Satellite) -> tuple[str, ...]:
    """Which struts of users' own kinds feed the motion, or do not tell what they take from it."""
    found = []
    for site, legs in zip(scenario.sites, satellite.hexapods, strict=True):
        if is_own(site.isolator.legs.law):
            said = _energy_note(legs.strut, np.asarray(legs.geometry.nominal_length))
            found += [f"{dotted(site.strut_at)}: {said}"] if said else []
    return tuple(found)


def _energy_note(strut: AbstractStrut, length: np.ndarray) -> str:
    """Of tension times rate, what does not go into springs is what dampers take."""
    name, taken, said = type(strut).__name__, 0.0, 0.0
    for moved in (length * (1.0 + STROKE), length * (1.0 - STROKE)):
        parts = _power(strut, jnp.asarray(moved), jnp.full(length.shape, RATE))
        power, gain, said = (float(each) for each in parts)
        taken, bound = power - gain, SAME * max(abs(power), abs(gain), abs(said))
        if min(taken, said) < -bound or abs(taken - said) > bound:
            break
    else:
        return ""
    at = f"with all legs off by {100.0 * STROKE:g} % and growing by {1e3 * RATE:g} mm/s"
    told = f"tension takes {taken:.3g} W beyond what stored gains, dissipated says {said:.3g} W"
    if min(taken, said) < -bound:
        return f"{name} brings energy in, which can make motions grow: {at} {told}"
    return f"the energy of {name} does not add up: {at} {told}"


@compiled_for_few_runs
def _numbers(strut, length):
    at = (length, jnp.zeros_like(length), strut.start())
    return [getattr(strut, law)(*at) for law in LAWS]


@compiled_for_few_runs
def _power(strut, length, rate):
    """What tension takes, what springs gain, what dampers say they take [W]; memory as at rest."""
    z = strut.start()
    z_rate = strut.memory_rate(length, rate, z)
    stored = lambda length, z: strut.stored(length, rate, z)  # noqa: E731
    gain = jax.jvp(stored, (length, z), (rate, z_rate))[1]
    return strut.tension(length, rate, z) @ rate, gain, strut.dissipated(length, rate, z)
