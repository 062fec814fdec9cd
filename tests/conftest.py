"""What all tests share."""

import gc
from pathlib import Path

import jax
import pytest

MAPS = Path("/proc/self/maps")
MANY = 30_000  # memory maps; Linux ends a process that has 65530


@pytest.fixture(autouse=True, scope="module")
def _room_for_compiled_programs():
    """Each compiled program takes memory maps for ever; the cache on disk keeps it all the same."""
    yield
    if not MAPS.exists() or MAPS.read_text().count("\n") > MANY:
        jax.clear_caches()
        gc.collect()
