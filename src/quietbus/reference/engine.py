"""MuJoCo, which is an optional part of the installation."""

from types import ModuleType


def import_mujoco() -> ModuleType:
    """The ``mujoco`` module; without it, an ImportError that says how to get it."""
    try:
        import mujoco
    except ImportError as error:
        raise ImportError(
            "this check runs the independent engine MuJoCo, which is not installed; "
            "get it with: pip install 'quietbus[validate]'"
        ) from error
    return mujoco
