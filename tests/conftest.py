"""What all tests share."""

import gc

import jax
import pytest


@pytest.fixture(autouse=True, scope="module")
def _forget_compiled_programs():
    """Hundreds of compiled programs in one process use up its memory maps; the disk keeps them."""
    yield
    jax.clear_caches()
    gc.collect()
