"""What all tests share."""

import gc
import os
from pathlib import Path

# Most of the tests' time is compilation, of programs that then run for a moment: without LLVM's
# optimisations it takes half as long. Results differ by rounding, which no test may rest on.
os.environ["XLA_FLAGS"] = f"{os.environ.get('XLA_FLAGS', '')} --xla_backend_optimization_level=0"

import pytest

from quietbus import programs

MAPS = Path("/proc/self/maps")
MANY = 30_000  # memory maps; Linux ends a process that has 65530


@pytest.fixture(autouse=True, scope="module")
def _room_for_compiled_programs():
    """Each compiled program takes memory maps for ever; the cache on disk keeps it all the same."""
    yield
    if not MAPS.exists() or MAPS.read_text().count("\n") > MANY:
        programs.forget()
        gc.collect()
