"""MuJoCo, which is an optional part of the installation."""

from types import ModuleType
from typing import Any

import numpy as np


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


def model_of(xml: str) -> Any:
    """The ``mujoco.MjModel`` of MJCF text, which takes every mass centre as it is given.

    MuJoCo puts a mass centre within 1e-6 m of its body's origin on it, and principal axes likewise:
    a rotor's imbalance would be lost.
    """
    mujoco = import_mujoco()
    model = mujoco.MjModel.from_xml_string(xml)
    moved = np.any(model.body_ipos != 0.0, axis=1)
    turned = np.any(model.body_iquat != [1.0, 0.0, 0.0, 0.0], axis=1)
    model.body_sameframe[moved | turned] = int(mujoco.mjtSameFrame.mjSAMEFRAME_NONE)
    return model
