"""JAX settings of the whole package: precision, compilation cache, how programs are compiled.

Imported by every package that computes, before it uses JAX. What the user has already chosen
(``JAX_COMPILATION_CACHE_DIR``, options in ``XLA_FLAGS``) is respected, and the environment stays as
it is: docs/api.md says what changes in the process.
"""

import os
from importlib.metadata import version

import jax
from jaxlib.xla_client import CompileOptions
from platformdirs import user_cache_path

from quietbus.processes import DeviceError

# XLA runs each small operation of a loop as a kernel of its own, with an overhead as large as the
# operation. Loops that touch less than this many bytes are compiled as one function instead, which
# makes an integration step about twice as fast. XLA ignores the option where it does not know it.
_FLAGS = {
    "xla_backend_extra_options": "xla_cpu_small_while_loop_byte_threshold=100000000",
}
# Compilation takes a third less time without the new emitters, and programs run as fast. XLA ends
# the process where it does not know a flag, so only for versions that do.
if (0, 6) <= tuple(int(part) for part in version("jaxlib").split(".")[:2]) < (0, 11):
    _FLAGS["xla_cpu_use_fusion_emitters"] = "false"


def _let_xla_read_flags() -> str:
    """XLA reads its flags once in a process; programs that the user starts have no part in them."""
    given = os.environ.get("XLA_FLAGS")
    added = [f"--{flag}={value}" for flag, value in _FLAGS.items() if flag not in (given or "")]
    read = os.environ["XLA_FLAGS"] = " ".join([given or "", *added]).strip()
    try:
        _ = CompileOptions().executable_build_options.debug_options  # for which XLA reads them
    finally:
        del os.environ["XLA_FLAGS"]
        if given is not None:
            os.environ["XLA_FLAGS"] = given
    return read


XLA_FLAGS = _let_xla_read_flags()
jax.config.update("jax_enable_x64", True)

if jax.config.values["jax_compilation_cache_dir"] is None:
    jax.config.update(
        "jax_compilation_cache_dir", str(user_cache_path("quietbus", appauthor=False) / "jax")
    )
    jax.config.update("jax_persistent_cache_min_compile_time_secs", 0.3)

if os.environ.get("JAX_PLATFORMS", "cpu") not in ("", "cpu"):
    try:
        jax.devices()
    except (RuntimeError, AssertionError):
        raise DeviceError(
            f"JAX_PLATFORMS={os.environ['JAX_PLATFORMS']} asks for a device that JAX does not find "
            "here; leave it out to compute on the processor"
        ) from None
