"""Checks of struts of users' own kinds."""

import jax
import jax.numpy as jnp
import numpy as np

from quietbus.build.own import Asked, number
from quietbus.model.struts import AbstractStrut
from quietbus.programs import compiled_for_few_runs

LAWS = ("tension", "memory_rate", "stored", "dissipated")  # the first two have derivatives


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
    for name in LAWS[:2]:
        asked.slopes(name, *at)
    numbers, slopes = _at_rest(strut, jnp.asarray(length))
    for name, value in zip(LAWS, numbers, strict=True):
        asked.finite(name, value)
    for name, value in zip(LAWS[:2], slopes, strict=True):
        asked.finite(name, value, "derivatives")


@compiled_for_few_runs
def _at_rest(strut, length):
    at = (length, jnp.zeros_like(length), strut.start())
    numbers = [getattr(strut, law)(*at) for law in LAWS]
    slopes = [jax.jacfwd(getattr(strut, law), argnums=(0, 1, 2))(*at) for law in LAWS[:2]]
    return numbers, slopes
