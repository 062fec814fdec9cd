"""Papers made again: what each claims, how we get it, and what differs."""

import importlib
from typing import TYPE_CHECKING

if TYPE_CHECKING:
    from quietbus.reproduce.parts import Paper

PAPERS = {"zhang2012": "quietbus.reproduce.zhang2012"}


def load_paper(name: str) -> "Paper":
    """A paper by its name.

    Raises:
        KeyError: a name that is not among ``PAPERS``.
    """
    return importlib.import_module(PAPERS[name]).PAPER
