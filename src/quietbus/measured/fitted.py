"""Fits of a rotor's measured maps, and the scenario's disturbance that they make."""

from __future__ import annotations

import math
import os
from dataclasses import dataclass
from typing import Any

import numpy as np
import xarray as xr

from quietbus.analysis.signals.waterfall import (
    ComponentFit,
    FitError,
    FittedMode,
    Waterfall,
    fit,
    transmission,
)
from quietbus.arguments import count
from quietbus.measured.read import read_waterfall
from quietbus.measured.units import PSD
from quietbus.scenario.text import write_yaml
from quietbus.scenario.units import Quantity
from quietbus.scenario.wheel_files import KINDS

_RESONANCES = {"radial_force": "radial", "axial_force": "axial", "radial_torque": "rocking"}
_SNAP = 2e-3  # orders as near to a whole number are taken as that


@dataclass(frozen=True, eq=False)
class WaterfallFit:
    """What the maps of a rotor say: orders, modes on its bearings, broadband floor."""

    components: dict[str, ComponentFit]

    @property
    def notes(self) -> list[str]:
        """What is not to be relied on, and what the block ``disturbance`` leaves out."""
        notes = []
        for name, each in self.components.items():
            notes += [f"{name}: {note}" for note in each.notes]
            kept = _kept(name, each)
            for mode in each.modes:
                if mode is not kept:
                    notes.append(f"{name}: {_left_out(each, mode)}")
            if any(line.doubt for line in each.orders):
                notes.append(f"{name}: orders in doubt are left out of the block 'disturbance'")
        return notes

    def to_dict(self) -> dict[str, Any]:
        """All fitted numbers with their standard deviations, for JSON."""
        return {
            "components": {name: each.to_dict() for name, each in self.components.items()},
            "disturbance": self.disturbance(),
            "notes": self.notes,
        }

    def disturbance(self) -> dict[str, Any]:
        """The scenario's ``rotor.disturbance``.

        Orders of several components that agree within three standard deviations or 0.2 % are one;
        those as near to a whole number are that number. Phases are random: a map has none. Orders
        in doubt are left out. A scenario has one resonance of a component: the one that shapes
        the lines most, with the floor before it.
        """
        resonances, broadband = {}, {}
        for name, each in self.components.items():
            kept = _kept(name, each)
            if kept is not None:
                resonances[_RESONANCES[name]] = {
                    "frequency": kept.frequency.value,
                    "damping": kept.damping.value,
                }
            floor = each.rotor_floor([kept] if kept else [])
            broadband[name] = {"frequency": each.floor_frequency.tolist(), "psd": floor.tolist()}
        block: dict[str, Any] = {"orders": self._orders()}
        if resonances:
            block["resonances"] = resonances
        return _rounded(block | {"broadband": broadband})

    def _orders(self) -> list[dict[str, Any]]:
        orders: list[dict[str, Any]] = []
        found = [
            (line, name)
            for name, each in self.components.items()
            for line in each.orders
            if line.doubt is None
        ]
        for line, name in sorted(found, key=lambda pair: pair[0].order.value):
            value, whirl = line.order.value, line.whirl
            near = max(3.0 * (line.order.deviation or 0.0), _SNAP * min(value, 1.0))
            if round(value) >= 1 and abs(value - round(value)) < near:
                value = float(round(value))
            same = next(
                (
                    o
                    for o in orders
                    if abs(o["order"] - value) < near
                    and o.get("whirl", "forward") == whirl
                    and name not in o
                ),
                None,
            )
            if same is None:
                same = {"order": value}
                if whirl == "backward":
                    same["whirl"] = "backward"
                orders.append(same)
            same[name] = line.coefficient.value
        orders = [order | {"phase": "random"} for order in orders]
        return sorted(orders, key=lambda o: (o["order"], o.get("whirl") == "backward"))

    def to_yaml(self) -> str:
        """YAML text of the block ``disturbance``, in SI units."""
        return write_yaml({"disturbance": self.disturbance()})

    def to_dataset(self) -> xr.Dataset:
        """Maps: measured, fitted and residual, by component."""
        data = {}
        for name, each in self.components.items():
            unit = {"units": PSD[name.rpartition("_")[2]].unit}
            for what, values, attributes in (
                ("measured", each.measured.psd, unit),
                ("fitted", each.fitted, unit),
                ("residual", each.residual_db, {"units": "dB"}),
            ):
                data[f"{name}_{what}"] = (("speed", "frequency"), values, attributes)
        first = next(iter(self.components.values())).measured
        coordinates = {
            "speed": ("speed", first.speed, {"units": "rad/s"}),
            "frequency": ("frequency", first.frequency, {"units": "Hz"}),
        }
        return xr.Dataset(data, coordinates)


