"""Channel transfer functions of a hexapod isolator, derived from its geometry.

The setting is that of Zhang & Xu 2012, eq. 31-33: base fixed, legs without mass, small motion;
torque about the upper platform's mass centre in, torque on the base plate *about its centre*
out. With x = (displacement of the mass centre, rotation), J the legs' elongation per x and k, c
the struts' stiffness and damping,

    M x'' + C x' + K x = w,        K = J^T diag(k) J,   C = J^T diag(c) J,
    base wrench = J_D^T (diag(k) J x + diag(c) J x').

What struts remember adds to their tension. A channel is the exact, minimal rational function from
the torque about one axis to the base torque about the same axis (`minimal`). Where all legs have
the same c/k and remember nothing, it depends on s through u = c s + k and s^2 only, and is then
also given with k and c as symbols (`symbolic`).
"""

from __future__ import annotations

import dataclasses
import math
from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import ArrayLike, NDArray

from quietbus.analysis.control.hexapod import HexapodIsolator
from quietbus.analysis.control.minimal import Pole, minimal
from quietbus.analysis.control.rational import Array, Coefficients, minus_3db_frequency, peak
from quietbus.analysis.control.symbolic import SymbolicChannel
from quietbus.plain import json_ready

AXES = ("x", "y", "z")


@dataclass(frozen=True)
class Channel:
    """The transfer function of one axis and what is read from it, each under its own name.

    The paper's "corner frequency" is `peak_frequency_hz`.
    """

    axis: str
    numerator: Coefficients  # descending powers of s; leading coefficient c, or k if undamped
    denominator: Coefficients  # descending powers of s; same normalisation, see `SymbolicChannel`
    symbolic: SymbolicChannel | None  # None where legs differ in c/k or remember; then D is monic
    peak_frequency_hz: float  # [Hz] of the largest gain; 0 if largest at rest
    peak_gain: float  # [-] inf for an undamped channel
    minus_3db_frequency_hz: float | None  # [Hz] gain first falls below 1/sqrt(2)
    undamped_frequencies_hz: tuple[float, ...]  # [Hz] of the stiffness at rest
    poles: tuple[Pole, ...]  # damped frequencies and damping ratios
    coupling: float  # [-] largest gain to the base torque about another axis, any frequency
    coupling_axis: str | None  # that other axis; None without coupling

    def response(self, omega: ArrayLike) -> NDArray[np.complex128]:
        """G(j omega) at angular frequencies `omega` [rad/s]."""
        s = 1j * np.asarray(omega, float)
        return np.polyval(self.numerator, s) / np.polyval(self.denominator, s)

    def to_control(self) -> Any:
        """The same as a ``control.TransferFunction``."""
        import control

        return control.tf(self.numerator, self.denominator)

    def to_dict(self) -> dict[str, Any]:
        """For JSON: plain numbers, None where infinite."""
        values = {field.name: getattr(self, field.name) for field in dataclasses.fields(self)}
        values["symbolic"] = None if self.symbolic is None else str(self.symbolic)
        values["poles"] = [pole.to_dict() for pole in self.poles]
        return json_ready(values)


@dataclass(frozen=True)
class Channels:
    """The three rotational channels of a hexapod isolator."""

    x: Channel
    y: Channel
    z: Channel
    coupling: tuple[tuple[float, ...], ...]  # (3, 3) [-] peak gain, base torque i per torque j

    def __iter__(self) -> Any:
        return iter((self.x, self.y, self.z))

    @property
    def largest_coupling(self) -> float:
        """Largest gain [-] from a torque about one axis to the base torque about another."""
        return max(channel.coupling for channel in self)

    @property
    def verdict(self) -> str:
        """Whether one axis may be looked at without the others, in words."""
        if self.largest_coupling == 0.0:
            return "The three channels are independent of each other."
        worst = max(self, key=lambda channel: channel.coupling)
        return (
            f"The channels are coupled: torque about {worst.axis} reaches the base about "
            f"{worst.coupling_axis} with a gain of up to {worst.coupling:.3g}. "
            "Look at the coupled analysis."
        )

    def to_dict(self) -> dict[str, Any]:
        """For JSON, keyed by axis."""
        return {channel.axis: channel.to_dict() for channel in self}


def channels(isolator: HexapodIsolator) -> Channels:
    """Derive the three channels (eq. 31-33 for the paper's geometry)."""
    coupling = np.zeros((3, 3))
    for i in range(3):
        for j in range(3):
            reduced = minimal(isolator, i, j)
            if reduced is not None:
                coupling[i, j] = peak(*reduced.polynomials())[1]
    x, y, z = (_channel(isolator, i, coupling[:, i]) for i in range(3))
    return Channels(x, y, z, tuple(map(tuple, coupling.tolist())))


def _channel(isolator: HexapodIsolator, i: int, gains: Array) -> Channel:
    reduced = minimal(isolator, i, i)
    if reduced is None:
        raise ValueError(
            f"no torque about {AXES[i]} reaches the base about its centre; check the joints"
        )
    symbolic = None
    if isolator.is_proportional:
        k, c = float(isolator.stiffness.mean()), float(isolator.damping.mean())
        symbolic = reduced.symbolic(k)
        numerator, denominator = symbolic.coefficients(k, c)
    else:
        numerator, denominator = reduced.polynomials()
    peak_frequency, peak_gain = peak(numerator, denominator)
    minus_3db = minus_3db_frequency(numerator, denominator)
    others = np.delete(np.arange(3), i)
    other = int(others[np.argmax(gains[others])])
    return Channel(
        axis=AXES[i],
        numerator=numerator,
        denominator=denominator,
        symbolic=symbolic,
        peak_frequency_hz=peak_frequency / (2.0 * math.pi),
        peak_gain=peak_gain,
        minus_3db_frequency_hz=None if minus_3db is None else minus_3db / (2.0 * math.pi),
        undamped_frequencies_hz=tuple((reduced.undamped_frequencies() / (2.0 * math.pi)).tolist()),
        poles=reduced.poles(),
        coupling=float(gains[other]),
        coupling_axis=AXES[other] if gains[other] > 0 else None,
    )
