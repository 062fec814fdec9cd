"""How far the harmonic view may be trusted: resonance, growth, and what is of second order."""

import jax.numpy as jnp
import numpy as np

from quietbus.dynamics.rotor_response import orders_of
from quietbus.model.satellite import Satellite

SLOW_CHANGE = 0.05  # largest estimated error of the jitter that needs no warning
ON_A_MODE = 1e-8  # relative distance from a mode at which the response counts as infinite
SPEED_STEP = 0.005  # relative change of a speed after which the modes are computed anew
MOST_BASES = 256  # instants at the most at which they are, besides


class ResonanceError(ValueError):
    """An order of a rotor lies on an undamped mode, where no steady response exists."""


def refuse_resonance(
    satellite: Satellite, where: str, eigenvalues: np.ndarray, speeds: np.ndarray
) -> None:
    """Raise ResonanceError if an order of a rotor lies on an undamped mode.

    Args:
        where: which operating point, for the message.
        eigenvalues: of the controlled satellite [rad/s].
        speeds: (cmg,) of the rotors [rad/s].
    """
    for j, speed in enumerate(np.asarray(speeds)):
        for h in orders_of(satellite):
            distance = np.min(np.abs(1j * h * speed - eigenvalues))
            if speed != 0.0 and distance < ON_A_MODE * abs(h * speed):
                raise ResonanceError(
                    f"order {h:g} of rotor {j} ({abs(h * speed) / (2 * np.pi):.6g} Hz) lies on an "
                    f"undamped mode of the satellite {where}: the steady jitter would be "
                    "infinite. Give the struts damping, or change the rotor's speed"
                )


def growing(eigenvalues: np.ndarray, least: float) -> str:
    """The fastest growing mode in words, or nothing if none grows faster than ``least`` [1/s]."""
    fastest = eigenvalues[np.argmax(eigenvalues.real)]
    if fastest.real <= max(least, 1e-9 * np.max(np.abs(eigenvalues))):
        return ""
    return (
        f"a mode at {abs(fastest.imag) / (2 * np.pi):.4g} Hz grows, e-fold in "
        f"{1 / fastest.real:.3g} s"
    )


def total(amplitudes: np.ndarray) -> np.ndarray:
    """Lengths of vectors (n, cmg, order, ..., axis), summed over all lines."""
    return np.sum(np.linalg.norm(amplitudes, axis=-1), axis=(1, 2))


def second_order(satellite: Satellite, amplitudes: dict[str, np.ndarray]) -> np.ndarray:
    """Share (n,) of the jitter that what is of second order in it may have.

    As much as the jitter changes the geometry that its equations are linear about: strokes over
    the legs' lengths, and turns.
    """
    turn = total(amplitudes["bus_attitude"])
    if not satellite.hexapods:
        return turn
    lengths = np.concatenate([np.asarray(h.geometry.nominal_length) for h in satellite.hexapods])
    stroke = np.sum(np.abs(amplitudes["leg_stroke"]), axis=(1, 2))
    return np.max(stroke / lengths, axis=1) + turn


def where_speeds_change(speeds: np.ndarray) -> np.ndarray:
    """Instants between which no rotor's speed (n, cmg) changes by much of the largest, ascending.

    The first alone where speeds stay.
    """
    largest = np.max(np.abs(speeds), initial=0.0) or 1.0
    way = np.append(0.0, np.cumsum(np.max(np.abs(np.diff(speeds, axis=0)), axis=1, initial=0.0)))
    step = max(SPEED_STEP * largest, way[-1] / MOST_BASES)
    return np.unique((way / step).astype(int), return_index=True)[1]


def ripple_said(satellite: Satellite, gimbal_rate: np.ndarray) -> tuple[str, ...]:
    """A warning where gimbal motors' ripple shifts its own phase by much.

    Args:
        gimbal_rate: (n, cmg) of all units [rad/s].
    """
    worst = 0.0
    for cluster, own in satellite.numbered():
        worst = max(worst, float(cluster.modulation(jnp.asarray(gimbal_rate[:, own]))))
    if worst <= SLOW_CHANGE:
        return ()
    return (
        f"the gimbal motors' ripple turns the gimbals by up to {worst:.2g} rad of its own phase: "
        f"the jitter that it causes may be wrong by as much (above {SLOW_CHANGE:g} rad use method "
        "'direct')",
    )
