"""What a value of a measured map is, by its unit: density, power, or amplitude of what reading."""

from __future__ import annotations

import re
from dataclasses import dataclass

from pydantic_core import PydanticCustomError

from quietbus.scenario.units import Quantity, shown

PSD = {
    "force": Quantity("a power spectral density", "N^2/Hz", exact=True),
    "torque": Quantity("a power spectral density", "N^2*m^2/Hz", exact=True),
}
_ROOT = {
    "force": Quantity("the root of a power spectral density", "N/Hz^0.5", exact=True),
    "torque": Quantity("the root of a power spectral density", "N*m/Hz^0.5", exact=True),
}
_SQUARE = {
    "force": Quantity("a power spectrum", "N^2", exact=True),
    "torque": Quantity("a power spectrum", "N^2*m^2", exact=True),
}
_AMPLITUDE = {"force": Quantity("an amplitude", "N"), "torque": Quantity("an amplitude", "N*m")}
# an amplitude's reading of a sinusoid, of its root mean square
_READINGS = {"rms": 1.0, "peak": 0.5**0.5, "pk": 0.5**0.5, "pp": 0.125**0.5}
_READING = re.compile(r"[_ ]?(rms|peak|pk|pp)\b", re.IGNORECASE)


@dataclass(frozen=True)
class Scale:
    """How a value becomes a power: (factor * value) ** power, in SI."""

    factor: float
    power: int
    density: bool  # per Hz; else what a sinusoid reads, by the window's noise bandwidth


def scale_of(kind: str, unit: str) -> Scale:
    """What a value of a map of forces or torques (``kind``) in a unit is.

    Raises:
        ValueError: none of these, or an amplitude that does not say of what.
    """
    reading = _READING.search(unit)
    plain = _READING.sub("", unit)
    for text in ("sqrt(Hz)", "√(Hz)", "√Hz", "rtHz"):
        plain = plain.replace(text, "Hz^0.5")
    rms = reading is None or reading[1].lower() == "rms"
    for quantity, power, density in (
        (PSD[kind], 1, True),
        (_ROOT[kind], 2, True),
        (_SQUARE[kind], 1, False),
    ):
        factor = _factor(quantity, plain)
        if factor is not None and rms:
            return Scale(factor, power, density)
    factor, si = _factor(_AMPLITUDE[kind], plain), _AMPLITUDE[kind].unit
    if factor is not None and reading is not None:
        return Scale(factor * _READINGS[reading[1].lower()], 2, False)
    if factor is not None:
        raise ValueError(
            f"an amplitude: does a sinusoid read its peak or its root mean square? write "
            f"{unit}_peak or {unit}_rms; got {shown(unit)}"
        )
    raise ValueError(
        f"expected a power spectral density in {PSD[kind].unit} or its root in "
        f"{_ROOT[kind].unit}, a power spectrum in {_SQUARE[kind].unit}, or an amplitude in "
        f"{si}_rms or {si}_peak, got {shown(unit or None)}"
    )


def _factor(quantity: Quantity, unit: str) -> float | None:
    try:
        return quantity.read(f"1 {unit}") if unit else None
    except PydanticCustomError:
        return None
