"""JAX settings of the whole package: double precision and a persistent compilation cache.

Imported by every package that computes, before its first array is made. A cache folder that the
user has already chosen (``JAX_COMPILATION_CACHE_DIR``) is respected.
"""

import jax
from platformdirs import user_cache_path

jax.config.update("jax_enable_x64", True)

if jax.config.jax_compilation_cache_dir is None:
    jax.config.update(
        "jax_compilation_cache_dir", str(user_cache_path("quietbus", appauthor=False) / "jax")
    )
    jax.config.update("jax_persistent_cache_min_compile_time_secs", 0.3)