def _kept(name: str, fitted: ComponentFit) -> FittedMode | None:
    """The mode of a component that a scenario can have: the one that shapes the lines most."""
    # a mode in a torque that does not split is a structure's, not the rotor's rocking
    able = [mode for mode in fitted.modes if mode.split or name != "radial_torque"]
    if name not in _RESONANCES or not able:
        return None
    return max(able, key=lambda mode: float(np.ptp(np.log(_amplified(fitted, mode)))))


def _left_out(fitted: ComponentFit, mode: FittedMode) -> str:
    largest = float(np.max(np.abs(np.log(_amplified(fitted, mode)))))
    return (
        f"the block 'disturbance' holds one resonance of the rotor on its bearings; the mode at "
        f"{mode.frequency.value:.4g} Hz is left out, which changes lines by up to a factor of "
        f"{math.exp(largest):.2g}"
    )


def _amplified(fitted: ComponentFit, mode: FittedMode) -> np.ndarray:
    """What a mode lets pass of every line at every speed."""
    own = mode.mode
    ways = [1.0 if line.whirl == "forward" else -1.0 for line in fitted.orders]
    return np.concatenate(
        [
            transmission(line.order.value, speed, own.w0, own.damping, way * own.split)
            for line, speed, way in zip(fitted.orders, fitted.line_speed, ways, strict=True)
        ]
    )


def _rounded(data: Any) -> Any:
    """Six digits, more than any fit is good for, which can be read."""
    if isinstance(data, dict):
        return {key: _rounded(value) for key, value in data.items()}
    if isinstance(data, list):
        return [_rounded(value) for value in data]
    return float(f"{data:.6g}") if isinstance(data, float) else data


def fit_waterfall(maps: xr.Dataset | str | os.PathLike[str], most: int = 20) -> WaterfallFit:
    """Fit orders, coefficients, modes on the bearings and broadband floor to measured maps.

    Args:
        maps: as of ``read_waterfall``, or the path of a file for it.
        most: number of orders that are looked for in each component.

    Raises:
        MapError: the file is wrong.
        FitError: too few speeds, no order stands out, lines do not have the declared window's
            shape, or what was found does not explain the map; it names the component.
    """
    count("most", most)
    data = maps if isinstance(maps, xr.Dataset) else read_waterfall(maps)
    fits = {}
    for name in (kind for kind in KINDS if kind in data):
        array = data[name].transpose("speed", "frequency")
        measured = Waterfall(
            name,
            array["speed"].to_numpy(),
            array["frequency"].to_numpy(),
            array.to_numpy(),
            array.attrs.get("window"),
            sample_rate=_hertz(array.attrs.get("sample_rate")),
            noise_bandwidth=array.attrs.get("noise_bandwidth"),
        )
        try:
            fits[name] = fit(measured, most)
        except FitError as error:
            raise FitError(f"{name}: {error}") from None
    if not fits:
        raise FitError(f"expected variables among {', '.join(KINDS)}, got none")
    return WaterfallFit(fits)


def _hertz(rate: str | None) -> float | None:
    return None if rate is None else Quantity("a frequency", "Hz", above=0.0).read(rate)
