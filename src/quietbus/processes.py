"""What JAX cannot do: go on in a forked process, or use a device that is not there."""

from __future__ import annotations

import os


class DeviceError(RuntimeError):
    """The user has asked for a device that JAX does not find."""


class _Process:
    computing = False  # JAX's threads may run from here on
    forked = False  # from a process that was computing: its threads are not in this one


def _after_fork() -> None:
    _Process.forked = _Process.computing


if hasattr(os, "register_at_fork"):
    os.register_at_fork(after_in_child=_after_fork)


def start_computing() -> None:
    """Refuse to compute in a process that was forked from one that did; it would hang.

    Raises:
        RuntimeError: this is such a process.
    """
    if _Process.forked:
        raise RuntimeError(
            "this process was forked from one in which quietbus had computed, and JAX's threads "
            "are not in it: it would hang; use multiprocessing.get_context('spawn')"
        )
    _Process.computing = True
