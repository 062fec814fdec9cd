"""Elements that are alike but for their numbers are computed together: one trace for all of them.

Six platforms on a bus then take as long to compile as one.
"""

from collections.abc import Callable, Iterable, Sequence
from typing import Any, TypeVar

import jax
import jax.numpy as jnp

from quietbus.model.element import AbstractElement

Found = TypeVar("Found")


def of_each(
    law: Callable[..., Found], elements: Sequence[AbstractElement], *given: Iterable[Any]
) -> list[Found]:
    """``law(element, *arguments)`` of each element, which must not depend on names.

    Args:
        given: for each further argument those of all elements.
    """
    groups: dict[Any, list[int]] = {}
    calls = list(zip((e.nameless() for e in elements), *given, strict=True))
    for i, call in enumerate(calls):
        leaves, structure = jax.tree.flatten(call)
        groups.setdefault((structure, tuple(map(jnp.shape, leaves))), []).append(i)
    found: dict[int, Found] = {}
    for members in groups.values():
        if len(members) == 1:
            found[members[0]] = law(*calls[members[0]])
            continue
        stacked = jax.tree.map(lambda *each: jnp.stack(each), *(calls[i] for i in members))
        together = jax.vmap(law)(*stacked)
        for k, i in enumerate(members):
            found[i] = jax.tree.map(lambda leaf, k=k: leaf[k], together)
    return [found[i] for i in range(len(calls))]
